// quotient = floor((head * 2^QUO_W + tail) / den), for head < den. Where head = den and tail = 0 the quotient would
// need one bit more and saturates to all ones: after rounding off its last bit that is the right answer, exactly 1.
//
// Non-restoring: each row adds or subtracts the denominator once and yields one quotient bit, so that a row costs one
// LUT a bit and no restoring multiplexer. STAGES rows form a ring of pipeline stages that an operation passes
// LOOPS = ceil(QUO_W / STAGES) times: one parameter goes from a serial divider (1: smallest) to a pipelined one
// (QUO_W: an operation a clock). A ring needs a multiplexer at its entry only, which is why it is smaller than several
// serial dividers side by side.
//
// Latency STAGES * LOOPS cycles; STAGES operations in flight, so an operation each LOOPS cycles on average. Results
// leave in the order in which the operations came. Exact: no rounding, see above for saturation.
module openecho_divide #(
    parameter int DEN_W  = 19,
    parameter int QUO_W  = 17,
    parameter int STAGES = 9
) (
    input  logic             clk,
    input  logic             rst,
    input  logic             s_valid,
    output logic             s_ready,
    input  logic [DEN_W-1:0] s_head,
    input  logic [QUO_W-1:0] s_tail,
    input  logic [DEN_W-1:0] s_den,
    output logic             m_valid,
    input  logic             m_ready,
    output logic [QUO_W-1:0] m_quotient
);
  localparam int LOOPS = (QUO_W + STAGES - 1) / STAGES;
  localparam int ROWS = STAGES * LOOPS;  // rows beyond QUO_W make bits that are not looked at
  localparam int LOOP_W = $clog2(LOOPS + 1);

  logic advance, again;  // `again`: the operation in the last stage goes round once more

  for (genvar i = 0; i < STAGES; i++) begin : g_stage
    // What this row works on: the stage before it; for the first, a new operation or the one that comes round.
    logic valid_in;
    logic [LOOP_W-1:0] loop_in;
    logic [DEN_W:0] remainder_in;
    logic [DEN_W-1:0] den_in;
    logic [ROWS-1:0] low_in;
    if (i == 0) begin : g_entry
      assign valid_in = again || s_valid;
      assign loop_in = again ? g_stage[STAGES-1].loop_q + 1'b1 : '0;
      assign remainder_in = again ? g_stage[STAGES-1].remainder_q : {1'b0, s_head};
      assign den_in = again ? g_stage[STAGES-1].den_q : s_den;
      assign low_in = again ? g_stage[STAGES-1].low_q : ROWS'(s_tail) << (ROWS - QUO_W);
    end else begin : g_next
      assign valid_in = g_stage[i-1].valid_q;
      assign loop_in = g_stage[i-1].loop_q;
      assign remainder_in = g_stage[i-1].remainder_q;
      assign den_in = g_stage[i-1].den_q;
      assign low_in = g_stage[i-1].low_q;
    end

    // A negative remainder means that the last subtraction was one too many: add instead. Written as one addition with
    // its carry-in as an extra lowest bit, since not every synthesis tool merges an adder and a subtractor.
    logic subtract, unused_carry;
    logic [DEN_W:0] shifted, operand, remainder;
    assign subtract = !remainder_in[DEN_W];
    assign shifted = {remainder_in[DEN_W-1:0], low_in[ROWS-1]};
    assign operand = {1'b0, den_in} ^ {(DEN_W + 1) {subtract}};
    assign {remainder, unused_carry} = {shifted, subtract} + {operand, subtract};

    // `low` shifts the rest of the numerator out at its top and the quotient in below.
    logic valid_q;
    logic [LOOP_W-1:0] loop_q;
    logic [DEN_W:0] remainder_q;
    logic [DEN_W-1:0] den_q;
    logic [ROWS-1:0] low_q;
    always_ff @(posedge clk) begin
      if (rst) valid_q <= 1'b0;
      else if (advance) valid_q <= valid_in;
      if (advance) begin
        loop_q <= loop_in;
        remainder_q <= remainder;
        den_q <= den_in;
        low_q <= {low_in[ROWS-2:0], !remainder[DEN_W]};
      end
    end
  end

  assign m_valid = g_stage[STAGES-1].valid_q && g_stage[STAGES-1].loop_q == LOOP_W'(LOOPS - 1);
  assign m_quotient = g_stage[STAGES-1].low_q[ROWS-1-:QUO_W];
  assign advance = !m_valid || m_ready;
  assign again = g_stage[STAGES-1].valid_q && !m_valid;
  assign s_ready = advance && !again;
endmodule

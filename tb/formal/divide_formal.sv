// openecho_divide: each operation in is one quotient out, in order, in its rounds and no more; a stalled quotient is
// held; with a ready sink an operation waits for no longer than one that is inside.
//
// VALUES 0: proved by induction, for any number of operations; quotients are left out, as the control never looks at
// one. VALUES 1, in bounded time, narrow: the quotients too, against the operator `/`, as long as head < den, or head =
// den and tail = 0.
//
// Free: operands, gaps, stalls, resets.
module divide_formal #(
    parameter int DEN_W  = 4,
    parameter int QUO_W  = 5,
    parameter int STAGES = 2,
    parameter bit VALUES = 1'b0
) (
    input logic             clk,
    input logic             rst,
    input logic             mark,
    input logic             s_valid,
    input logic [DEN_W-1:0] s_head,
    input logic [QUO_W-1:0] s_tail,
    input logic [DEN_W-1:0] s_den,
    input logic             m_ready
);
  localparam int LOOPS = (QUO_W + STAGES - 1) / STAGES;
  localparam int ROWS = STAGES * LOOPS;

  logic started, s_ready, m_valid;
  logic [QUO_W-1:0] m_quotient, expected;

  openecho_divide #(
      .DEN_W (DEN_W),
      .QUO_W (QUO_W),
      .STAGES(STAGES)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_ready,
      .s_head,
      .s_tail,
      .s_den,
      .m_valid,
      .m_ready,
      .m_quotient
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH(QUO_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload(m_quotient)
  );

  if (VALUES) begin : g_values
    always_comb begin
      expected = '1;
      if (s_head < s_den) expected = QUO_W'({s_head, s_tail} / (DEN_W + QUO_W)'(s_den));
      quotient_fits : assume (s_head < s_den || (s_head == s_den && s_tail == '0 && s_den != '0));
    end
  end else begin : g_control
    assign expected = '0;
  end

  int count, ahead;
  logic marked;
  logic [QUO_W-1:0] content;
  order_formal #(
      .WIDTH(QUO_W),
      .CAPACITY(STAGES)
  ) u_operations (
      .clk,
      .rst,
      .mark,
      .in(s_valid && s_ready),
      .in_payload(expected),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload(VALUES ? m_quotient : QUO_W'(0)),
      .count,
      .marked,
      .ahead,
      .content
  );

  // Rows that each operation has gone through, and the marked one.
  logic [STAGES-1:0] valid;
  logic [STAGES-1:0][7:0] rows;
  int rows_q = 0;
  for (genvar i = 0; i < STAGES; i++) begin : g_stage
    assign valid[i] = dut.g_stage[i].valid_q;
    assign rows[i]  = 8'(dut.g_stage[i].loop_q) * 8'(STAGES) + 8'(i);
  end
  always_ff @(posedge clk) begin
    if (!marked) rows_q <= 0;
    else if (dut.advance) rows_q <= rows_q + 1;
  end

  // With a ready sink an operation gets in at the latest when the one furthest through leaves.
  int working, further, to_go;
  logic in_rounds, found;
  always_comb begin
    working = 0;
    further = 0;
    in_rounds = 1'b1;
    found = 1'b0;
    to_go = ROWS;
    for (int i = 0; i < STAGES; i++) begin
      if (valid[i]) begin
        working = working + 1;
        if (32'(rows[i]) > rows_q) further = further + 1;
        if (32'(rows[i]) == rows_q) found = 1'b1;
        if (32'(rows[i]) >= ROWS) in_rounds = 1'b0;
        if (ROWS - 32'(rows[i]) < to_go) to_go = ROWS - 32'(rows[i]);
      end
    end
  end

  progress_formal #(
      .LIMIT(ROWS)
  ) u_progress (
      .clk,
      .rst,
      .waiting(started && s_valid && !s_ready && m_ready),
      .to_go
  );

  always_comb begin
    if (started) begin
      stages_hold_what_is_inside : assert (working == count);
      all_rounds : assert (!(m_valid && marked && ahead == 0) || rows_q == ROWS - 1);
      no_more_rounds_than_needed : assert (in_rounds);
      marked_is_in_its_place : assert (!marked || (found && further == ahead));
      content_is_left_out : assert (VALUES || content == '0 || !marked);
    end
    cover_two_in_a_row : cover (started && m_valid && m_ready && s_valid && s_ready && marked);
  end
endmodule

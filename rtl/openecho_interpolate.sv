// position = base + |y| / (|y| + |y'|): where the line from y at `base` to y' a bin later, of opposite signs, crosses
// zero (Zhou 2022, Eqs (4) and (5), corrected). One of the two may be zero, not both.
//
// base = s_index, and half a bin more if s_half is set: of the oldest operation that has no position yet, while
// s_base_valid is set. Positions leave in the order of their operations.
//
// Fixed point (EXP_W 0): one openecho_divide, its rows going round twice. Rounded half up to FRAC bits. Latency 1 cycle
// and the rows of the divider, FRAC + 2 cycles for even FRAC; an operation each LOOPS = 2 cycles.
//
// Floating point: sum, quotient and position are each rounded to nearest even. Crossings are sparse, so there is one
// serial divider and one serial adder, which forms the sum for the next division while one is under way: the divider
// sets the pace. `base` is exact where FRAC + 1 bits hold it, else rounded. No infinity or NaN: |y| + |y'| is neither
// zero nor beyond the format (openecho_check), quotients are in [0, 1], and so is what is added to an index.
module openecho_interpolate
  import openecho_pkg::*;
#(
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int VALUE_W = EXP_W > 0 ? float_width(EXP_W, FRAC) : 19,
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int POSITION_W = position_width(EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic                         s_valid,
    output logic                         s_ready,
    input  logic signed [   VALUE_W-1:0] s_y,
    input  logic signed [   VALUE_W-1:0] s_y_next,
    input  logic                         s_base_valid,
    input  logic        [   INDEX_W-1:0] s_index,
    input  logic                         s_half,
    output logic                         m_valid,
    input  logic                         m_ready,
    output logic        [POSITION_W-1:0] m_position
);
  if (EXP_W == 0) begin : g_fixed
    localparam int LOOPS = 2;  // see the throughput of openecho_inflection
    localparam logic [FRAC-1:0] HALF_BIN = {1'b1, {(FRAC - 1) {1'b0}}};

    // By the sign of y alone: -y and y' - y, or y and y - y'. Where y is zero and y' positive, the second form makes a
    // wrong denominator; it is not zero, and the quotient, 0, is right.
    logic minus, operands_valid_q, operands_ready, unused_carry;
    logic [VALUE_W-1:0] num, den, num_q, den_q;
    assign minus = s_y[VALUE_W-1];
    assign num = (s_y ^ {VALUE_W{minus}}) + VALUE_W'(minus);
    assign {den, unused_carry} = {s_y ^ {VALUE_W{minus}}, 1'b1} + {s_y_next ^ {VALUE_W{!minus}}, 1'b1};
    assign s_ready = !operands_valid_q || operands_ready;

    always_ff @(posedge clk) begin
      if (rst) operands_valid_q <= 1'b0;
      else if (s_ready) operands_valid_q <= s_valid;
      if (s_ready) begin
        num_q <= num;
        den_q <= den;
      end
    end

    logic quotient_valid;
    logic [FRAC:0] quotient;  // one bit below FRAC, for rounding
    openecho_divide #(
        .DEN_W (VALUE_W),
        .QUO_W (FRAC + 1),
        .STAGES((FRAC + LOOPS) / LOOPS)
    ) u_divide (
        .clk,
        .rst,
        .s_valid(operands_valid_q),
        .s_ready(operands_ready),
        .s_head(num_q),
        .s_tail({(FRAC + 1) {1'b0}}),
        .s_den(den_q),
        .m_valid(quotient_valid),
        .m_ready(m_ready && s_base_valid),
        .m_quotient(quotient)
    );

    assign m_valid = quotient_valid && s_base_valid;
    assign m_position = {s_index, s_half ? HALF_BIN : FRAC'(0)}
                      + POSITION_W'(quotient[FRAC:1]) + POSITION_W'(quotient[0]);
  end else begin : g_float
    localparam logic [POSITION_W-1:0] NO_SIGN = {1'b0, {(POSITION_W - 1) {1'b1}}};
    logic [POSITION_W-1:0] magnitude, magnitude_next;
    assign magnitude = POSITION_W'(s_y) & NO_SIGN;
    assign magnitude_next = POSITION_W'(s_y_next) & NO_SIGN;

    // ---- base, once for each operation --------------------------------------------------------------------------------
    logic base_sent_q, base_ready, base_valid, position_added;
    logic [POSITION_W-1:0] base;
    logic [4:0] unused_base_flags;
    openecho_float_from_int #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC),
        .INT_W(INDEX_W + 2),
        .SCALE(-1),
        .ITERATIVE(1)
    ) u_base (
        .clk,
        .rst,
        .s_valid (s_base_valid && !base_sent_q),
        .s_ready (base_ready),
        .s_value ({1'b0, s_index, s_half}),
        .m_valid (base_valid),
        .m_ready (position_added),
        .m_result(base),
        .m_flags (unused_base_flags)
    );

    // ---- one addition at a time: |y| + |y'|, or base + quotient as soon as there is a quotient -------------------------
    // The adder is idle, and so ready, whenever it is given something. A sum is begun only while at most one operation
    // is in division: its quotient goes to the divider's output, the divider takes the sum, and the adder is free for
    // the quotient. With two, adder and divider could wait for each other.
    logic adding_q, sum_sent_q, total_is_position_q;
    logic [1:0] dividing_q;  // operations whose division has begun and whose position has not
    logic add_position, add_valid, unused_add_ready, total_valid, total_taken, quotient_valid, divide_ready;
    logic [POSITION_W-1:0] total, quotient;
    logic [4:0] unused_add_flags, unused_divide_flags;

    assign add_position = quotient_valid && base_valid;
    assign add_valid = !adding_q && (add_position || (s_valid && !sum_sent_q && !dividing_q[1]));
    assign position_added = add_position && add_valid;
    assign total_taken = total_valid && (total_is_position_q ? m_ready : divide_ready);

    always_ff @(posedge clk) begin
      if (rst) begin
        base_sent_q <= 1'b0;
        adding_q <= 1'b0;
        sum_sent_q <= 1'b0;
        dividing_q <= '0;
      end else begin
        if (m_valid && m_ready) base_sent_q <= 1'b0;
        else if (s_base_valid && base_ready) base_sent_q <= 1'b1;
        if (total_taken) adding_q <= 1'b0;
        else if (add_valid) adding_q <= 1'b1;
        if (s_ready) sum_sent_q <= 1'b0;
        else if (add_valid && !add_position) sum_sent_q <= 1'b1;
        dividing_q <= dividing_q + 2'(s_ready) - 2'(position_added);
      end
      if (add_valid) total_is_position_q <= add_position;
    end

    openecho_float_add #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC),
        .ITERATIVE(1)
    ) u_add (
        .clk,
        .rst,
        .s_valid(add_valid),
        .s_ready(unused_add_ready),
        .s_a(add_position ? base : magnitude),
        .s_b(add_position ? quotient : magnitude_next),
        .s_subtract(1'b0),
        .m_valid(total_valid),
        .m_ready(total_taken),
        .m_result(total),
        .m_flags(unused_add_flags)
    );

    openecho_float_div #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC),
        .ITERATIVE(1)
    ) u_divide (
        .clk,
        .rst,
        .s_valid(total_valid && !total_is_position_q),
        .s_ready(divide_ready),
        .s_a(magnitude),
        .s_b(total),
        .m_valid(quotient_valid),
        .m_ready(position_added),
        .m_result(quotient),
        .m_flags(unused_divide_flags)
    );

    // Operands stay at the input until the division takes |y| from there.
    assign s_ready = total_valid && !total_is_position_q && divide_ready;
    assign m_valid = total_valid && total_is_position_q;
    assign m_position = total;
  end
endmodule

// position = base + |y| / (|y| + |y'|): where the line from y at `base` to y' a bin later, of opposite signs, crosses zero
// (Zhou 2022, Eqs (4) and (5), corrected). One of the two may be zero, not both. With s_edge set it is base + 1, whatever
// y and y'.
//
// base = s_bin, and half a bin more if TAP_COUNT is even, and half a bin more for a peak (openecho_detect).
//
// Operands stand still while s_valid is set, until s_ready; a position is there for the cycle in which m_valid is set. They
// come in the order of their operations.
//
// Fixed point (EXP_W 0): rounded half up to FRAC bits. One adder: it forms |y'|, twice |y| + |y'|, twice |y|, and then a
// quotient bit a clock, non-restoring: a negative remainder means that the last subtraction was one too many, so the next
// step adds. What it adds or subtracts is in a register, for a short path; of a number to be added it is the complement.
// Where |y'| is zero the quotient is all ones, which is 1 after rounding, and so it is made at the edge. FRAC + 6 cycles,
// for which the operands stay.
//
// Floating point: sum, quotient and position are each rounded to nearest even. One serial divider and one serial adder,
// which forms the sum for the next division while one is under way: the divider sets the pace. `base` is exact where
// FRAC + 1 bits hold it, else rounded. No infinity or NaN: |y| + |y'| is neither zero nor beyond the format
// (openecho_check), quotients are in [0, 1], and so is what is added to a base.
module openecho_interpolate
  import openecho_pkg::*;
#(
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter int VALUE_W = EXP_W > 0 ? float_width(EXP_W, FRAC) : 19,
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int POSITION_W = position_width(EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic                         s_valid,
    input  logic        [           1:0] s_crossing,
    input  logic                         s_edge,
    input  logic        [   INDEX_W-1:0] s_bin,
    input  logic signed [   VALUE_W-1:0] s_y,
    input  logic signed [   VALUE_W-1:0] s_y_next,
    output logic                         s_ready,
    output logic                         m_valid,
    output logic        [POSITION_W-1:0] m_position
);
  localparam bit EVEN = TAP_COUNT % 2 == 0;

  if (EXP_W == 0) begin : g_fixed
    localparam int QUO_W = FRAC + 1;  // one bit below FRAC, for rounding
    localparam int STEP_W = $clog2(QUO_W + 4);
    localparam int ADDER_W = VALUE_W + 2;

    logic [STEP_W-1:0] step_q;
    logic start, next_q, sum_q, value_q, done_q;  // |y'|, 2 (|y| + |y'|), 2 |y| is formed; the quotient is there
    logic rising, peak_q, edge_q;
    logic inverted_q, negative_q, unused_borrow;
    logic [INDEX_W-1:0] bin_q;
    logic [ADDER_W-1:0] divisor_q, operand_q, sum;
    logic [ADDER_W-2:0] remainder_q;  // without its sign, which is negative_q
    logic [  QUO_W-1:0] quotient_q;

    assign start = step_q == '0;
    assign rising = s_crossing == CROSSING_RIGHT;

    assign {sum, unused_borrow} = {remainder_q, 2'b0} - {operand_q ^ {ADDER_W{negative_q}}, inverted_q || negative_q};

    always_ff @(posedge clk) begin
      if (rst || !s_valid || done_q) step_q <= '0;
      else step_q <= step_q + 1'b1;
      {value_q, sum_q, next_q} <= rst ? '0 : {sum_q, next_q, s_valid && start && !done_q};
      done_q <= !rst && step_q == STEP_W'(QUO_W + 3);
      if (start) begin
        peak_q <= s_crossing == CROSSING_PEAK;
        edge_q <= s_edge;
        bin_q  <= s_bin;
      end

      if (start) {inverted_q, operand_q} <= {rising, ADDER_W'(s_y_next) ^ {ADDER_W{rising}}};
      if (next_q) {inverted_q, operand_q} <= {!rising, (ADDER_W'(s_y) <<< 1) ^ {ADDER_W{!rising}}};
      if (value_q) {inverted_q, operand_q} <= {1'b0, divisor_q};

      if (sum_q) divisor_q <= sum;
      remainder_q <= start || sum_q ? '0 : sum[ADDER_W-2:0];
      negative_q  <= !start && sum[ADDER_W-1];
      if (!done_q) quotient_q <= {quotient_q[QUO_W-2:0], edge_q || !sum[ADDER_W-1]};
    end

    logic unused_half;
    assign s_ready = done_q;
    assign m_valid = done_q;
    assign {m_position, unused_half} = {bin_q, peak_q != EVEN, FRAC'(1)} + {INDEX_W'(peak_q && EVEN), quotient_q};
  end else begin : g_float
    localparam logic [POSITION_W-1:0] TWO = POSITION_W'(1) << (POSITION_W - 2);

    // Magnitudes. At the edge: 0 / (0 + 2), a bin later.
    logic [POSITION_W-1:0] y, y_next;
    logic [INDEX_W+1:0] half_bins;
    always_comb begin
      y = s_edge ? '0 : POSITION_W'(s_y);
      y_next = s_edge ? TWO : POSITION_W'(s_y_next);
      {y[POSITION_W-1], y_next[POSITION_W-1]} = '0;
      half_bins = {1'b0, s_bin, EVEN} + (INDEX_W + 2)'(s_crossing == CROSSING_PEAK) + {INDEX_W'(0), s_edge, 1'b0};
    end

    // ---- base, once for each operation, of the oldest that has no position yet ----------------------------------------
    logic add_position, add_valid;
    logic base_waits, unused_bases_ready;
    logic [INDEX_W+1:0] base_half_bins;
    logic [1:0] unused_bases;
    openecho_fifo #(
        .WIDTH(INDEX_W + 2),
        .DEPTH(2)
    ) u_bases (
        .clk,
        .rst,
        .s_valid(add_valid && !add_position),
        .s_ready(unused_bases_ready),
        .s_data (half_bins),
        .m_valid(base_waits),
        .m_ready(m_valid),
        .m_data (base_half_bins),
        .level  (unused_bases)
    );

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
        .s_valid (base_waits && !base_sent_q),
        .s_ready (base_ready),
        .s_value (base_half_bins),
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
    logic unused_add_ready, total_valid, total_taken, quotient_valid, divide_ready;
    logic [POSITION_W-1:0] total, quotient;
    logic [4:0] unused_add_flags, unused_divide_flags;

    assign add_position = quotient_valid && base_valid;
    assign add_valid = !adding_q && (add_position || (s_valid && !sum_sent_q && !dividing_q[1]));
    assign position_added = add_position && add_valid;
    assign total_taken = total_valid && (total_is_position_q || divide_ready);

    always_ff @(posedge clk) begin
      if (rst) begin
        base_sent_q <= 1'b0;
        adding_q <= 1'b0;
        sum_sent_q <= 1'b0;
        dividing_q <= '0;
      end else begin
        if (m_valid) base_sent_q <= 1'b0;
        else if (base_waits && base_ready) base_sent_q <= 1'b1;
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
        .s_a(add_position ? base : y),
        .s_b(add_position ? quotient : y_next),
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
        .s_a(y),
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

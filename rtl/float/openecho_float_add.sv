// m_result = s_a + s_b, or s_a - s_b where s_subtract is set, IEEE 754: rounded to nearest even, subnormals,
// infinities, signed zeros (an exact zero of unlike signs is +0), canonical quiet NaN. Infinity minus infinity and
// signalling NaNs are invalid. Flags and their order: openecho_float_round. An addition never underflows: what is
// subnormal is exact.
//
// ITERATIVE 1: one addition at a time, in less than half the area. Latency 4 cycles and one for each place that a
// summand or the sum is shifted, a new addition each latency - 1: see openecho_float_serial, which does it.
//
// ITERATIVE 0: one result a clock. Latency 6 + ceil(log4(FRAC_W + 5)) cycles (binary64 9, binary16 8). One path for
// near and far operands: the larger magnitude is swapped to the left, so that the difference is never negative; the
// smaller one is aligned, two bits and a sticky bit kept below the last place. Separate paths would shorten the latency
// and cost a second adder and shifter.
module openecho_float_add #(
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter bit ITERATIVE = 0,
    localparam int WORD_W = 1 + EXP_W + FRAC_W
) (
    input  logic              clk,
    input  logic              rst,
    input  logic              s_valid,
    output logic              s_ready,
    input  logic [WORD_W-1:0] s_a,
    input  logic [WORD_W-1:0] s_b,
    input  logic              s_subtract,
    output logic              m_valid,
    input  logic              m_ready,
    output logic [WORD_W-1:0] m_result,
    output logic [       4:0] m_flags
);
  if (ITERATIVE) begin : g_iterative
    openecho_float_serial #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) u_serial (
        .clk,
        .rst,
        .s_valid,
        .s_ready,
        .s_a,
        .s_b,
        .s_subtract,
        .s_divide(1'b0),
        .m_valid,
        .m_ready,
        .m_result,
        .m_flags
    );
  end else begin : g_pipelined
    localparam int SIG_W = FRAC_W + 1;
    localparam int SUM_W = SIG_W + 4;  // a carry above, guard, round and sticky below

    openecho_float_check #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) u_check ();

    logic advance;
    assign advance = !m_valid || m_ready;
    assign s_ready = advance;

    // ---- stage 1: classes; which magnitude is larger ----------------------------------------------------------------
    logic a_sign, a_infinite, a_nan, a_signalling, unused_a_zero;
    logic b_sign, b_infinite, b_nan, b_signalling, unused_b_zero;
    logic [EXP_W-1:0] a_exponent, b_exponent;
    logic [SIG_W-1:0] a_significand, b_significand;

    openecho_float_unpack #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) u_a (
        .word(s_a),
        .sign(a_sign),
        .exponent(a_exponent),
        .significand(a_significand),
        .zero(unused_a_zero),
        .infinite(a_infinite),
        .nan(a_nan),
        .signalling(a_signalling)
    );

    openecho_float_unpack #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) u_b (
        .word(s_b),
        .sign(b_sign),
        .exponent(b_exponent),
        .significand(b_significand),
        .zero(unused_b_zero),
        .infinite(b_infinite),
        .nan(b_nan),
        .signalling(b_signalling)
    );

    logic valid_q, swap_q, sign_q, subtract_q, nan_q, infinite_q, invalid_q;
    logic [EXP_W-1:0] a_exponent_q, b_exponent_q;
    logic [SIG_W-1:0] a_significand_q, b_significand_q;
    logic swap, subtract, clash;

    assign swap = s_a[WORD_W-2:0] < s_b[WORD_W-2:0];
    assign subtract = a_sign ^ b_sign ^ s_subtract;
    assign clash = a_infinite && b_infinite && subtract;

    always_ff @(posedge clk) begin
      if (rst) valid_q <= 1'b0;
      else if (advance) valid_q <= s_valid;
      if (advance) begin
        swap_q <= swap;
        sign_q <= swap ? b_sign ^ s_subtract : a_sign;
        subtract_q <= subtract;
        nan_q <= a_nan || b_nan || clash;
        infinite_q <= a_infinite || b_infinite;
        invalid_q <= a_signalling || b_signalling || clash;
        a_exponent_q <= a_exponent;
        a_significand_q <= a_significand;
        b_exponent_q <= b_exponent;
        b_significand_q <= b_significand;
      end
    end

    // ---- stage 2: larger and smaller, and how far apart -------------------------------------------------------------
    logic valid_q2;
    logic [4:0] kind_q2;  // {subtract, sign, nan, infinite, invalid}
    logic [EXP_W-1:0] larger_exponent, larger_exponent_q2, smaller_exponent, distance_q2;
    logic [SIG_W-1:0] larger_q2, smaller_q2;

    assign larger_exponent  = swap_q ? b_exponent_q : a_exponent_q;
    assign smaller_exponent = swap_q ? a_exponent_q : b_exponent_q;

    always_ff @(posedge clk) begin
      if (rst) valid_q2 <= 1'b0;
      else if (advance) valid_q2 <= valid_q;
      if (advance) begin
        kind_q2 <= {subtract_q, sign_q, nan_q, infinite_q, invalid_q};
        larger_exponent_q2 <= larger_exponent;
        distance_q2 <= larger_exponent - smaller_exponent;
        larger_q2 <= swap_q ? b_significand_q : a_significand_q;
        smaller_q2 <= swap_q ? a_significand_q : b_significand_q;
      end
    end

    // ---- stage 3: the smaller operand under the larger one ----------------------------------------------------------
    logic valid_q3, sticky_q3;
    logic [4:0] kind_q3;
    logic [EXP_W-1:0] exponent_q3;
    logic [SIG_W-1:0] larger_q3;
    logic [SIG_W+1:0] smaller_q3;

    openecho_float_align #(
        .WIDTH(SIG_W + 2),
        .AMOUNT_W(EXP_W),
        .PASS_W(5 + EXP_W + SIG_W)
    ) u_align (
        .clk,
        .rst,
        .advance,
        .s_valid (valid_q2),
        .s_value ({smaller_q2, 2'b00}),
        .s_amount(distance_q2),
        .s_pass  ({kind_q2, larger_exponent_q2, larger_q2}),
        .m_valid (valid_q3),
        .m_value (smaller_q3),
        .m_sticky(sticky_q3),
        .m_pass  ({kind_q3, exponent_q3, larger_q3})
    );

    // ---- stage 4: the sum, one adder with the carry-in as an extra lowest bit ---------------------------------------
    logic valid_q4, subtract_q3, subtract_q4, sign_q4, unused_carry;
    logic [2:0] kind_q4;
    logic [EXP_W-1:0] exponent_q4;
    logic [SUM_W-1:0] sum, sum_q4;

    assign subtract_q3 = kind_q3[4];
    assign {sum, unused_carry} = {1'b0, larger_q3, 3'b000, subtract_q3} +
                                 {{1'b0, smaller_q3, sticky_q3} ^ {SUM_W{subtract_q3}}, subtract_q3};

    always_ff @(posedge clk) begin
      if (rst) valid_q4 <= 1'b0;
      else if (advance) valid_q4 <= valid_q3;
      if (advance) begin
        {subtract_q4, sign_q4, kind_q4} <= kind_q3;
        exponent_q4 <= exponent_q3;
        sum_q4 <= sum;
      end
    end

    // ---- the leading one to the top; the smallest exponent is 1 -----------------------------------------------------
    logic valid_q5;
    logic [3:0] kind_q5;
    logic [EXP_W-1:0] exponent_q5, count_q5;
    logic [SUM_W-1:0] sum_q5;

    openecho_float_normalize #(
        .WIDTH  (SUM_W),
        .LIMIT_W(EXP_W),
        .PASS_W (4 + EXP_W)
    ) u_normalize (
        .clk,
        .rst,
        .advance,
        .s_valid(valid_q4),
        .s_value(sum_q4),
        .s_limit(exponent_q4),
        .s_pass ({sign_q4 && !(subtract_q4 && sum_q4 == '0), kind_q4, exponent_q4}),
        .m_valid(valid_q5),
        .m_value(sum_q5),
        .m_count(count_q5),
        .m_pass ({kind_q5, exponent_q5})
    );

    openecho_float_round #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) u_round (
        .clk,
        .rst,
        .advance,
        .s_valid(valid_q5),
        .s_kind({kind_q5, 1'b0}),
        .s_exponent((EXP_W + 1)'(exponent_q5) + 1'b1 - (EXP_W + 1)'(count_q5)),
        .s_significand({sum_q5[SUM_W-1:2], sum_q5[1] || sum_q5[0]}),
        .m_valid,
        .m_word(m_result),
        .m_flags
    );
  end
endmodule

// m_result = s_a / s_b, IEEE 754: rounded to nearest even, subnormals, infinities, signed zeros, canonical quiet NaN.
// 0/0, infinity/infinity and signalling NaNs are invalid; any other finite number by zero is an infinity with
// divide_by_zero. Flags and their order: openecho_float_round. Both forms below give the same bits.
//
// ITERATIVE 1: a quotient bit a clock, one division at a time. Latency FRAC_W + 6 cycles for normal numbers with a
// quotient of at least 1, a new division each FRAC_W + 5; for others see openecho_float_serial, which does it.
//
// ITERATIVE 0: a row for each quotient bit, one result a clock. Latency 9 + FRAC_W + ceil(log4(FRAC_W + 1)) cycles.
// Non-restoring, as a row then is one adder; the sign of the last remainder is put right at the end.
module openecho_float_div #(
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter bit ITERATIVE = 1,
    localparam int WORD_W = 1 + EXP_W + FRAC_W
) (
    input  logic              clk,
    input  logic              rst,
    input  logic              s_valid,
    output logic              s_ready,
    input  logic [WORD_W-1:0] s_a,
    input  logic [WORD_W-1:0] s_b,
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
        .s_subtract(1'b0),
        .s_divide  (1'b1),
        .m_valid,
        .m_ready,
        .m_result,
        .m_flags
    );
  end else begin : g_pipelined
    localparam int SIG_W = FRAC_W + 1;
    localparam int QUO_W = SIG_W + 3;  // guard and round below the fraction, and one more as the first may be zero
    localparam int BIAS = (1 << (EXP_W - 1)) - 1;
    // From the least subnormal by the greatest number to the reverse, plus the bias.
    localparam int EXPONENT_W = $clog2((3 << (EXP_W - 1)) + FRAC_W) + 1;
    localparam int PASS_W = 5 + EXPONENT_W;

    openecho_float_check #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) u_check ();

    logic advance;
    assign advance = !m_valid || m_ready;
    assign s_ready = advance;

    // ---- normalised operands ----------------------------------------------------------------------------------------
    logic operands_valid, unused_valid;
    logic a_sign, a_zero, a_infinite, a_nan, a_signalling;
    logic b_sign, b_zero, b_infinite, b_nan, b_signalling;
    logic signed [EXPONENT_W-1:0] a_exponent, b_exponent, exponent;
    logic [SIG_W-1:0] a_significand, b_significand;

    openecho_float_operand #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC_W),
        .EXPONENT_W(EXPONENT_W)
    ) u_a (
        .clk,
        .rst,
        .advance,
        .s_valid,
        .s_word(s_a),
        .m_valid(operands_valid),
        .m_sign(a_sign),
        .m_exponent(a_exponent),
        .m_significand(a_significand),
        .m_zero(a_zero),
        .m_infinite(a_infinite),
        .m_nan(a_nan),
        .m_signalling(a_signalling)
    );

    openecho_float_operand #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC_W),
        .EXPONENT_W(EXPONENT_W)
    ) u_b (
        .clk,
        .rst,
        .advance,
        .s_valid,
        .s_word(s_b),
        .m_valid(unused_valid),
        .m_sign(b_sign),
        .m_exponent(b_exponent),
        .m_significand(b_significand),
        .m_zero(b_zero),
        .m_infinite(b_infinite),
        .m_nan(b_nan),
        .m_signalling(b_signalling)
    );

    assign exponent = a_exponent - b_exponent;

    // {sign, nan, infinite, invalid, divide_by_zero} of the quotient.
    logic clash, zero;
    logic [4:0] kind;
    assign clash = (a_infinite && b_infinite) || (a_zero && b_zero);
    assign zero = a_zero || b_infinite;
    assign kind = {
      a_sign ^ b_sign,
      a_nan || b_nan || clash,
      a_infinite || b_zero,
      a_signalling || b_signalling || clash,
      b_zero && !a_zero && !a_infinite && !a_nan
    };

    // ---- rows -------------------------------------------------------------------------------------------------------
    for (genvar i = 0; i < QUO_W; i++) begin : g_row
      logic valid_in, subtract, unused_carry;
      logic [PASS_W-1:0] pass_in;
      logic [ SIG_W-1:0] den_in;
      logic [SIG_W:0] shifted, remainder;
      logic [QUO_W-1:0] quotient_in;
      if (i == 0) begin : g_first
        assign valid_in = operands_valid;
        assign pass_in = {kind, exponent};
        assign den_in = b_significand;
        assign shifted = zero ? '0 : {1'b0, a_significand};
        assign subtract = 1'b1;
        assign quotient_in = '0;
      end else begin : g_next
        assign valid_in = g_row[i-1].valid_q;
        assign pass_in = g_row[i-1].pass_q;
        assign den_in = g_row[i-1].den_q;
        assign shifted = {g_row[i-1].remainder_q[SIG_W-1:0], 1'b0};
        assign subtract = !g_row[i-1].remainder_q[SIG_W];
        assign quotient_in = g_row[i-1].quotient_q;
      end

      // Subtracts, or adds after a remainder that went negative, in one adder: see openecho_divide.
      assign {remainder, unused_carry} = {shifted, subtract} + {{1'b0, den_in} ^ {(SIG_W + 1) {subtract}}, subtract};

      logic valid_q;
      logic [PASS_W-1:0] pass_q;
      logic [SIG_W-1:0] den_q;
      logic [SIG_W:0] remainder_q;
      logic [QUO_W-1:0] quotient_q;
      always_ff @(posedge clk) begin
        if (rst) valid_q <= 1'b0;
        else if (advance) valid_q <= valid_in;
        if (advance) begin
          pass_q <= pass_in;
          den_q <= den_in;
          remainder_q <= remainder;
          quotient_q <= quotient_in << 1 | QUO_W'(!remainder[SIG_W]);
        end
      end
    end

    logic valid_q2;
    logic [4:0] kind_q2;
    logic signed [EXPONENT_W-1:0] exponent_q2, exponent_last;
    logic [SIG_W:0] remainder_last, remainder_q2;
    logic [QUO_W-1:0] quotient_q2;
    assign exponent_last  = g_row[QUO_W-1].pass_q[EXPONENT_W-1:0];
    assign remainder_last = g_row[QUO_W-1].remainder_q;

    always_ff @(posedge clk) begin
      if (rst) valid_q2 <= 1'b0;
      else if (advance) valid_q2 <= g_row[QUO_W-1].valid_q;
      if (advance) begin
        kind_q2 <= g_row[QUO_W-1].pass_q[PASS_W-1-:5];
        exponent_q2 <= exponent_last + EXPONENT_W'(BIAS);
        quotient_q2 <= g_row[QUO_W-1].quotient_q;
        remainder_q2 <= remainder_last + (remainder_last[SIG_W] ? {1'b0, g_row[QUO_W-1].den_q} : '0);
      end
    end

    openecho_float_range #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC_W),
        .EXPONENT_W(EXPONENT_W)
    ) u_range (
        .clk,
        .rst,
        .advance,
        .s_valid(valid_q2),
        .s_kind(kind_q2),
        .s_exponent(exponent_q2),
        .s_significand({quotient_q2, remainder_q2 != '0}),
        .m_valid,
        .m_word(m_result),
        .m_flags
    );
  end
endmodule

// Rounds to nearest, ties to even, and packs: the one place where a float unit makes its word and its flags.
//
// The significand is {leading one, fraction, guard, round, sticky}: two bits below the last place and whether anything
// is left below them. Without its leading one a result is subnormal or zero and must come with the smallest exponent,
// 1, as its scale (`s_exponent` itself is then not looked at). Exponents may go beyond the format: the result is an
// infinity.
//
// s_kind = {sign, nan, infinite, invalid, divide_by_zero}: sign and two flags of the result, and whether it is a NaN,
// always the canonical one (sign 0, exponent all ones, only the top bit of the fraction set), or an exact infinity.
// With either, exponent and significand are not looked at.
//
// m_flags = {invalid, divide_by_zero, overflow, underflow, inexact}, the order of Berkeley SoftFloat. Underflow:
// inexact and tiny, tininess detected after rounding, as if the exponent had no lower end. That needs the round bit:
// just below the smallest normal number the unbounded form has one bit more, and it rounds up if guard and round are
// both set.
//
// Latency 3 cycles of `advance`, one result a clock: decide, increment, pack. The increment runs over exponent and
// fraction as one number, so that a carry out of the fraction makes the next exponent, or the smallest normal number,
// by itself.
module openecho_float_round #(
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter int EXPONENT_W = EXP_W + 1
) (
    input  logic                  clk,
    input  logic                  rst,
    input  logic                  advance,
    input  logic                  s_valid,
    input  logic [           4:0] s_kind,
    input  logic [EXPONENT_W-1:0] s_exponent,
    input  logic [    FRAC_W+3:0] s_significand,
    output logic                  m_valid,
    output logic [EXP_W+FRAC_W:0] m_word,
    output logic [           4:0] m_flags
);
  logic s_sign, s_nan, s_infinite, s_invalid, s_divide_by_zero, s_leading, s_guard, s_round, s_sticky;
  logic [FRAC_W-1:0] s_fraction;
  assign {s_sign, s_nan, s_infinite, s_invalid, s_divide_by_zero} = s_kind;
  assign {s_leading, s_fraction, s_guard, s_round, s_sticky} = s_significand;

  logic valid_q, sign_q, nan_q, infinite_q, invalid_q, divide_by_zero_q, leading_q, round_q, up_q, inexact_q;
  logic [EXPONENT_W-1:0] exponent_q;
  logic [FRAC_W-1:0] fraction_q;

  logic valid_q2, sign_q2, nan_q2, infinite_q2, invalid_q2, divide_by_zero_q2, leading_q2, round_q2, inexact_q2;
  logic [EXPONENT_W-1:0] exponent_q2;
  logic [FRAC_W-1:0] fraction_q2;
  logic overflow, tiny;

  assign overflow = exponent_q2 >= EXPONENT_W'((1 << EXP_W) - 1);
  assign tiny = !leading_q2 && !(exponent_q2[0] && round_q2);

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q  <= 1'b0;
      valid_q2 <= 1'b0;
      m_valid  <= 1'b0;
    end else if (advance) begin
      valid_q  <= s_valid;
      valid_q2 <= valid_q;
      m_valid  <= valid_q2;
    end
    if (advance) begin
      sign_q <= s_sign && !s_nan;
      nan_q <= s_nan;
      infinite_q <= s_infinite;
      invalid_q <= s_invalid;
      divide_by_zero_q <= s_divide_by_zero;
      leading_q <= s_leading;
      round_q <= s_round;
      exponent_q <= s_leading && !s_nan && !s_infinite ? s_exponent : '0;
      fraction_q <= s_fraction;
      up_q <= s_guard && (s_round || s_sticky || s_fraction[0]);
      inexact_q <= (s_guard || s_round || s_sticky) && !s_nan && !s_infinite;

      sign_q2 <= sign_q;
      nan_q2 <= nan_q;
      infinite_q2 <= infinite_q;
      invalid_q2 <= invalid_q;
      divide_by_zero_q2 <= divide_by_zero_q;
      leading_q2 <= leading_q;
      round_q2 <= round_q;
      inexact_q2 <= inexact_q;
      {exponent_q2, fraction_q2} <= {exponent_q, fraction_q} + (EXPONENT_W + FRAC_W)'(up_q);

      m_word <= {sign_q2, exponent_q2[EXP_W-1:0], fraction_q2};
      if (nan_q2 || infinite_q2 || overflow) begin
        m_word[EXP_W+FRAC_W-1:FRAC_W] <= '1;
        m_word[FRAC_W-1:0] <= {nan_q2, {(FRAC_W - 1) {1'b0}}};
      end
      m_flags <= {invalid_q2, divide_by_zero_q2, overflow, tiny && inexact_q2, inexact_q2 || overflow};
    end
  end
endmodule

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
// Latency 2 cycles of `advance`, one result a clock: decide, increment. The increment runs over exponent and fraction
// as one number, so that a carry out of the fraction makes the next exponent, the smallest normal number, or infinity,
// by itself. Infinities and NaNs that are known before it need no multiplexer behind it: the result's flip-flops are
// set and reset instead.
//
// HELD 1: no registers for exponent, fraction and kind in between. The caller holds its inputs for one more cycle of
// `advance` after the one in which s_valid was accepted, s_exponent as 0 if there is no leading one.
module openecho_float_round #(
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter int EXPONENT_W = EXP_W + 1,
    parameter bit HELD = 0
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
  localparam int ALL_ONES = (1 << EXP_W) - 1;

  logic s_sign, s_nan, s_infinite, s_invalid, s_divide_by_zero, s_leading, s_guard, s_round, s_sticky;
  logic [FRAC_W-1:0] s_fraction;
  assign {s_sign, s_nan, s_infinite, s_invalid, s_divide_by_zero} = s_kind;
  assign {s_leading, s_fraction, s_guard, s_round, s_sticky} = s_significand;

  logic special, beyond;
  assign special = s_nan || s_infinite;
  assign beyond  = s_leading && (s_exponent[EXPONENT_W-1:EXP_W] != '0 || s_exponent[EXP_W-1:0] == '1);

  // ---- stage 1: decide ----------------------------------------------------------------------------------------------
  // `finished`: the word is a NaN or an infinity whatever the increment makes of it. `brink`: a carry out of the
  // fraction makes it one.
  logic valid_q, finished_q, overflow_q, brink_q, subnormal_q, inexact_q, up_q;

  always_ff @(posedge clk) begin
    if (rst) valid_q <= 1'b0;
    else if (advance) valid_q <= s_valid;
    if (advance) begin
      finished_q <= special || beyond;
      overflow_q <= !special && beyond;
      brink_q <= !special && s_leading && s_exponent == EXPONENT_W'(ALL_ONES - 1);
      subnormal_q <= !s_leading;
      inexact_q <= !special && (s_guard || s_round || s_sticky);
      up_q <= s_guard && (s_round || s_sticky || s_fraction[0]);
    end
  end

  // What goes into the increment.
  logic sign, nan, invalid, divide_by_zero, round;
  logic [ EXP_W-1:0] exponent;
  logic [FRAC_W-1:0] fraction;

  if (HELD) begin : g_held
    assign {sign, nan, invalid, divide_by_zero} = {s_sign && !s_nan, s_nan, s_invalid, s_divide_by_zero};
    assign {exponent, fraction, round} = {s_exponent[EXP_W-1:0], s_fraction, s_round};
  end else begin : g_registered
    always_ff @(posedge clk) begin
      if (advance) begin
        {sign, nan, invalid, divide_by_zero} <= {s_sign && !s_nan, s_nan, s_invalid, s_divide_by_zero};
        {exponent, fraction, round} <= {s_leading ? s_exponent[EXP_W-1:0] : EXP_W'(0), s_fraction, s_round};
      end
    end
  end

  // ---- stage 2: increment -------------------------------------------------------------------------------------------
  logic carry, overflow, tiny;
  logic [ EXP_W-1:0] rounded_exponent;
  logic [FRAC_W-1:0] rounded_fraction;
  assign {rounded_exponent, rounded_fraction} = {exponent, fraction} + (EXP_W + FRAC_W)'(up_q);

  // On the brink and below the smallest normal number the exponent is even: its last bit tells the carry.
  assign carry = rounded_exponent[0];
  assign overflow = overflow_q || (brink_q && carry);
  assign tiny = subnormal_q && !(carry && round);

  always_ff @(posedge clk) begin
    if (rst) m_valid <= 1'b0;
    else if (advance) m_valid <= valid_q;
    if (advance) begin
      m_word  <= {sign, rounded_exponent, rounded_fraction};
      m_flags <= {invalid, divide_by_zero, overflow, tiny && inexact_q, inexact_q || overflow};
      if (finished_q) m_word[EXP_W+FRAC_W-1:0] <= {{EXP_W{1'b1}}, nan, {(FRAC_W - 1) {1'b0}}};
    end
  end
endmodule

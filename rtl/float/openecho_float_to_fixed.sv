// m_value = s_a * 2^FRAC as a signed integer: fixed point with INT_W bits before the point, its sign among them, and
// FRAC behind it. Rounded to nearest even. What does not fit saturates with the flag invalid: at the largest value for
// large numbers, +infinity and any NaN, at the smallest for large negative numbers and -infinity (RISC-V's convention).
// Flags as in openecho_float_round; inexact only where the result is valid, the other three never.
//
// Latency 4 cycles, one result a clock. The significand only ever moves right, from the top place of the result.
module openecho_float_to_fixed #(
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter int INT_W = 14,
    parameter int FRAC = 16,
    localparam int WORD_W = 1 + EXP_W + FRAC_W,
    localparam int FIXED_W = INT_W + FRAC
) (
    input  logic                      clk,
    input  logic                      rst,
    input  logic                      s_valid,
    output logic                      s_ready,
    input  logic        [ WORD_W-1:0] s_a,
    output logic                      m_valid,
    input  logic                      m_ready,
    output logic signed [FIXED_W-1:0] m_value,
    output logic        [        4:0] m_flags
);
  localparam int SIG_W = FRAC_W + 1;
  localparam int BIAS = (1 << (EXP_W - 1)) - 1;
  localparam int TOP = INT_W - 1 + BIAS;  // exponent of the top place
  localparam int AMOUNT_W = $clog2(TOP + (1 << EXP_W)) + 1;
  localparam int VALUE_W = SIG_W > FIXED_W + 1 ? SIG_W : FIXED_W + 1;
  localparam int BELOW_W = VALUE_W - FIXED_W;  // places below the last one

  // A result may be wider than the largest number, so its range is not checked.
  openecho_float_check #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W),
      .INT_W (INT_W),
      .SCALE (-INT_W),
      .FRAC  (FRAC)
  ) u_check ();

  logic advance;
  assign advance = !m_valid || m_ready;
  assign s_ready = advance;

  // ---- stage 1: how far down ----------------------------------------------------------------------------------------
  logic sign, infinite, nan, unused_zero, unused_signalling;
  logic [EXP_W-1:0] exponent;
  logic [SIG_W-1:0] significand, significand_q;
  logic [AMOUNT_W-1:0] amount, amount_q;
  logic valid_q, sign_q, invalid_q;

  openecho_float_unpack #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_a (
      .word(s_a),
      .sign,
      .exponent,
      .significand,
      .zero(unused_zero),
      .infinite,
      .nan,
      .signalling(unused_signalling)
  );

  assign amount = AMOUNT_W'(TOP) - AMOUNT_W'(exponent);

  always_ff @(posedge clk) begin
    if (rst) valid_q <= 1'b0;
    else if (advance) valid_q <= s_valid;
    if (advance) begin
      sign_q <= sign && !nan;
      invalid_q <= infinite || nan || amount[AMOUNT_W-1];
      amount_q <= amount;
      significand_q <= significand;
    end
  end

  // ---- stage 2: shift -----------------------------------------------------------------------------------------------
  logic valid_q2, sign_q2, invalid_q2, sticky_q2;
  logic [VALUE_W-1:0] value_q2;

  openecho_float_align #(
      .WIDTH(VALUE_W),
      .AMOUNT_W(AMOUNT_W),
      .PASS_W(2)
  ) u_align (
      .clk,
      .rst,
      .advance,
      .s_valid (valid_q),
      .s_value (VALUE_W'(significand_q) << (VALUE_W - SIG_W)),
      .s_amount(amount_q),
      .s_pass  ({sign_q, invalid_q}),
      .m_valid (valid_q2),
      .m_value (value_q2),
      .m_sticky(sticky_q2),
      .m_pass  ({sign_q2, invalid_q2})
  );

  // ---- stage 3: round and give it its sign, in one adder; stage 4: saturate -----------------------------------------
  logic valid_q3, sign_q3, invalid_q3, inexact_q3, up, guard, sticky, invalid;
  logic [FIXED_W-1:0] magnitude;
  logic [  FIXED_W:0] rounded_q3;

  assign magnitude = value_q2[VALUE_W-1-:FIXED_W];
  assign guard = value_q2[BELOW_W-1];
  assign sticky = {value_q2, sticky_q2} << (FIXED_W + 1) != '0;
  assign up = guard && (sticky || magnitude[0]);
  assign invalid = invalid_q3 || rounded_q3[FIXED_W] != rounded_q3[FIXED_W-1];

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q3 <= 1'b0;
      m_valid  <= 1'b0;
    end else if (advance) begin
      valid_q3 <= valid_q2;
      m_valid  <= valid_q3;
    end
    if (advance) begin
      sign_q3 <= sign_q2;
      invalid_q3 <= invalid_q2;
      inexact_q3 <= guard || sticky;
      rounded_q3 <= ({1'b0, magnitude} ^ {(FIXED_W + 1) {sign_q2}}) + (FIXED_W + 1)'(sign_q2 ^ up);

      m_value <= invalid ? {sign_q3, {(FIXED_W - 1) {!sign_q3}}} : rounded_q3[FIXED_W-1:0];
      m_flags <= {invalid, 3'b000, inexact_q3 && !invalid};
    end
  end
endmodule

// Unpacks a word and normalises it: a significand with its leading one and an exponent to match, also for subnormals,
// whose exponents go on below 1. Zeros, infinities and NaNs are told by the class bits alone.
//
// Latency ceil(log4(FRAC_W + 1)) cycles of `advance`, one word a clock; exact.
module openecho_float_operand #(
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter int EXPONENT_W = EXP_W + 1
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic                         advance,
    input  logic                         s_valid,
    input  logic        [EXP_W+FRAC_W:0] s_word,
    output logic                         m_valid,
    output logic                         m_sign,
    output logic signed [EXPONENT_W-1:0] m_exponent,
    output logic        [      FRAC_W:0] m_significand,
    output logic                         m_zero,
    output logic                         m_infinite,
    output logic                         m_nan,
    output logic                         m_signalling
);
  localparam int COUNT_W = $clog2(FRAC_W + 1);

  logic sign, zero, infinite, nan, signalling;
  logic [EXP_W-1:0] exponent, exponent_q;
  logic [FRAC_W:0] significand;
  logic [COUNT_W-1:0] count;

  openecho_float_unpack #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_unpack (
      .word(s_word),
      .sign,
      .exponent,
      .significand,
      .zero,
      .infinite,
      .nan,
      .signalling
  );

  openecho_float_normalize #(
      .WIDTH  (FRAC_W + 1),
      .LIMIT_W(COUNT_W),
      .PASS_W (5 + EXP_W)
  ) u_normalize (
      .clk,
      .rst,
      .advance,
      .s_valid,
      .s_value(significand),
      .s_limit({COUNT_W{1'b1}}),
      .s_pass ({sign, zero, infinite, nan, signalling, exponent}),
      .m_valid,
      .m_value(m_significand),
      .m_count(count),
      .m_pass ({m_sign, m_zero, m_infinite, m_nan, m_signalling, exponent_q})
  );

  assign m_exponent = $signed(EXPONENT_W'(exponent_q)) - $signed(EXPONENT_W'(count));
endmodule

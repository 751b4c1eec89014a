// m_less = s_a < s_b, m_equal = s_a == s_b, m_unordered = one of them is a NaN; none of the three: s_a > s_b. IEEE 754:
// -0 equals +0. A quiet comparison: only a signalling NaN is invalid, the one flag that can be set
// (openecho_float_round).
//
// Latency 1 cycle, one result a clock; exact.
module openecho_float_compare #(
    parameter  int EXP_W  = 11,
    parameter  int FRAC_W = 52,
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
    output logic              m_less,
    output logic              m_equal,
    output logic              m_unordered,
    output logic [       4:0] m_flags
);
  openecho_float_check #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_check ();

  logic a_sign, a_zero, a_nan, a_signalling, unused_a_infinite;
  logic b_sign, b_zero, b_nan, b_signalling, unused_b_infinite;
  logic [EXP_W-1:0] unused_a_exponent, unused_b_exponent;
  logic [FRAC_W:0] unused_a_significand, unused_b_significand;

  openecho_float_unpack #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_a (
      .word(s_a),
      .sign(a_sign),
      .exponent(unused_a_exponent),
      .significand(unused_a_significand),
      .zero(a_zero),
      .infinite(unused_a_infinite),
      .nan(a_nan),
      .signalling(a_signalling)
  );

  openecho_float_unpack #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_b (
      .word(s_b),
      .sign(b_sign),
      .exponent(unused_b_exponent),
      .significand(unused_b_significand),
      .zero(b_zero),
      .infinite(unused_b_infinite),
      .nan(b_nan),
      .signalling(b_signalling)
  );

  // Words are ordered as integers of sign and magnitude.
  logic advance, unordered, equal, smaller;
  assign advance = !m_valid || m_ready;
  assign s_ready = advance;
  assign unordered = a_nan || b_nan;
  assign equal = s_a == s_b || (a_zero && b_zero);
  assign smaller = s_a[WORD_W-2:0] < s_b[WORD_W-2:0];

  always_ff @(posedge clk) begin
    if (rst) m_valid <= 1'b0;
    else if (advance) m_valid <= s_valid;
    if (advance) begin
      m_less <= !unordered && !equal && (a_sign != b_sign ? a_sign : smaller ^ a_sign);
      m_equal <= !unordered && equal;
      m_unordered <= unordered;
      m_flags <= {a_signalling || b_signalling, 4'b0000};
    end
  end
endmodule

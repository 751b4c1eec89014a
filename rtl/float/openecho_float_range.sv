// Ends a multiplication or a division: brings its result into the range of the format, rounds and packs.
//
// s_significand has its leading one in the first or the second place (or is zero) and ends in a sticky bit; s_exponent,
// biased, is that of the first place and may lie on either side of the format's range. A result below the smallest
// exponent is shifted right to where the format puts subnormals before it is rounded, so that it is rounded once.
// s_kind, m_word, m_flags: openecho_float_round.
//
// Latency 4 cycles of `advance`, one result a clock.
module openecho_float_range #(
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter int EXPONENT_W = EXP_W + 2
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic                         advance,
    input  logic                         s_valid,
    input  logic        [           4:0] s_kind,
    input  logic signed [EXPONENT_W-1:0] s_exponent,
    input  logic        [    FRAC_W+4:0] s_significand,
    output logic                         m_valid,
    output logic        [EXP_W+FRAC_W:0] m_word,
    output logic        [           4:0] m_flags
);
  localparam int VALUE_W = FRAC_W + 3;  // leading one, fraction, guard, round; the sticky bit goes beside it

  logic high, valid_q, valid_q2, sticky_q, sticky_q2, shifted_q2;
  logic [4:0] kind_q, kind_q2;
  logic signed [EXPONENT_W-1:0] exponent;
  logic [EXPONENT_W-2:0] exponent_q, exponent_q2, amount_q;
  logic [VALUE_W-1:0] value_q, value_q2;

  assign high = s_significand[FRAC_W+4];
  assign exponent = high ? s_exponent : s_exponent - EXPONENT_W'(1);

  always_ff @(posedge clk) begin
    if (rst) valid_q <= 1'b0;
    else if (advance) valid_q <= s_valid;
    if (advance) begin
      kind_q <= s_kind;
      if (high) {value_q, sticky_q} <= {s_significand[FRAC_W+4:2], s_significand[1] || s_significand[0]};
      else {value_q, sticky_q} <= s_significand[FRAC_W+3:0];
      if (exponent > 0) begin
        exponent_q <= exponent[EXPONENT_W-2:0];
        amount_q   <= '0;
      end else begin
        exponent_q <= (EXPONENT_W - 1)'(1);
        amount_q   <= (EXPONENT_W - 1)'(1 - exponent);
      end
    end
  end

  openecho_float_align #(
      .WIDTH(VALUE_W),
      .AMOUNT_W(EXPONENT_W - 1),
      .PASS_W(6 + EXPONENT_W - 1)
  ) u_align (
      .clk,
      .rst,
      .advance,
      .s_valid (valid_q),
      .s_value (value_q),
      .s_amount(amount_q),
      .s_pass  ({kind_q, sticky_q, exponent_q}),
      .m_valid (valid_q2),
      .m_value (value_q2),
      .m_sticky(shifted_q2),
      .m_pass  ({kind_q2, sticky_q2, exponent_q2})
  );

  openecho_float_round #(
      .EXP_W(EXP_W),
      .FRAC_W(FRAC_W),
      .EXPONENT_W(EXPONENT_W - 1)
  ) u_round (
      .clk,
      .rst,
      .advance,
      .s_valid(valid_q2),
      .s_kind(kind_q2),
      .s_exponent(exponent_q2),
      .s_significand({value_q2, sticky_q2 || shifted_q2}),
      .m_valid,
      .m_word,
      .m_flags
  );
endmodule

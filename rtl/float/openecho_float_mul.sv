// m_result = s_a * s_b, IEEE 754: rounded to nearest even, subnormals, infinities, signed zeros, canonical quiet NaN.
// Infinity times zero and signalling NaNs are invalid. Flags and their order: openecho_float_round.
//
// Latency 5 + ceil(log4(FRAC_W + 1)) + ceil((FRAC_W + 1) / 17) cycles (binary64 12, binary16 8), one result a clock.
//
// Subnormal operands are normalised first, so that the product is in [1, 4) and needs one multiplexer, not a shifter of
// twice the width. The product grows by a row of 17 bits of one operand a stage, which is what the multipliers of FPGAs
// take without a sign; bits that fall below the last row only count as a sticky bit.
module openecho_float_mul #(
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
    output logic [WORD_W-1:0] m_result,
    output logic [       4:0] m_flags
);
  localparam int SIG_W = FRAC_W + 1;
  localparam int ROW_W = 17;
  localparam int ROWS = (SIG_W + ROW_W - 1) / ROW_W;
  localparam int PRODUCT_W = SIG_W + ROW_W;
  localparam int BIAS = (1 << (EXP_W - 1)) - 1;
  // From twice the smallest exponent of a normalised subnormal, 1 - FRAC_W, to twice the largest exponent.
  localparam int EXPONENT_W = $clog2((1 << EXP_W) + FRAC_W) + 2;

  openecho_float_check #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_check ();

  logic advance;
  assign advance = !m_valid || m_ready;
  assign s_ready = advance;

  // ---- normalised operands ------------------------------------------------------------------------------------------
  logic operands_valid, unused_valid;
  logic a_sign, a_zero, a_infinite, a_nan, a_signalling;
  logic b_sign, b_zero, b_infinite, b_nan, b_signalling;
  logic signed [EXPONENT_W-1:0] a_exponent, b_exponent;
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

  logic clash;
  logic [4:0] kind;
  assign clash = (a_infinite && b_zero) || (a_zero && b_infinite);
  assign kind = {
    a_sign ^ b_sign, a_nan || b_nan || clash, a_infinite || b_infinite, a_signalling || b_signalling || clash, 1'b0
  };

  // ---- rows: each multiplies 17 bits and adds the row before to what is above it ------------------------------------
  for (genvar i = 0; i < ROWS; i++) begin : g_row
    logic valid_in, sticky;
    logic [4:0] kind_in;
    logic signed [EXPONENT_W-1:0] exponent_in;
    logic [SIG_W-1:0] a_in, upper;
    logic [(ROWS-i)*ROW_W-1:0] b_in;  // the rows that are left
    if (i == 0) begin : g_first
      assign valid_in = operands_valid;
      assign kind_in = kind;
      assign exponent_in = a_exponent + b_exponent;
      assign a_in = a_significand;
      assign b_in = (ROWS * ROW_W)'(b_significand) << (ROWS * ROW_W - SIG_W);
      assign upper = '0;
      assign sticky = 1'b0;
    end else begin : g_next
      assign valid_in = g_row[i-1].valid_q;
      assign kind_in = g_row[i-1].kind_q;
      assign exponent_in = g_row[i-1].exponent_q;
      assign a_in = g_row[i-1].g_rest.a_q;
      assign b_in = g_row[i-1].g_rest.b_q;
      assign upper = g_row[i-1].total[PRODUCT_W-1:ROW_W];
      assign sticky = g_row[i-1].sticky_q || g_row[i-1].total[ROW_W-1:0] != '0;
    end

    logic valid_q, sticky_q;
    logic [4:0] kind_q;
    logic signed [EXPONENT_W-1:0] exponent_q;
    logic [SIG_W-1:0] upper_q;
    logic [PRODUCT_W-1:0] product_q, total;
    assign total = product_q + PRODUCT_W'(upper_q);
    always_ff @(posedge clk) begin
      if (rst) valid_q <= 1'b0;
      else if (advance) valid_q <= valid_in;
      if (advance) begin
        kind_q <= kind_in;
        exponent_q <= exponent_in;
        product_q <= PRODUCT_W'(a_in) * PRODUCT_W'(b_in[ROW_W-1:0]);
        upper_q <= upper;
        sticky_q <= sticky;
      end
    end
    if (i < ROWS - 1) begin : g_rest
      logic [SIG_W-1:0] a_q;
      logic [(ROWS-i-1)*ROW_W-1:0] b_q;
      always_ff @(posedge clk) begin
        if (advance) begin
          a_q <= a_in;
          b_q <= b_in[(ROWS-i)*ROW_W-1:ROW_W];
        end
      end
    end
  end

  // ---- the sum of the last row, its exponent, rounding --------------------------------------------------------------
  logic valid_q2, sticky_q2;
  logic [4:0] kind_q2;
  logic signed [EXPONENT_W-1:0] exponent_q2;
  logic [PRODUCT_W-1:0] product_q2;

  always_ff @(posedge clk) begin
    if (rst) valid_q2 <= 1'b0;
    else if (advance) valid_q2 <= g_row[ROWS-1].valid_q;
    if (advance) begin
      kind_q2 <= g_row[ROWS-1].kind_q;
      exponent_q2 <= g_row[ROWS-1].exponent_q - EXPONENT_W'(BIAS - 1);
      product_q2 <= g_row[ROWS-1].total;
      sticky_q2 <= g_row[ROWS-1].sticky_q;
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
      .s_significand({product_q2[PRODUCT_W-1-:FRAC_W+4], product_q2[PRODUCT_W-FRAC_W-5:0] != '0 || sticky_q2}),
      .m_valid,
      .m_word(m_result),
      .m_flags
  );
endmodule

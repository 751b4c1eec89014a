// m_result = s_value * 2^SCALE, for a signed integer of INT_W bits, rounded once to nearest even: no format overflows
// on the way to a scaled number that it holds, and integers that the scaled exponent can't hold stop elaboration. Small
// results may be subnormal. Zero is +0. Flags underflow and inexact as in openecho_float_round; the others never.
//
// Latency 4 + ceil(log4(WIDTH)) cycles, one result a clock. WIDTH is INT_W, and more only where the scaled integer
// reaches below the smallest normal number: the missing places are put above it, so that a shift to the left does for
// subnormals too.
module openecho_float_from_int #(
    parameter  int EXP_W  = 11,
    parameter  int FRAC_W = 52,
    parameter  int INT_W  = 19,
    parameter  int SCALE  = -11,
    localparam int WORD_W = 1 + EXP_W + FRAC_W
) (
    input  logic                     clk,
    input  logic                     rst,
    input  logic                     s_valid,
    output logic                     s_ready,
    input  logic signed [ INT_W-1:0] s_value,
    output logic                     m_valid,
    input  logic                     m_ready,
    output logic        [WORD_W-1:0] m_result,
    output logic        [       4:0] m_flags
);
  localparam int BIAS = (1 << (EXP_W - 1)) - 1;
  localparam int TOP = INT_W - 1 + SCALE + BIAS;  // exponent of the magnitude's top bit
  localparam int EXPONENT = TOP < 1 ? 1 : TOP;
  localparam int WIDTH = INT_W + EXPONENT - TOP;

  openecho_float_check #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W),
      .INT_W (INT_W),
      .SCALE (SCALE)
  ) u_check ();

  logic advance;
  assign advance = !m_valid || m_ready;
  assign s_ready = advance;

  logic valid_q, valid_q2, sign, sign_q, sign_q2;
  logic [INT_W-1:0] magnitude_q;
  logic [WIDTH-1:0] value_q2;
  logic [EXP_W-1:0] count_q2;
  logic [WIDTH+FRAC_W+3:0] places;  // of which the top FRAC_W + 3 are kept

  assign sign = s_value[INT_W-1];

  always_ff @(posedge clk) begin
    if (rst) valid_q <= 1'b0;
    else if (advance) valid_q <= s_valid;
    if (advance) begin
      sign_q <= sign;
      magnitude_q <= (s_value ^ {INT_W{sign}}) + INT_W'(sign);
    end
  end

  openecho_float_normalize #(
      .WIDTH  (WIDTH),
      .LIMIT_W(EXP_W),
      .PASS_W (1)
  ) u_normalize (
      .clk,
      .rst,
      .advance,
      .s_valid(valid_q),
      .s_value(WIDTH'(magnitude_q)),
      .s_limit(EXP_W'(EXPONENT - 1)),
      .s_pass (sign_q),
      .m_valid(valid_q2),
      .m_value(value_q2),
      .m_count(count_q2),
      .m_pass (sign_q2)
  );

  assign places = {value_q2, {(FRAC_W + 4) {1'b0}}};

  openecho_float_round #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_round (
      .clk,
      .rst,
      .advance,
      .s_valid(valid_q2),
      .s_kind({sign_q2, 4'b0000}),
      .s_exponent((EXP_W + 1)'(EXPONENT) - (EXP_W + 1)'(count_q2)),
      .s_significand({places[WIDTH+FRAC_W+3-:FRAC_W+3], places[WIDTH:0] != '0}),
      .m_valid,
      .m_word(m_result),
      .m_flags
  );
endmodule

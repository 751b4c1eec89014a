// m_result = s_value * 2^SCALE, for a signed integer of INT_W bits, rounded once to nearest even: no format overflows
// on the way to a scaled number that it holds, and integers that the scaled exponent can't hold stop elaboration. Small
// results may be subnormal. Zero is +0. Flags underflow and inexact as in openecho_float_round; the others never.
//
// ITERATIVE 0: one result a clock, latency 3 + ceil(log4(WIDTH)) cycles. WIDTH is INT_W, and more only where the scaled
// integer reaches below the smallest normal number: the missing places are put above it, so that a shift to the left
// does for subnormals too.
//
// ITERATIVE 1: the magnitude is shifted left a place a clock until its top bit is set, or to the smallest exponent.
// Latency 3 cycles and one for each place, 3 for zero; a new conversion each latency - 1 cycles.
module openecho_float_from_int #(
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter int INT_W = 19,
    parameter int SCALE = -11,
    parameter bit ITERATIVE = 0,
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

  logic sign;
  logic [INT_W-1:0] magnitude;
  assign sign = s_value[INT_W-1];
  assign magnitude = (s_value ^ {INT_W{sign}}) + INT_W'(sign);

  // ---- the magnitude with its leading one at the top, and how far that is from where it came ------------------------
  logic normal_valid, normal_sign;
  logic [WIDTH-1:0] normal;
  logic [  EXP_W:0] exponent;

  if (ITERATIVE) begin : g_iterative
    logic busy_q, held_q, solved;  // held: openecho_float_round still reads the registers
    assign s_ready = !busy_q && (!held_q || advance);
    assign solved = normal[WIDTH-1] || exponent == (EXP_W + 1)'(1) || normal == '0;
    assign normal_valid = busy_q && solved;

    always_ff @(posedge clk) begin
      if (rst) begin
        busy_q <= 1'b0;
        held_q <= 1'b0;
      end else begin
        if (s_ready) busy_q <= s_valid;
        else if (solved && advance) busy_q <= 1'b0;
        if (advance) held_q <= normal_valid;
      end
      if (s_ready) begin
        normal_sign <= sign;
        normal <= WIDTH'(magnitude);
        exponent <= (EXP_W + 1)'(EXPONENT);
      end else if (busy_q && !solved) begin
        normal   <= normal << 1;
        exponent <= exponent - 1'b1;
      end
    end
  end else begin : g_pipelined
    logic valid_q, sign_q;
    logic [INT_W-1:0] magnitude_q;
    logic [EXP_W-1:0] count;
    assign s_ready  = advance;
    assign exponent = (EXP_W + 1)'(EXPONENT) - (EXP_W + 1)'(count);

    always_ff @(posedge clk) begin
      if (rst) valid_q <= 1'b0;
      else if (advance) valid_q <= s_valid;
      if (advance) begin
        sign_q <= sign;
        magnitude_q <= magnitude;
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
        .m_valid(normal_valid),
        .m_value(normal),
        .m_count(count),
        .m_pass (normal_sign)
    );
  end

  logic [WIDTH+FRAC_W+3:0] places;  // of which the top FRAC_W + 3 are kept
  assign places = {normal, {(FRAC_W + 4) {1'b0}}};

  openecho_float_round #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W),
      .HELD  (ITERATIVE)
  ) u_round (
      .clk,
      .rst,
      .advance,
      .s_valid(normal_valid),
      .s_kind({normal_sign, 4'b0000}),
      .s_exponent(normal[WIDTH-1] ? exponent : '0),
      .s_significand({places[WIDTH+FRAC_W+3-:FRAC_W+3], places[WIDTH:0] != '0}),
      .m_valid,
      .m_word(m_result),
      .m_flags
  );
endmodule

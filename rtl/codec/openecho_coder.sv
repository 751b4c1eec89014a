// The code of each sample, as a number without its leading zeros, and its length: Golomb-Rice codes of prediction, flag
// and bits of threshold coding, or the bits of the sample alone where the credit is spent.
//
// Latency 3 cycles of `advance`; one code a clock.
module openecho_coder
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 11
) (
    input  logic                clk,
    input  logic                rst,
    input  logic                advance,
    input  logic                mode,
    input  logic                s_valid,
    input  logic                s_first,
    input  logic                s_last,
    input  logic [SAMPLE_W-1:0] s_sample,
    input  logic [SAMPLE_W-1:0] s_value,
    input  logic [SAMPLE_W-1:0] s_below,
    output logic                m_valid,
    output logic                m_first,
    output logic                m_last,
    output logic [SAMPLE_W-1:0] m_sample,
    output logic [  SAMPLE_W:0] m_code,
    output logic [         5:0] m_length
);
  // ---- quotient, and the bits below it ------------------------------------------------------------------------------
  logic [4:0] k;
  logic [ESCAPE_W-1:0] quotient, quotient_q;
  logic [4:0] k_q;
  logic [SAMPLE_W-1:0] above;
  logic valid_q, first_q, last_q, large_q;
  logic [SAMPLE_W-1:0] sample_q, low_q;

  always_comb begin
    k = '0;
    for (int i = 0; i < SAMPLE_W; i++) if (s_below[i]) k = 5'(i + 1);
  end
  assign above = s_value & ~{s_below[SAMPLE_W-1-ESCAPE_W:0], {ESCAPE_W{1'b1}}};
  assign quotient = ESCAPE_W'(s_value >> k);

  always_ff @(posedge clk) begin
    if (rst) valid_q <= 1'b0;
    else if (advance) valid_q <= s_valid;
    if (advance && s_valid) begin
      first_q <= s_first;
      last_q <= s_last;
      sample_q <= s_sample;
      k_q <= k;
      quotient_q <= quotient;
      large_q <= |above;
      low_q <= (s_value & s_below) | ({SAMPLE_W{mode}} & ~s_below & {s_below[SAMPLE_W-2:0], 1'b1});
    end
  end

  // ---- length -------------------------------------------------------------------------------------------------------
  logic escape, valid_q2, first_q2, last_q2, escape_q2;
  logic [5:0] length, length_q2;
  logic [6:0] gain_q2;
  logic [SAMPLE_W-1:0] sample_q2, low_q2;

  assign escape = large_q || (!mode && quotient_q != 0);
  assign length = escape ? (mode ? 6'(SAMPLE_W + ESCAPE) : 6'(SAMPLE_W + 1)) : 6'(quotient_q) + 6'(k_q) + 6'd1;

  always_ff @(posedge clk) begin
    if (rst) valid_q2 <= 1'b0;
    else if (advance) valid_q2 <= valid_q;
    if (advance && valid_q) begin
      first_q2 <= first_q;
      last_q2 <= last_q;
      sample_q2 <= sample_q;
      low_q2 <= low_q;
      escape_q2 <= escape;
      length_q2 <= length;
      gain_q2 <= 7'(SAMPLE_W) - 7'(length);
    end
  end

  // ---- credit -------------------------------------------------------------------------------------------------------
  logic plain;
  logic [CREDIT_W-1:0] credit_q;

  assign plain = credit_q[CREDIT_W-1:ESCAPE_W] == 0;

  always_ff @(posedge clk) begin
    if (rst) m_valid <= 1'b0;
    else if (advance) m_valid <= valid_q2;
    if (rst || (advance && valid_q2 && last_q2)) credit_q <= CREDIT_W'(START_CREDIT);
    else if (advance && valid_q2 && !plain && !(credit_q[CREDIT_W-1] && !gain_q2[6]))
      credit_q <= credit_q + CREDIT_W'($signed(gain_q2));
    if (advance && valid_q2) begin
      m_first <= first_q2;
      m_last <= last_q2;
      m_sample <= sample_q2;
      m_length <= plain ? 6'(SAMPLE_W) : length_q2;
      m_code[SAMPLE_W-1:0] <= plain || escape_q2 ? sample_q2 : low_q2;
      m_code[SAMPLE_W] <= !mode && escape_q2 && !plain;
    end
  end
endmodule

// What the encoder codes for each sample: the folded error of the better of two predictions, and how many of its low
// bits stand in the code as they are; in threshold mode the distance from the baseline, and the threshold's bits.
//
// Latency 2 cycles of `advance`; one sample a clock. All differences are modulo 2^SAMPLE_W, so nothing overflows. A
// baseline is used every other sample, and so it follows its sample's error one sample later.
module openecho_predictor
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 11
) (
    input  logic                clk,
    input  logic                rst,
    input  logic                advance,
    input  logic                mode,
    input  logic [SAMPLE_W-1:0] threshold,
    input  logic [SAMPLE_W-1:0] baseline_even,
    input  logic [SAMPLE_W-1:0] baseline_odd,
    input  logic                s_valid,
    input  logic                s_last,
    input  logic [SAMPLE_W-1:0] s_sample,
    output logic                m_valid,
    output logic                m_first,
    output logic                m_last,
    output logic [SAMPLE_W-1:0] m_sample,
    output logic [SAMPLE_W-1:0] m_value,
    output logic [SAMPLE_W-1:0] m_below         // bit i is set if more than i low bits stand as they are
);
  localparam int BASELINE_W = SAMPLE_W + BASELINE_FRAC;

  // ---- errors of both predictions, in half counts -------------------------------------------------------------------
  logic take, first_q, valid_q, head_q, last_q;
  logic [SAMPLE_W-1:0] sample_q, previous_q, step, step_q, error_2_q;
  logic [SAMPLE_W:0] missing_q, error_0;  // the error's one's complement, as the carry chain gives it
  logic [BASELINE_W-1:0] here_q, other_q;  // baselines of this sample's index and of the last one's, not yet renewed
  logic [BASELINE_W-1:0] even, odd, followed;

  assign take = advance && s_valid;
  // In threshold mode the baselines stay, and are whole counts.
  assign even = {baseline_even, mode, (BASELINE_FRAC - 1)'(0)};
  assign odd = {baseline_odd, mode, (BASELINE_FRAC - 1)'(0)};
  assign error_0 = ~missing_q;
  assign step = s_sample - previous_q;
  assign followed = {BASELINE_W{mode && error_0[SAMPLE_W]}} + other_q + BASELINE_W'(mode && !error_0[SAMPLE_W]);

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q <= 1'b0;
      first_q <= 1'b1;
    end else if (advance) begin
      valid_q <= s_valid;
      if (s_valid) first_q <= s_last;
    end
    if (take) begin
      head_q <= first_q;
      last_q <= s_last;
      sample_q <= s_sample;
      previous_q <= s_sample;
      step_q <= first_q ? '0 : step;
      missing_q <= here_q[BASELINE_W-1:BASELINE_FRAC-1] + ~{s_sample, 1'b0};
      error_2_q <= step - step_q;
    end
    if (rst || (advance && (s_valid ? s_last : first_q))) here_q <= even;
    else if (take) here_q <= first_q ? odd : followed;
    if (take) other_q <= here_q;
  end

  // ---- the order that errs less, and how much -----------------------------------------------------------------------
  logic use_2, sign_0, sign_2, sign;
  logic [SAMPLE_W-1:0] folded_0, folded_2, spread_0_q, spread_2_q;
  logic [SAMPLE_W:0] renewed_0, renewed_2, spread;
  logic [1:0] unused;

  assign sign_0 = error_0[SAMPLE_W];
  assign sign_2 = error_2_q[SAMPLE_W-1];
  assign folded_0 = error_0[SAMPLE_W-1:0] ^ {SAMPLE_W{sign_0}};
  assign folded_2 = {error_2_q[SAMPLE_W-2:0] ^ {(SAMPLE_W - 1) {sign_2}}, sign_2};
  assign renewed_0 = {1'b0, spread_0_q[SAMPLE_W-1:1], 1'b1} + {1'b0, folded_0};
  assign renewed_2 = {1'b0, spread_2_q[SAMPLE_W-1:1], 1'b1} + {1'b0, folded_2};
  assign unused = {renewed_0[0], renewed_2[0]};
  assign use_2 = mode && spread_2_q < spread_0_q;
  assign sign = mode && (use_2 ? sign_2 : sign_0);
  assign spread = !mode ? {threshold, 1'b1} : use_2 ? {1'b0, spread_2_q} : {1'b0, spread_0_q};

  always_ff @(posedge clk) begin
    if (rst) m_valid <= 1'b0;
    else if (advance) m_valid <= valid_q;
    if (rst || (advance && valid_q && last_q)) begin
      spread_0_q <= SAMPLE_W'(START_SPREAD);
      spread_2_q <= SAMPLE_W'(START_SPREAD);
    end else if (advance && valid_q) begin
      spread_0_q <= renewed_0[SAMPLE_W:1];
      if (!head_q) spread_2_q <= renewed_2[SAMPLE_W:1];
    end
    if (advance && valid_q) begin
      m_first <= head_q;
      m_last <= last_q;
      m_sample <= sample_q;
      m_value  <= (use_2 ? {error_2_q[SAMPLE_W-2:0], 1'b0} : mode ? error_0[SAMPLE_W-1:0] : error_0[SAMPLE_W:1])
                  ^ {SAMPLE_W{sign}};
      for (int i = 0; i < SAMPLE_W; i++) m_below[i] <= |(spread >> (i + 1)) && (i != 0 || spread > 2);
    end
  end
endmodule

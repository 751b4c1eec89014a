// Mean and deviation of the first NOISE_SAMPLES samples of each waveform (Zhou 2022, section 2.1), one result a
// waveform, in order; a shorter waveform yields `none` with zeros.
//
//   S = sum s, Q = sum s^2, D = 50 Q - S^2        exact
//   mean      = S / 50                            rounded half up to AMP_FRAC bits
//   deviation = floor(sqrt(D)) / 50               root with ROOT_FRAC bits; then rounded half up to AMP_FRAC bits
//
// A waveform arrives each 50 cycles at the most (shorter ones have no statistics), so the three steps after the sums,
// D, its root and the divisions, are serial units that each take less than that and work on three waveforms at once.
// `s_ready` falls only where the results are not taken away. Latency from the 50th sample to the result: 4 cycles for
// the sums and COUNT_W + SUM_W, ROOT_W and QUO_W for the steps: 3 SAMPLE_W + 35 cycles, 68 at SAMPLE_W 11.
module openecho_noise
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic                         s_valid,
    output logic                         s_ready,
    input  logic                         s_first,
    input  logic                         s_last,
    input  logic [         SAMPLE_W-1:0] s_sample,
    output logic                         m_valid,
    input  logic                         m_ready,
    output logic [SAMPLE_W+AMP_FRAC-1:0] m_mean,
    output logic [SAMPLE_W+AMP_FRAC-1:0] m_deviation,
    output logic                         m_none
);
  localparam int AMP_W = SAMPLE_W + AMP_FRAC;
  localparam int COUNT_W = $clog2(NOISE_SAMPLES);
  localparam int SUM_W = SAMPLE_W + COUNT_W;
  localparam int SQUARES_W = 2 * SAMPLE_W + COUNT_W;
  localparam int SPREAD_W = SQUARES_W + COUNT_W;  // 50 Q
  localparam int ROOT_W = SAMPLE_W + 5 + ROOT_FRAC;  // D <= (25 * full scale)^2, as the deviation is at most half of it
  localparam int QUO_W = SAMPLE_W + 10;
  localparam int NUM_W = QUO_W + COUNT_W;
  localparam int STEP_W = $clog2(COUNT_W + SUM_W + 1);

  // ---- which waveforms have statistics: one token each, in order ----------------------------------------------------
  logic [COUNT_W-1:0] count_q, count;  // sample number within the waveform, until it is counted
  logic counted_q, counted;  // the 50th sample has been seen
  logic accept, at_limit, complete, token_push, token_ready, token_valid, token_none;
  logic running_q, mean_pending_q;  // the waveform before still needs the sums: for D, and for the mean

  assign accept = s_valid && s_ready;
  assign count = s_first ? '0 : count_q;
  assign counted = !s_first && counted_q;
  assign at_limit = !counted && count == COUNT_W'(NOISE_SAMPLES - 1);
  assign complete = accept && at_limit;
  assign token_push = complete || (accept && s_last && !counted);
  assign s_ready = token_ready && !(at_limit && (running_q || mean_pending_q));

  always_ff @(posedge clk) begin
    if (accept) begin
      count_q   <= count + 1'b1;
      counted_q <= counted || complete;
    end
  end

  logic [4:0] unused_token_level;
  openecho_fifo #(
      .WIDTH(1),
      .DEPTH(16)
  ) u_tokens (
      .clk,
      .rst,
      .s_valid(token_push),
      .s_ready(token_ready),
      .s_data (!complete),
      .m_valid(token_valid),
      .m_ready(m_valid && m_ready),
      .m_data (token_none),
      .level  (unused_token_level)
  );

  // ---- the sums -----------------------------------------------------------------------------------------------------
  logic sample_valid_q, sample_first_q, sample_complete_q;
  logic [SAMPLE_W-1:0] sample_q;
  logic [2*SAMPLE_W-1:0] square_q;
  logic [SUM_W-1:0] sum_q;
  logic [SQUARES_W-1:0] squares_q;
  logic sums_valid_q;

  always_ff @(posedge clk) begin
    sample_valid_q <= accept && !counted && !rst;
    sample_first_q <= s_first;
    sample_complete_q <= complete;
    sample_q <= s_sample;
    square_q <= s_sample * s_sample;
    if (sample_valid_q) begin
      sum_q <= (sample_first_q ? '0 : sum_q) + SUM_W'(sample_q);
      squares_q <= (sample_first_q ? '0 : squares_q) + SQUARES_W'(square_q);
    end
    sums_valid_q <= sample_valid_q && sample_complete_q && !rst;
  end

  // ---- D = 50 Q - S^2, one bit of the multiplier a clock: first those of 50, then those of S ------------------------
  logic spread_valid, root_ready, mean_ready;
  logic subtract_q;
  logic [STEP_W-1:0] step_q;
  logic [SPREAD_W-1:0] multiplicand_q, spread_q;
  logic [SUM_W-1:0] multiplier_q, sum_hold_q;

  assign spread_valid = running_q && step_q == '0;

  always_ff @(posedge clk) begin
    if (rst) begin
      running_q <= 1'b0;
      mean_pending_q <= 1'b0;
    end else begin
      if (sums_valid_q) running_q <= 1'b1;
      else if (spread_valid && root_ready) running_q <= 1'b0;
      if (sums_valid_q) mean_pending_q <= 1'b1;
      else if (mean_ready) mean_pending_q <= 1'b0;
    end
    if (sums_valid_q) begin
      step_q <= STEP_W'(COUNT_W + SUM_W);
      subtract_q <= 1'b0;
      spread_q <= '0;
      multiplicand_q <= SPREAD_W'(squares_q);
      multiplier_q <= SUM_W'(NOISE_SAMPLES);
      sum_hold_q <= sum_q;
    end else if (step_q != '0) begin
      step_q <= step_q - 1'b1;
      if (multiplier_q[0]) begin
        spread_q <= subtract_q ? spread_q - multiplicand_q : spread_q + multiplicand_q;
      end
      multiplicand_q <= multiplicand_q << 1;
      multiplier_q   <= multiplier_q >> 1;
      if (step_q == STEP_W'(SUM_W + 1)) begin
        subtract_q <= 1'b1;
        multiplicand_q <= SPREAD_W'(sum_hold_q);
        multiplier_q <= sum_hold_q;
      end
    end
  end

  // ---- root and divisions -------------------------------------------------------------------------------------------
  logic root_valid, deviation_ready, mean_valid, deviation_valid, result_ready;
  logic [ROOT_W-1:0] root;
  logic [QUO_W-1:0] mean_quotient, deviation_quotient;
  logic [NUM_W-1:0] mean_numerator, deviation_numerator;

  openecho_square_root #(
      .ROOT_W(ROOT_W)
  ) u_root (
      .clk,
      .rst,
      .s_valid(spread_valid),
      .s_ready(root_ready),
      .s_radicand({spread_q[2*(ROOT_W-ROOT_FRAC)-1:0], {(2 * ROOT_FRAC) {1'b0}}}),
      .m_valid(root_valid),
      .m_ready(deviation_ready),
      .m_root(root)
  );

  // One bit below AMP_FRAC, for rounding.
  assign mean_numerator = NUM_W'(sum_hold_q) << (AMP_FRAC + 1);
  assign deviation_numerator = NUM_W'(root) << (AMP_FRAC + 1 - ROOT_FRAC);

  openecho_divide #(
      .DEN_W (COUNT_W),
      .QUO_W (QUO_W),
      .STAGES(1)
  ) u_mean (
      .clk,
      .rst,
      .s_valid(mean_pending_q),
      .s_ready(mean_ready),
      .s_head(mean_numerator[NUM_W-1:QUO_W]),
      .s_tail(mean_numerator[QUO_W-1:0]),
      .s_den(COUNT_W'(NOISE_SAMPLES)),
      .m_valid(mean_valid),
      .m_ready(result_ready),
      .m_quotient(mean_quotient)
  );

  openecho_divide #(
      .DEN_W (COUNT_W),
      .QUO_W (QUO_W),
      .STAGES(1)
  ) u_deviation (
      .clk,
      .rst,
      .s_valid(root_valid),
      .s_ready(deviation_ready),
      .s_head(deviation_numerator[NUM_W-1:QUO_W]),
      .s_tail(deviation_numerator[QUO_W-1:0]),
      .s_den(COUNT_W'(NOISE_SAMPLES)),
      .m_valid(deviation_valid),
      .m_ready(result_ready),
      .m_quotient(deviation_quotient)
  );

  function automatic logic [AMP_W-1:0] round_half_up(input logic [QUO_W-1:0] value);
    round_half_up = AMP_W'(value[QUO_W-1:1]) + AMP_W'(value[0]);
  endfunction

  assign m_valid = token_valid && (token_none || (mean_valid && deviation_valid));
  assign m_none = token_none;
  assign m_mean = token_none ? '0 : round_half_up(mean_quotient);
  assign m_deviation = token_none ? '0 : round_half_up(deviation_quotient);
  assign result_ready = m_valid && m_ready && !token_none;
endmodule

// openecho_reader, with openecho_noise inside: each sample up to the MAX_SAMPLES-th of its waveform comes out exactly
// once, in order, with its index, with `last` at the waveform's end or at the limit and `overlong` if it was cut; the
// rest of a waveform too long is swallowed. So a waveform in is exactly one `last` out. Each waveform has one beat of
// noise figures, which appears after its window has ended and never before.
//
// Proved by induction. What is expected is counted by the harness from the input alone. Assumed: the input keeps the
// stream contract. Free: samples, stalls of either output, gaps, resets. Not here: the values of the noise figures,
// which the bench compares, and how their queue keeps step with them, which is noise_formal's.
module reader_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int MAX_SAMPLES = 64,
    localparam int INDEX_W = $clog2(MAX_SAMPLES)
) (
    input logic                clk,
    input logic                rst,
    input logic                mark,
    input logic                s_valid,
    input logic                s_last,
    input logic [SAMPLE_W-1:0] s_sample,
    input logic                m_ready,
    input logic                noise_ready
);
  localparam int BEAT_W = 2 + SAMPLE_W + INDEX_W;
  localparam int TOKENS = 16;

  logic started, s_ready, m_valid, m_last, m_overlong, noise_valid, noise_none;
  logic [SAMPLE_W-1:0] m_sample;
  logic [ INDEX_W-1:0] m_index;
  logic [SAMPLE_W+AMP_FRAC-1:0] noise_mean, noise_deviation;

  openecho_reader #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_ready,
      .s_last,
      .s_sample,
      .m_valid,
      .m_ready,
      .m_last,
      .m_sample,
      .m_index,
      .m_overlong,
      .noise_valid,
      .noise_ready,
      .noise_mean,
      .noise_deviation,
      .noise_none
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH  (1 + SAMPLE_W),
      .ASSUMED(1'b1)
  ) u_input (
      .clk,
      .rst,
      .valid  (s_valid),
      .ready  (s_ready),
      .payload({s_last, s_sample})
  );

  stream_formal #(
      .WIDTH(BEAT_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_last, m_overlong, m_sample, m_index})
  );

  // What the beat that comes in has to become.
  int position_q = 0;  // samples of the waveform so far; MAX_SAMPLES: cut
  logic accept, forwarded, cut_here;
  assign accept = s_valid && s_ready;
  assign forwarded = accept && position_q < MAX_SAMPLES;
  assign cut_here = position_q == MAX_SAMPLES - 1 && !s_last;

  always_ff @(posedge clk) begin
    if (rst) position_q <= 0;
    else if (accept) position_q <= s_last ? 0 : position_q + 32'(forwarded);
  end

  int count, ahead;
  logic marked;
  logic [BEAT_W-1:0] content;
  order_formal #(
      .WIDTH(BEAT_W),
      .CAPACITY(1)
  ) u_beats (
      .clk,
      .rst,
      .mark,
      .in(forwarded),
      .in_payload({s_last || cut_here, cut_here, s_sample, INDEX_W'(position_q)}),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload({m_last, m_overlong, m_sample, m_index}),
      .count,
      .marked,
      .ahead,
      .content
  );

  // Waveforms whose window has ended and whose figures have not been taken.
  logic window_ends;
  int   figures_q = 0;
  assign window_ends = forwarded && (position_q == NOISE_SAMPLES - 1
                                     || ((s_last || cut_here) && position_q < NOISE_SAMPLES - 1));
  always_ff @(posedge clk) begin
    if (rst) figures_q <= 0;
    else figures_q <= figures_q + 32'(window_ends) - 32'(noise_valid && noise_ready);
  end

  logic was_cut_q = 1'b0;
  always_ff @(posedge clk) was_cut_q <= !rst && (was_cut_q || (m_valid && m_overlong));

  always_comb begin
    if (started) begin
      skips_what_is_cut : assert (dut.skipping_q == (position_q == MAX_SAMPLES));
      index_counts_samples : assert (32'(dut.index_q) == (dut.skipping_q ? 0 : position_q));
      position_in_range : assert (position_q >= 0 && position_q <= MAX_SAMPLES);
      window_is_known : assert (dut.u_noise.in_window_q == (32'(dut.index_q) < NOISE_SAMPLES));
      limit_is_known : assert (dut.u_noise.at_limit_q == (32'(dut.index_q) == NOISE_SAMPLES - 1));
      output_is_what_is_inside : assert (m_valid == (count != 0));
      one_figure_a_waveform : assert (32'(dut.u_noise.u_tokens.level) == figures_q);
      offers_unless_empty : assert (dut.u_noise.u_tokens.m_valid == (figures_q != 0));
      figures_in_range : assert (figures_q >= 0 && figures_q <= TOKENS);
      no_figure_before_its_window : assert (!noise_valid || figures_q > 0);
    end
    cover_back_to_back : cover (started && m_valid && m_ready && m_last && forwarded && position_q == 0);
    cover_cut : cover (started && m_valid && m_last && m_overlong);
    cover_after_a_cut : cover (started && m_valid && m_ready && m_last && !m_overlong && was_cut_q);
    cover_no_figures : cover (started && noise_valid && noise_none);
  end
endmodule

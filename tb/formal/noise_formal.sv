// openecho_noise: one beat of figures for each waveform, in order, `none` exactly for those that end before their
// NOISE_SAMPLES-th sample, and then with zeros; figures are held until they are taken, and a division works for the
// oldest waveform and on sums that no other waveform touches. With a ready sink a sample waits no longer than it takes
// to hand out a full queue and to divide once.
//
// Proved by induction. Assumed: indices count the samples of a waveform from 0, and none is longer than MAX_SAMPLES, as
// openecho_reader has it. Free: samples, gaps, stalls, resets. Not here: that the figures are right, which the bench
// compares. The control never looks at a sum.
module noise_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int MAX_SAMPLES = 64
) (
    input logic                clk,
    input logic                rst,
    input logic                mark,
    input logic                s_valid,
    input logic                s_last,
    input logic [SAMPLE_W-1:0] s_sample,
    input logic                m_ready
);
  localparam int AMP_W = SAMPLE_W + AMP_FRAC;
  localparam int TOKENS = 16;

  logic started, s_ready, m_valid, m_none;
  logic [AMP_W-1:0] m_mean, m_deviation;
  int position_q = 0;

  openecho_noise #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_ready,
      .s_last,
      .s_sample,
      .s_index(($clog2(MAX_SAMPLES))'(position_q)),
      .m_valid,
      .m_ready,
      .m_mean,
      .m_deviation,
      .m_none
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH(1 + 2 * AMP_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_none, m_mean, m_deviation})
  );

  always_ff @(posedge clk) begin
    if (rst) position_q <= 0;
    else if (s_valid && s_ready) position_q <= s_last ? 0 : position_q + 1;
  end

  // A window ends with its NOISE_SAMPLES-th sample, or before it with the waveform.
  logic window_ends, is_short, marked;
  int count, ahead;
  logic content;
  assign is_short = position_q < NOISE_SAMPLES - 1;
  assign window_ends = s_valid && s_ready && (position_q == NOISE_SAMPLES - 1 || (s_last && is_short));
  order_formal #(
      .WIDTH(1),
      .CAPACITY(TOKENS)
  ) u_figures (
      .clk,
      .rst,
      .mark,
      .in(window_ends),
      .in_payload(is_short),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload(m_none),
      .count,
      .marked,
      .ahead,
      .content
  );

  // A token a cycle is taken, until one comes whose sums are still on their way or being divided.
  int to_go;
  always_comb begin
    to_go = count;
    if (dut.running) to_go = count + 32'(dut.step_q);
    else if (dut.held_q) to_go = count + dut.ROOT_W + 1;
    else begin
      for (int i = 0; i < 4; i++) if (dut.complete_q[i]) to_go = count + dut.ROOT_W + 1 + 4 - i;
    end
  end
  progress_formal #(
      .LIMIT(TOKENS + SAMPLE_W + 14)
  ) u_progress (
      .clk,
      .rst,
      .waiting(started && s_valid && !s_ready && m_ready),
      .to_go
  );

  // For the induction: what waits in the queue is what is in work. Waveforms with figures that have not been taken:
  int with_figures;
  logic [$clog2(TOKENS)-1:0] place;
  logic windows_apart;  // the next window ends long after the sums of this one have gone through the pipeline
  always_comb begin
    windows_apart = 1'b1;
    for (int i = 0; i < 4; i++) begin
      if (dut.complete_q[i] && position_q > i && position_q < NOISE_SAMPLES) windows_apart = 1'b0;
    end
    with_figures = 0;
    for (int i = 0; i < TOKENS; i++) begin
      place = $clog2(TOKENS)'(dut.u_tokens.read_q) + $clog2(TOKENS)'(i);
      if (i < 32'(dut.u_tokens.level) && !dut.u_tokens.memory[place]) with_figures = with_figures + 1;
    end
  end

  always_comb begin
    a_waveform_ends_in_time : assume (position_q != MAX_SAMPLES - 1 || s_last);
    if (started) begin
      position_in_range : assert (position_q >= 0 && position_q < MAX_SAMPLES);
      a_token_a_waveform : assert (32'(dut.u_tokens.level) == count);
      marked_is_in_its_place :
      assert (!marked || dut.u_tokens.memory[($clog2(TOKENS))'(32'(dut.u_tokens.read_q)+ahead)] == content);
      sums_of_one_waveform_in_work : assert (!(dut.held_q && dut.complete_q != '0));
      windows_far_apart : assert (windows_apart);
      one_window_in_the_pipeline : assert ((dut.complete_q & (dut.complete_q - 1'b1)) == '0);
      figures_accounted_for : assert (with_figures == $countones(dut.complete_q) + 32'(dut.held_q) + 32'(dut.done));
      divides_what_is_held : assert (!dut.running || dut.held_q);
      divides_for_the_oldest : assert (!dut.busy_q || (dut.token_valid && !dut.token_none));
      steps_in_range : assert (!dut.busy_q || 32'(dut.step_q) <= dut.ROOT_W);
      idle_is_ready_to_start : assert (!dut.token_valid || dut.busy_q || 32'(dut.step_q) == dut.ROOT_W);
      idle_is_zero :
      assert (!dut.token_valid || dut.busy_q
              || {dut.mean_q, dut.mean_rest_q, dut.deviation_q, dut.deviation_rest_q} == '0);
      none_is_zero : assert (!(m_valid && m_none) || {m_mean, m_deviation} == '0);
    end
    cover_figures : cover (started && m_valid && !m_none);
    cover_none_behind_figures : cover (started && m_valid && m_ready && !m_none && with_figures == 1 && count == 2);
    cover_sample_waits : cover (started && s_valid && !s_ready && dut.held_q);
  end
endmodule

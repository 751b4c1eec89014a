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
    parameter int MAX_SAMPLES = 64,
    parameter bit DSP = 1'b1
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
  localparam int PIPELINE = 4 + (DSP ? 2 : SAMPLE_W / 2 + 1);  // cycles from a window's last sample until D is held

  logic started, s_ready, m_valid, m_none;
  logic [AMP_W-1:0] m_mean, m_deviation;
  int position_q = 0;

  openecho_noise #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .DSP(DSP)
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

  logic [PIPELINE-1:0] completing;  // the last sample of a window on its way
  assign completing = {dut.u_spread.last_q, dut.complete_q};

  // A token a cycle is taken, until one comes whose sums are still on their way or being divided.
  int to_go;
  always_comb begin
    to_go = count;
    if (dut.fetch) to_go = count + 32'(dut.step_q) + 3;
    else if (dut.fetched_q[0]) to_go = count + 2;
    else if (dut.fetched_q[1]) to_go = count + 1;
    else if (dut.held_q) to_go = count + dut.ROOT_W + 3;
    else begin
      for (int i = 0; i < PIPELINE; i++) if (completing[i]) to_go = count + dut.ROOT_W + 3 + PIPELINE - i;
    end
  end
  progress_formal #(
      .LIMIT(TOKENS + SAMPLE_W + 12 + PIPELINE)
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
    for (int i = 0; i < PIPELINE; i++) begin
      if (completing[i] && position_q > i && position_q < NOISE_SAMPLES) windows_apart = 1'b0;
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
      window_is_known : assert (dut.in_window_q == (position_q < NOISE_SAMPLES));
      limit_is_known : assert (dut.at_limit_q == (position_q == NOISE_SAMPLES - 1));
      a_token_a_waveform : assert (32'(dut.u_tokens.level) == count && dut.token_valid == (count != 0));
      pointers_agree : assert (dut.u_tokens.write_q == ($clog2(TOKENS))'(32'(dut.u_tokens.read_q) + count));
      marked_is_in_its_place :
      assert (!marked || dut.u_tokens.memory[($clog2(TOKENS))'(32'(dut.u_tokens.read_q)+ahead)] == content);
      sums_of_one_waveform_in_work : assert (!(dut.held_q && completing != '0));
      windows_far_apart : assert (windows_apart);
      one_window_in_the_pipeline : assert ((completing & (completing - 1'b1)) == '0);
      figures_accounted_for :
      assert (with_figures == $countones(completing) + 32'(dut.held_q) + 32'(dut.busy_q && !dut.fetch));
      divides_what_is_held : assert (!dut.fetch || dut.held_q);
      divides_for_the_oldest : assert (!dut.busy_q || (dut.token_valid && !dut.token_none));
      fetched_is_in_work : assert (dut.fetched_q == '0 || dut.busy_q);
      divided_before_the_next_is_held :
      assert (dut.fetch || dut.fetched_q == '0
              || (!dut.held_q && (completing == '0 || (!dut.fetched_q[0] && completing == 1))));
      steps_in_range : assert (!dut.fetch || 32'(dut.step_q) < dut.ROOT_W);
      idle_is_ready_to_start : assert (!dut.token_valid || dut.busy_q || 32'(dut.step_q) == dut.ROOT_W - 1);
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

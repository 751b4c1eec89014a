// openecho_inflection, fixed point, its control: each entry at the head of the queue is either dropped, if it is a
// component below the threshold, or offered once, and then taken from the queue; so each end of a waveform is one
// trailer. The noise figures of a waveform are taken once, behind its trailer, and nothing is judged before the
// threshold has been worked out of them. A component carries the positions that were interpolated for it. A stalled
// component or trailer is held. With a ready sink and noise figures a head is done with in LIMIT cycles.
//
// Proved by induction. The row cuts loose what comes out of openecho_detect, which has its own proof, the verdict,
// which threshold_formal has, and the positions, which interpolate_formal has: the control is right for any of them.
// Assumed: the head stays until it is taken, and so do the noise figures; the verdict stays for its component. Free: all
// else, resets among it.
module inflection_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 8,
    parameter int TAP_COUNT = 4,
    parameter logic [TAPS_W-1:0] TAPS = {{(TAPS_W - 2 * TAP_W) {1'b0}}, 16'd2, 16'd1},
    localparam int AMP_W = SAMPLE_W + AMP_FRAC,
    localparam int LENGTH_W = $clog2(MAX_SAMPLES) + 1,
    localparam int POSITION_W = position_width(0, FRAC, MAX_SAMPLES)
) (
    input logic                clk,
    input logic                rst,
    input logic [SAMPLE_W-1:0] min_amplitude,
    input logic [ RATIO_W-1:0] k,
    input logic                noise_valid,
    input logic [   AMP_W-1:0] noise_mean,
    input logic [   AMP_W-1:0] noise_deviation,
    input logic                noise_none,
    input logic                m_ready
);
  // The module's states.
  localparam logic [4:0] HEAD = 5'b00000, EXCESS = 5'b00001, TEST = 5'b00010, LEFT = 5'b00100,
      PEAK = 5'b00101, RIGHT = 5'b00110, OFFER = 5'b01000, DONE = 5'b10000;
  localparam int OPERATION = FRAC + 6;  // cycles of an interpolation
  localparam int ARMING = RATIO_W + 1;
  localparam int LIMIT = ARMING + 3 + 3 * OPERATION + 1;

  logic [4:0] state;
  logic started, noise_ready, unused_s_ready, m_valid, m_last;
  logic [POSITION_W-1:0] m_left, m_right, m_peak;
  logic [AMP_W-1:0] m_amplitude, m_mean;
  logic [LENGTH_W-1:0] m_length;
  logic [ FLAGS_W-1:0] m_flags;

  openecho_inflection #(
      .SAMPLE_W(SAMPLE_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS)
  ) dut (
      .clk,
      .rst,
      .min_interval('0),
      .min_amplitude,
      .k,
      .noise_valid,
      .noise_ready,
      .noise_mean,
      .noise_deviation,
      .noise_none,
      .s_valid(1'b0),
      .s_ready(unused_s_ready),
      .s_last(1'b0),
      .s_first('0),
      .s_second('0),
      .s_raw('0),
      .s_overlong(1'b0),
      .m_valid,
      .m_ready,
      .m_last,
      .m_left,
      .m_right,
      .m_peak,
      .m_amplitude,
      .m_length,
      .m_mean,
      .m_flags
  );

  assign state = 5'(dut.state_q);

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH  (2 * AMP_W + 1),
      .ASSUMED(1'b1)
  ) u_noise (
      .clk,
      .rst,
      .valid  (noise_valid),
      .ready  (noise_ready),
      .payload({noise_mean, noise_deviation, noise_none})
  );

  stream_formal #(
      .WIDTH  (1 + SAMPLE_W + LENGTH_W + FLAGS_W),
      .ASSUMED(1'b1)
  ) u_head (
      .clk,
      .rst,
      .valid  (dut.head_valid),
      .ready  (dut.head_ready),
      .payload({dut.head_last, dut.head_maximum, dut.m_length, dut.head_flags})
  );

  stream_formal #(
      .WIDTH(1 + 3 * POSITION_W + 2 * AMP_W + LENGTH_W + FLAGS_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_last, m_left, m_right, m_peak, m_amplitude, m_length, m_mean, m_flags})
  );

  // What has become of the head, and whether a trailer has left whose noise figures are still there.
  logic leave, offered_q, judged_q, kept_q, trailer_left_q, component_left_q, dropped_q;
  logic [POSITION_W-1:0] left_q, right_q, peak_q;
  assign leave = m_valid && m_ready;
  always_ff @(posedge clk) begin
    offered_q <= !rst && !dut.head_ready && (offered_q || leave);
    judged_q  <= !rst && !dut.head_ready && (judged_q || state == LEFT);
    if (state == LEFT && !judged_q) kept_q <= dut.kept;
    trailer_left_q <= !rst && !noise_ready && (trailer_left_q || (leave && m_last));
    component_left_q <= !rst && (component_left_q || (leave && !m_last));
    dropped_q <= !rst && dut.head_ready && !offered_q;
    if (dut.position_valid) begin
      if (dut.crossing == CROSSING_LEFT) left_q <= dut.position;
      if (dut.crossing == CROSSING_PEAK) peak_q <= dut.position;
      if (dut.crossing == CROSSING_RIGHT) right_q <= dut.position;
    end
  end

  // Cycles until the head is taken, with a ready sink.
  int step, to_go;
  always_comb begin
    step = 32'(dut.u_interpolate.g_fixed.step_q);
    case (state)
      HEAD: begin
        to_go = 3 + 3 * OPERATION + 1;
        if (!dut.armed)
          to_go = to_go + (dut.u_threshold.started_q ? 32'(3'(dut.u_threshold.bit_q + 1'b1)) + 1 : ARMING);
      end
      EXCESS: to_go = 2 + 3 * OPERATION + 1;
      TEST: to_go = 1 + 3 * OPERATION + 1;
      LEFT: to_go = 3 * OPERATION - step + 1;
      PEAK: to_go = 2 * OPERATION - step + 1;
      RIGHT: to_go = OPERATION - step + 1;
      default: to_go = 1;
    endcase
  end
  progress_formal #(
      .LIMIT(LIMIT)
  ) u_progress (
      .clk,
      .rst,
      .waiting(started && dut.head_valid && noise_valid && m_ready && !dut.head_ready),
      .to_go
  );

  logic at_work, with_peak;
  assign at_work   = state != HEAD && state != DONE;
  assign with_peak = !dut.head_flags[FLAG_NO_PEAK];
  always_comb begin
    verdict_stays : assume (!judged_q || dut.kept == kept_q);
    if (started) begin
      takes_only_what_is_there : assert (!dut.head_ready || dut.head_valid);
      offered_once : assert (!(m_valid && offered_q));
      dropped_or_offered : assert (!dut.head_ready || (dut.head_last ? offered_q : judged_q && offered_q == kept_q));
      offers_the_head :
      assert (!m_valid || (dut.head_valid && m_last == dut.head_last
              && {m_mean, m_flags} == {noise_mean, m_last ? noise_none : dut.head_flags[FLAG_NO_PEAK],
                                       dut.head_flags[FLAG_NO_PEAK-1:0]}));
      noise_behind_its_trailer : assert (!noise_ready || (noise_valid && trailer_left_q));
      noise_taken_before_the_next : assert (!trailer_left_q || (noise_ready && dut.head_ready && dut.head_last));
      judged_by_a_threshold : assert (!at_work || (dut.armed && noise_valid && dut.head_valid));
      positions_of_this_component :
      assert (!m_valid || m_last || ({m_left, m_right} == {left_q, right_q} && (!with_peak || m_peak == peak_q)));
      // For the induction.
      known_state : assert (state inside {HEAD, EXCESS, TEST, LEFT, PEAK, RIGHT, OFFER, DONE});
      components_are_interpolated : assert (!at_work || state == EXCESS || state == OFFER || !dut.head_last);
      last_of_the_head : assert (state == HEAD || m_last == dut.head_last);
      head_until_done : assert (state != DONE || (dut.head_valid && noise_valid && dut.armed));
      not_offered_before : assert (!offered_q || state == DONE);
      judged_at_first :
      assert (state == LEFT ? judged_q || step == 0 : judged_q == (!dut.head_last && state[4:2] != '0));
      kept_is_interpolated : assert (!judged_q || (state == DONE ? offered_q == kept_q : kept_q));
      trailer_left : assert (trailer_left_q == (state == DONE && m_last));
      end_is_offered : assert (!(state == DONE && m_last) || offered_q);
      left_is_kept : assert (m_last || !(state == PEAK || state == RIGHT || state == OFFER) || m_left == left_q);
      peak_is_kept : assert (m_last || !with_peak || !(state == RIGHT || state == OFFER) || m_peak == peak_q);
      operation_in_step :
      assert (step < OPERATION && dut.crossing_taken == (step == OPERATION - 1) && (dut.interpolating || step == 0));
      armed_with_noise : assert (!dut.armed || noise_valid);
      arming_in_step : assert (dut.u_threshold.started_q || 32'(dut.u_threshold.bit_q) == RATIO_W - 1);
    end
    cover_component : cover (started && leave && !m_last && !m_flags[FLAG_NO_PEAK]);
    cover_shoulder : cover (started && leave && !m_last && m_flags[FLAG_NO_PEAK]);
    cover_dropped : cover (started && dropped_q);
    cover_trailer_behind_component : cover (started && leave && m_last && component_left_q);
  end
endmodule

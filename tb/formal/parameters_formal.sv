// openecho_parameters, with openecho_solve inside, fixed point: each component that is kept and each trailer comes out
// once, in order, with its own flags and the amplitude over its own waveform's noise; those that are dropped leave
// nothing. Each waveform takes one beat of noise figures, before its first component and after the trailer before it.
// The divider, the queue of fields beside it and the echo-time adder stay in step. A stalled beat is held.
//
// Proved by induction. Which components are kept is read off the module (the bench compares it), and so are the values
// of positions and widths: the control never looks at one. Free: components, noise figures, settings (even while a
// waveform is inside), gaps, stalls of either side, resets.
module parameters_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 16,
    localparam int AMP_W = SAMPLE_W + AMP_FRAC,
    localparam int LENGTH_W = $clog2(MAX_SAMPLES) + 1,
    localparam int POSITION_W = position_width(0, FRAC, MAX_SAMPLES),
    localparam int VALUE_W = value_width(SAMPLE_W, 0, FRAC, MAX_SAMPLES)
) (
    input logic                  clk,
    input logic                  rst,
    input logic                  mark,
    input logic [   RATIO_W-1:0] n,
    input logic [  SAMPLE_W-1:0] min_amplitude,
    input logic [   RATIO_W-1:0] k,
    input logic                  noise_valid,
    input logic [     AMP_W-1:0] noise_mean,
    input logic [     AMP_W-1:0] noise_deviation,
    input logic                  noise_none,
    input logic                  s_valid,
    input logic                  s_last,
    input logic [POSITION_W-1:0] s_left,
    input logic [POSITION_W-1:0] s_right,
    input logic [POSITION_W-1:0] s_peak,
    input logic [  SAMPLE_W-1:0] s_maximum,
    input logic [  LENGTH_W-1:0] s_length,
    input logic [   FLAGS_W-1:0] s_flags,
    input logic                  m_ready
);
  localparam int BEAT_W = 1 + FLAGS_W + AMP_W;
  localparam int FIELDS = 8;  // depth of the queue beside the divider
  localparam int ARM_STEPS = RATIO_W + 2;

  logic started, noise_ready, s_ready, m_valid, m_last;
  logic [VALUE_W-1:0] m_centre, m_peak, m_width, m_amplitude;
  logic signed [VALUE_W-1:0] m_time;
  logic [FLAGS_W-1:0] m_flags;

  openecho_parameters #(
      .SAMPLE_W(SAMPLE_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) dut (
      .clk,
      .rst,
      .n,
      .min_amplitude,
      .k,
      .noise_valid,
      .noise_ready,
      .noise_mean,
      .noise_deviation,
      .noise_none,
      .s_valid,
      .s_ready,
      .s_last,
      .s_left,
      .s_right,
      .s_peak,
      .s_maximum,
      .s_length,
      .s_flags,
      .m_valid,
      .m_ready,
      .m_last,
      .m_centre,
      .m_peak,
      .m_width,
      .m_time,
      .m_amplitude,
      .m_flags
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH(1 + 5 * VALUE_W + FLAGS_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_last, m_centre, m_peak, m_width, m_time, m_amplitude, m_flags})
  );

  // The noise figures of the waveform that comes in.
  logic accept, takes_noise, has_noise_q, none_q;
  logic [AMP_W-1:0] mean_q, deviation_q;
  assign accept = s_valid && s_ready;
  assign takes_noise = noise_valid && noise_ready;
  always_ff @(posedge clk) begin
    if (rst) has_noise_q <= 1'b0;
    else has_noise_q <= takes_noise || (has_noise_q && !(accept && s_last));
    if (takes_noise) begin
      none_q <= noise_none;
      mean_q <= noise_mean;
      deviation_q <= noise_deviation;
    end
  end

  logic [FLAGS_W-1:0] flags;
  logic [  AMP_W-1:0] amplitude;
  always_comb begin
    flags = s_flags;
    if (s_last) flags[FLAG_NO_NOISE] = none_q;
    amplitude = s_last ? deviation_q : (AMP_W'(s_maximum) << AMP_FRAC) - mean_q;
  end

  int count, ahead;
  logic marked;
  logic [BEAT_W-1:0] content;
  order_formal #(
      .WIDTH(BEAT_W),
      .CAPACITY(FIELDS + 2)
  ) u_beats (
      .clk,
      .rst,
      .mark,
      .in(accept && (dut.kept || s_last)),
      .in_payload({s_last, flags, amplitude}),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload({m_last, m_flags, AMP_W'(m_amplitude)}),
      .count,
      .marked,
      .ahead,
      .content
  );

  progress_formal #(
      .LIMIT(ARM_STEPS)
  ) u_threshold (
      .clk,
      .rst,
      .waiting(started && dut.arming_q),
      .to_go  (32'(dut.arm_step_q) + 1)
  );

  // For the induction: where the marked beat is. The oldest is at the output, others have their fields in the queue,
  // the youngest is in stage A.
  localparam int PEAK_W = POSITION_W > AMP_W ? POSITION_W : AMP_W;
  localparam int FIELDS_W = 1 + FLAGS_W + POSITION_W + PEAK_W + AMP_W;
  localparam int LOOPS = 6;  // rounds of a division
  localparam int DIVIDER_STAGES = (POSITION_W + LOOPS) / LOOPS;
  logic [DIVIDER_STAGES-1:0] dividing_in;
  for (genvar i = 0; i < DIVIDER_STAGES; i++) begin : g_dividing
    assign dividing_in[i] = dut.u_solve.g_fixed.u_width.g_stage[i].valid_q;
  end

  localparam int PLACE_W = $clog2(FIELDS);
  int dividing, place;
  logic [FIELDS_W-1:0] fields;
  logic [  BEAT_W-1:0] found;
  always_comb begin
    dividing = 0;
    for (int i = 0; i < DIVIDER_STAGES; i++) dividing = dividing + 32'(dividing_in[i]);
    place  = ahead - 32'(m_valid);
    fields = dut.u_solve.g_fixed.u_fields.memory[PLACE_W'(32'(dut.u_solve.g_fixed.u_fields.read_q)+place)];
    found  = {fields[FIELDS_W-1-:1+FLAGS_W], fields[AMP_W-1:0]};
    if (place == 32'(dut.u_solve.g_fixed.u_fields.level)) begin
      found = {dut.u_solve.g_fixed.a_last_q, dut.u_solve.g_fixed.a_flags_q, dut.u_solve.g_fixed.a_amplitude_q};
    end
    if (m_valid && ahead == 0) found = {m_last, m_flags, AMP_W'(m_amplitude)};
  end

  logic had_echo_q = 1'b0, had_trailer_q = 1'b0;
  always_ff @(posedge clk) begin
    had_echo_q <= !rst && (had_echo_q || (m_valid && m_ready && !m_last));
    had_trailer_q <= !rst && (had_trailer_q || (m_valid && m_ready && m_last));
  end

  always_comb begin
    if (started) begin
      noise_is_taken_once : assert (noise_ready == !has_noise_q);
      armed_or_arming : assert ((dut.armed_q || dut.arming_q) == has_noise_q && !(dut.armed_q && dut.arming_q));
      arming_ends : assert (!dut.arming_q || 32'(dut.arm_step_q) < ARM_STEPS);
      nothing_is_taken_without_noise : assert (!accept || has_noise_q);
      noise_is_held :
      assert (!has_noise_q || {dut.none_q, dut.mean_q, dut.deviation_q} == {none_q, mean_q, deviation_q});
      fields_of_each_division :
      assert (32'(dut.u_solve.g_fixed.u_fields.level) == dividing + 32'(dut.u_solve.g_fixed.solving_q));
      counted :
      assert (count == 32'(m_valid) + 32'(dut.u_solve.g_fixed.u_fields.level) + 32'(dut.u_solve.g_fixed.a_valid_q));
      fields_do_not_overflow : assert (32'(dut.u_solve.g_fixed.u_fields.level) <= FIELDS);
      fields_are_there_when_taken : assert (!dut.u_solve.g_fixed.write || dut.u_solve.g_fixed.unused_fields_valid);
      steps_end : assert (!dut.u_solve.g_fixed.solving_q || 32'(dut.u_solve.g_fixed.step_q) <= 5);
      marked_is_in_its_place : assert (!marked || found == content);
    end
    cover_dropped : cover (started && accept && !dut.kept && !s_last);
    cover_echo : cover (started && m_valid && m_ready && !m_last);
    cover_trailer_behind_echo : cover (started && m_valid && m_ready && m_last && had_echo_q);
    cover_stalls_input : cover (started && s_valid && dut.armed_q && !s_ready);
    cover_next_waveform : cover (started && accept && s_last && had_trailer_q);
  end
endmodule

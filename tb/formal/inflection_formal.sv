// openecho_inflection, fixed point, in two proofs.
//
// CONTENTS 0, by induction, at full size: the queue of notes never overflows, though nothing looks at its `ready`; what
// waits to be queued is never overwritten; the sign machine knows three states and takes every path between them; a
// stalled component or trailer is held.
//
// CONTENTS 1, in bounded time, with a queue of 8: each run that is kept comes out as one component, each waveform as
// one trailer, in order, a trailer behind the components of its own waveform and before those of the next, with the
// flags, maximum and length that they had when they were queued; the queue of operands does not overflow either; with a
// ready sink the input waits no longer than WAIT cycles, and what is inside comes out after no longer a pause. The
// queue fills in few cycles at that size and empties by the same logic. Reset comes once.
//
// Assumed: indices count the samples of a waveform from 0; none is longer than MAX_SAMPLES; min_interval, which is any
// number, holds still. Free: differences (even those that no waveform has: a second difference need not be that of the
// first), raw samples, gaps, stalls, and resets. Not here: the values of the positions, which the bench compares; the
// divider is in the proof, but which quotient it finds has no say in the control.
module inflection_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 16,
    parameter int TAP_COUNT = 4,
    parameter logic [TAPS_W-1:0] TAPS = {{(TAPS_W - 2 * TAP_W) {1'b0}}, 16'd2, 16'd1},
    parameter bit CONTENTS = 1'b0,
    parameter int QUEUE = 64,  // as in the module
    parameter int WAIT = 12,
    localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, 0, FRAC),
    localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, 0, FRAC),
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int LENGTH_W = INDEX_W + 1,
    localparam int POSITION_W = position_width(0, FRAC, MAX_SAMPLES)
) (
    input logic                       clk,
    input logic                       rst,
    input logic                       mark_component,
    input logic                       mark_trailer,
    input logic                       s_valid,
    input logic                       s_last,
    input logic signed [ FIRST_W-1:0] s_first,
    input logic signed [SECOND_W-1:0] s_second,
    input logic        [SAMPLE_W-1:0] s_raw,
    input logic                       s_overlong,
    input logic                       m_ready
);
  localparam logic [1:0] IDLE = 2'd0;  // the module's states
  localparam logic [1:0] ABOVE = 2'd1;
  localparam logic [1:0] BELOW = 2'd2;
  localparam int NUMBER_BITS = 6;  // of waveforms: more than can be inside

  logic started, s_ready, m_valid, m_last;
  logic [INDEX_W-1:0] position_q, min_interval_q;
  logic [POSITION_W-1:0] m_left, m_right, m_peak;
  logic [SAMPLE_W-1:0] m_maximum;
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
      .min_interval(min_interval_q),
      .s_valid,
      .s_ready,
      .s_last,
      .s_first,
      .s_second,
      .s_raw,
      .s_index(position_q),
      .s_overlong,
      .m_valid,
      .m_ready,
      .m_last,
      .m_left,
      .m_right,
      .m_peak,
      .m_maximum,
      .m_length,
      .m_flags
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  logic accept, leave, ends;
  assign accept = s_valid && s_ready;
  assign leave  = m_valid && m_ready;
  assign ends   = accept && s_last;

  logic [NUMBER_BITS-1:0] waveform_in_q, waveform_out_q;
  always_ff @(posedge clk) begin
    min_interval_q <= min_interval_q;  // any number, and always the same
    if (rst) begin
      position_q <= '0;
      waveform_in_q <= '0;
      waveform_out_q <= '0;
    end else begin
      if (accept) position_q <= s_last ? '0 : position_q + 1'b1;
      waveform_in_q  <= waveform_in_q + NUMBER_BITS'(ends);
      waveform_out_q <= waveform_out_q + NUMBER_BITS'(leave && m_last);
    end
  end

  always_comb begin
    a_waveform_ends_in_time : assume (32'(position_q) != MAX_SAMPLES - 1 || s_last);
    if (started) begin
      legal_state : assert (2'(dut.state_q) == IDLE || 2'(dut.state_q) == ABOVE || 2'(dut.state_q) == BELOW);
      queue_is_that_of_the_module : assert (dut.QUEUE == QUEUE);
      notes_do_not_overflow : assert (!dut.note_push || dut.unused_note_ready);
      no_run_kept_while_another_waits : assert (!(accept && dut.kept && dut.waits));
      peak_waits_before_the_next_run : assert (!dut.peak_waits_q || 2'(dut.state_q) != BELOW);
      right_waits_while_the_next_run_is_short :
      assert (!dut.right_waits_q || 2'(dut.state_q) != BELOW || dut.run_q <= INDEX_W'(1));
      end_waits_while_the_next_waveform_is_short :
      assert (!dut.finish_waits_q || 32'(position_q) + 32'(dut.right_waits_q) + 32'(dut.peak_waits_q) <= 2);
      no_end_while_another_waits : assert (!(ends && dut.finish_waits_q));
      idle_until_a_full_window : assert (32'(position_q) > TAP_COUNT + 1 || 2'(dut.state_q) == IDLE);
      waiting_fits :
      assert (32'(dut.note_level) + 32'(dut.peak_waits_q) + 32'(dut.right_waits_q) + 32'(dut.finish_waits_q) < QUEUE);
    end
    cover_idle_to_above : cover (started && accept && 2'(dut.state_q) == IDLE && 2'(dut.state_d) == ABOVE);
    cover_idle_to_below : cover (started && accept && 2'(dut.state_q) == IDLE && 2'(dut.state_d) == BELOW);
    cover_above_to_below : cover (started && accept && 2'(dut.state_q) == ABOVE && 2'(dut.state_d) == BELOW);
    cover_below_to_above : cover (started && accept && 2'(dut.state_q) == BELOW && 2'(dut.state_d) == ABOVE);
    cover_cut : cover (started && accept && dut.kept && dut.run_cut);
  end

  if (!CONTENTS) begin : g_induced
    stream_formal #(
        .WIDTH(1 + 3 * POSITION_W + SAMPLE_W + LENGTH_W + FLAGS_W)
    ) u_output (
        .clk,
        .rst,
        .valid  (started && m_valid),
        .ready  (m_ready),
        .payload({m_last, m_left, m_right, m_peak, m_maximum, m_length, m_flags})
    );
  end else begin : g_bounded
    localparam int COMPONENT_W = NUMBER_BITS + SAMPLE_W + FLAGS_W;
    localparam int TRAILER_W = LENGTH_W + 1;

    int components, trailers, unused_components_ahead, unused_trailers_ahead;
    logic unused_component_marked, unused_trailer_marked;
    logic [COMPONENT_W-1:0] unused_component;
    logic [  TRAILER_W-1:0] unused_trailer;

    order_formal #(
        .WIDTH(COMPONENT_W),
        .CAPACITY(QUEUE / 2 + 1)
    ) u_components (
        .clk,
        .rst,
        .mark(mark_component),
        .in(accept && dut.kept),
        .in_payload({waveform_in_q, dut.maximum, dut.push_flags}),
        .out_valid(started && m_valid && !m_last),
        .out(leave && !m_last),
        .out_payload({waveform_out_q, m_maximum, m_flags}),
        .count(components),
        .marked(unused_component_marked),
        .ahead(unused_components_ahead),
        .content(unused_component)
    );

    order_formal #(
        .WIDTH(TRAILER_W),
        .CAPACITY(QUEUE + 1)
    ) u_trailers (
        .clk,
        .rst,
        .mark(mark_trailer),
        .in(ends),
        .in_payload({LENGTH_W'(position_q) + 1'b1, s_overlong}),
        .out_valid(started && m_valid && m_last),
        .out(leave && m_last),
        .out_payload({m_length, m_flags[FLAG_TOO_LONG]}),
        .count(trailers),
        .marked(unused_trailer_marked),
        .ahead(unused_trailers_ahead),
        .content(unused_trailer)
    );

    progress_formal #(
        .LIMIT(WAIT)
    ) u_progress (
        .clk,
        .rst,
        .waiting(started && s_valid && !s_ready && m_ready),
        .to_go  (0)
    );

    logic had_component_q = 1'b0;
    always_ff @(posedge clk) had_component_q <= !rst && (had_component_q || (leave && !m_last));

    progress_formal #(
        .LIMIT(WAIT)
    ) u_leaving (
        .clk,
        .rst,
        .waiting(started && (components != 0 || trailers != 0) && !m_valid),
        .to_go  (0)
    );

    always_comb begin
      no_reset_again : assume (!started || !rst);
      if (started) begin
        operands_do_not_overflow : assert (!dut.operand_push || dut.unused_operand_ready);
        components_of_a_waveform_leave_before_its_end :
        assert (!(m_valid && m_last) || components == 0 || waveform_in_q != waveform_out_q);
      end
      cover_queue_stalls : cover (started && s_valid && !s_ready && !dut.queue_ready);
      cover_component : cover (started && leave && !m_last && !m_flags[FLAG_NO_PEAK] && !m_flags[FLAG_TRUNCATED]);
      cover_trailer_behind_component : cover (started && leave && m_last && had_component_q);
      cover_two_trailers : cover (started && leave && m_last && waveform_out_q == 1);
    end
  end
endmodule

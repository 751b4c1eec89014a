// openecho_detect, fixed point: the queue of entries never overflows and the slot that is written never waits to be
// read, whatever the consumer does, with a source that goes on for up to IN_FLIGHT cycles after `room` has fallen; no
// two entries are queued in the same cycle; an empty queue has room. Each run that is to be kept comes out as one
// component, each waveform as one end, in order, an end behind the components of its own waveform and before those of
// the next, with maximum, length and flags, and with its three crossings. No deadlock with the noise: as long as a
// waveform has had fewer than NOISE_SAMPLES beats and nothing of an earlier one waits, there is room for the next.
//
// Proved by induction, values included; CONTENTS 0 leaves out what comes out and when. What is expected is worked out
// here from the beats, by the rules of the header.
//
// Assumed: a waveform has no more than MAX_SAMPLES beats; min_interval, which is any number, holds still; a second
// difference is that of the firsts. Free: beats, gaps, stalls, resets, and which crossing is asked for.
module detect_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 3,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 16,
    parameter int TAP_COUNT = 4,
    parameter logic [TAPS_W-1:0] TAPS = {{(TAPS_W - 2 * TAP_W) {1'b0}}, 16'd2, 16'd1},
    parameter int IN_FLIGHT = 0,
    parameter bit CONTENTS = 1'b1,
    parameter int SLOTS = 8,  // as in the module
    parameter int ENTRIES = 16,
    localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, 0, FRAC),
    localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, 0, FRAC),
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int LENGTH_W = INDEX_W + 1
) (
    input logic                       clk,
    input logic                       rst,
    input logic                       mark_component,
    input logic                       mark_end,
    input logic                       s_valid,
    input logic                       s_last,
    input logic signed [ FIRST_W-1:0] s_first,
    input logic signed [SECOND_W-1:0] s_second,
    input logic        [SAMPLE_W-1:0] s_raw,
    input logic                       s_overlong,
    input logic                       m_ready,
    input logic        [         1:0] crossing
);
  localparam logic [1:0] IDLE = 2'd0;  // the module's states
  localparam logic [1:0] ABOVE = 2'd1;
  localparam logic [1:0] BELOW = 2'd2;
  localparam int DELAY = (TAP_COUNT + 4) / 2;
  localparam int NUMBER_W = 6;  // of waveforms: more than can be inside

  logic started, room, m_valid, m_last, m_edge;
  logic [SAMPLE_W-1:0] m_maximum;
  logic [LENGTH_W-1:0] m_length;
  logic [ FLAGS_W-1:0] m_flags;
  logic [INDEX_W-1:0] m_bin, min_interval_q;
  logic signed [SECOND_W-1:0] m_y, m_y_next;

  openecho_detect #(
      .SAMPLE_W(SAMPLE_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS),
      .IN_FLIGHT(IN_FLIGHT)
  ) dut (
      .clk,
      .rst,
      .min_interval(min_interval_q),
      .room,
      .s_valid,
      .s_last,
      .s_first,
      .s_second,
      .s_raw,
      .s_overlong,
      .m_valid,
      .m_ready,
      .m_last,
      .m_maximum,
      .m_length,
      .m_flags,
      .crossing,
      .m_edge,
      .m_bin,
      .m_y,
      .m_y_next
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  // ---- the beat, as the module sees it, and the one before ---------------------------------------------------------
  logic valid_q, last_q, overlong_q;
  logic [INDEX_W-1:0] next_q, position_q;  // index of the next beat, and of this one
  logic [SAMPLE_W-1:0] raw_q;
  logic signed [FIRST_W-1:0] first_q, first_before_q;
  logic signed [SECOND_W-1:0] second_q, second_before_q;
  logic [7:0] low_q;  // cycles in which there has been no room, without this one

  always_ff @(posedge clk) begin
    min_interval_q <= min_interval_q;
    valid_q <= s_valid && !rst;
    if (rst) next_q <= '0;
    else if (s_valid) next_q <= s_last ? '0 : next_q + 1'b1;
    if (s_valid) begin
      {last_q, overlong_q, raw_q, position_q} <= {s_last, s_overlong, s_raw, next_q};
      {first_before_q, second_before_q} <= {first_q, second_q};
      {first_q, second_q} <= {s_first, s_second};
    end
    if (rst) low_q <= 8'(IN_FLIGHT);
    else if (room) low_q <= '0;
    else if (32'(low_q) < IN_FLIGHT) low_q <= low_q + 1'b1;
  end

  int components, finishes, components_ahead, ends_ahead;
  logic component_marked, end_marked;
  logic signed [SECOND_W:0] difference;
  assign difference = (SECOND_W + 1)'(s_first) - (next_q == '0 ? (SECOND_W + 1)'(0) : (SECOND_W + 1)'(first_q));
  always_comb begin
    a_source_stops : assume (!s_valid || room || 32'(low_q) < IN_FLIGHT);
    a_waveform_ends_in_time : assume (32'(next_q) != MAX_SAMPLES - 1 || s_last);
    control_only : assume (CONTENTS || !(mark_component || mark_end || component_marked || end_marked));
    seconds_are_of_firsts : assume (!s_valid || difference == (SECOND_W + 1)'(s_second));
  end

  // ---- what the runs are to be -------------------------------------------------------------------------------------
  logic positive, starts, over, cut, kept, falls, in_run_q, truncated, truncated_q, has_peak, has_peak_q;
  logic [INDEX_W-1:0] run, run_q, bin, peak_bin, peak_bin_q, left_bin_q;  // beats of the run
  logic [SAMPLE_W-1:0] maximum, maximum_q;
  logic signed [SECOND_W-1:0] left_y_q, left_y_next_q;
  logic signed [FIRST_W-1:0] peak_y, peak_y_q, peak_y_next, peak_y_next_q;
  always_comb begin
    positive = second_q > 0;
    bin = position_q - INDEX_W'(DELAY);
    starts = !in_run_q && !positive && 32'(position_q) > TAP_COUNT;
    over = in_run_q && positive;
    cut = in_run_q && !positive && last_q;
    run = starts ? INDEX_W'(1) : run_q + INDEX_W'(!positive);
    truncated = starts ? 32'(position_q) == TAP_COUNT + 1 : truncated_q;
    kept = valid_q && (over || (cut && !truncated)) && run > 1 && run > min_interval_q;
    maximum = maximum_q;
    if (starts || (raw_q > maximum_q && (TAP_COUNT % 2 == 0 || !positive))) maximum = raw_q;
    falls = first_before_q > 0 && first_q <= 0 && !positive;
    has_peak = falls || (has_peak_q && !starts);
    {peak_bin, peak_y, peak_y_next} = {peak_bin_q, peak_y_q, peak_y_next_q};
    if (falls) {peak_bin, peak_y, peak_y_next} = {bin, first_before_q, first_q};
  end
  always_ff @(posedge clk) begin
    if (rst) in_run_q <= 1'b0;
    else if (valid_q) in_run_q <= (starts || (in_run_q && !positive)) && !last_q;
    if (valid_q) begin
      {run_q, truncated_q, maximum_q, has_peak_q} <= {run, truncated, maximum, has_peak};
      {peak_bin_q, peak_y_q, peak_y_next_q} <= {peak_bin, peak_y, peak_y_next};
      if (starts) {left_bin_q, left_y_q, left_y_next_q} <= {bin, second_before_q, second_q};
    end
  end

  // ---- components, and ends of waveforms ---------------------------------------------------------------------------
  logic [NUMBER_W-1:0] waveform_in_q, waveform_out_q;
  logic ends, leave;
  assign ends  = valid_q && last_q;
  assign leave = m_valid && m_ready;
  always_ff @(posedge clk) begin
    if (rst) begin
      waveform_in_q  <= '0;
      waveform_out_q <= '0;
    end else begin
      waveform_in_q  <= waveform_in_q + NUMBER_W'(ends);
      waveform_out_q <= waveform_out_q + NUMBER_W'(leave && m_last);
    end
  end

  localparam int ZERO_W = 1 + INDEX_W + 2 * SECOND_W;  // edge, bin, y, y_next
  localparam int COMPONENT_W = NUMBER_W + SAMPLE_W + FLAGS_W + 3 * ZERO_W;
  localparam int END_W = LENGTH_W + FLAGS_W;
  typedef struct packed {
    logic [NUMBER_W-1:0] waveform;
    logic [SAMPLE_W-1:0] maximum;
    logic [FLAGS_W-1:0] flags;
    logic [ZERO_W-1:0] left, peak, right;
  } component_t;
  typedef struct packed {
    logic [LENGTH_W-1:0] length;
    logic [FLAGS_W-1:0]  flags;
  } end_t;
  component_t component_in, component_out, component;
  end_t end_in, end_out, end_of;
  logic [ZERO_W-1:0] zero_out;

  always_comb begin
    component_in.waveform = waveform_in_q;
    component_in.maximum = maximum;
    component_in.flags = '0;
    component_in.flags[FLAG_SATURATED] = &maximum;
    component_in.flags[FLAG_TRUNCATED] = truncated || cut;
    component_in.flags[FLAG_NO_PEAK] = !has_peak;
    // The differences beyond an edge, and the peak of a shoulder, are nobody's.
    component_in.left = {truncated, left_bin_q, truncated ? (2 * SECOND_W)'(0) : {left_y_q, left_y_next_q}};
    component_in.right = cut ? {1'b1, bin, (2 * SECOND_W)'(0)} : {1'b0, bin, second_before_q, second_q};
    component_in.peak = has_peak ? {1'b0, peak_bin, SECOND_W'(peak_y), SECOND_W'(peak_y_next)} : '0;
    end_in.length = LENGTH_W'(position_q) + 1'b1;
    end_in.flags = '0;
    end_in.flags[FLAG_TOO_SHORT] = 32'(position_q) < TAP_COUNT + 1;
    end_in.flags[FLAG_TOO_LONG] = overlong_q;

    zero_out = {m_edge, m_bin, m_edge ? (2 * SECOND_W)'(0) : {m_y, m_y_next}};
    if (crossing == CROSSING_PEAK && m_flags[FLAG_NO_PEAK]) zero_out = '0;
    component_out = component;
    component_out.waveform = waveform_out_q;
    component_out.maximum = m_maximum;
    component_out.flags = m_flags;
    if (crossing == CROSSING_LEFT) component_out.left = zero_out;
    if (crossing == CROSSING_PEAK) component_out.peak = zero_out;
    if (crossing == CROSSING_RIGHT) component_out.right = zero_out;
    end_out = {m_length, m_flags};
  end

  order_formal #(
      .WIDTH(COMPONENT_W),
      .CAPACITY(SLOTS - 1)
  ) u_components (
      .clk,
      .rst,
      .mark(mark_component),
      .in(kept),
      .in_payload(component_in),
      .out_valid(started && m_valid && !m_last),
      .out(leave && !m_last),
      .out_payload(component_out),
      .count(components),
      .marked(component_marked),
      .ahead(components_ahead),
      .content(component)
  );
  order_formal #(
      .WIDTH(END_W),
      .CAPACITY(ENTRIES + 2)
  ) u_ends (
      .clk,
      .rst,
      .mark(mark_end),
      .in(ends),
      .in_payload(end_in),
      .out_valid(started && m_valid && m_last),
      .out(leave && m_last),
      .out_payload(end_out),
      .count(finishes),
      .marked(end_marked),
      .ahead(ends_ahead),
      .content(end_of)
  );

  // ---- for the induction: where they are inside --------------------------------------------------------------------
  localparam int ADDRESS_W = $clog2(ENTRIES);
  localparam int SLOT_W = $clog2(SLOTS);
  typedef struct packed {
    logic is_end;
    logic [SAMPLE_W-1:0] maximum;
    logic [LENGTH_W-1:0] length;
    logic [FLAGS_W-1:0] flags;
  } entry_t;
  entry_t entry;
  logic [SLOT_W-1:0] slot;
  logic [ZERO_W-1:0] left, right, peak;
  int components_found, ends_found, of_this_waveform;
  logic component_in_place, end_in_place, is_there;
  always_comb begin
    components_found = 0;
    ends_found = 0;
    of_this_waveform = 0;
    component_in_place = !component_marked;
    end_in_place = !end_marked;
    for (int i = 0; i < ENTRIES + 3; i++) begin
      entry = dut.u_entries.memory[ADDRESS_W'(32'(dut.u_entries.read_q)+i)];
      is_there = i < 32'(dut.entries);
      if (i == ENTRIES) begin
        entry = {1'b0, dut.maximum_q, LENGTH_W'(0), dut.entry_flags};
        is_there = dut.component_q;
      end
      if (i == ENTRIES + 1) begin
        entry = {1'b1, SAMPLE_W'(0), dut.length_q2 == '0, dut.length_q2, dut.entry_flags};
        is_there = dut.finish_q2;
      end
      if (i == ENTRIES + 2) begin
        entry = {1'b1, SAMPLE_W'(0), dut.length_q == '0, dut.length_q, 1'b0, dut.too_long_q, dut.too_short_q};
        is_there = dut.finish_q;
      end
      if (is_there && !entry.is_end) begin
        if (components_found == components_ahead
            && component.waveform == waveform_out_q + NUMBER_W'(ends_found)
            && {component.maximum, component.flags} == {entry.maximum, entry.flags})
          component_in_place = 1'b1;
        components_found = components_found + 1;
        of_this_waveform = of_this_waveform + 1;
      end
      if (is_there && entry.is_end) begin
        if (ends_found == ends_ahead && end_of == {entry.length, entry.flags}) end_in_place = 1'b1;
        ends_found = ends_found + 1;
        of_this_waveform = 0;
      end
    end

    slot  = dut.head_slot_q + SLOT_W'(components_ahead);
    left  = dut.inflections[{slot, 1'b0}];
    right = dut.inflections[{slot, 1'b1}];
    peak  = {1'b0, dut.peaks[slot]};
    if (left[ZERO_W-1]) left[2*SECOND_W-1:0] = '0;
    if (right[ZERO_W-1]) right[2*SECOND_W-1:0] = '0;
    if (component.flags[FLAG_NO_PEAK]) peak = '0;
  end

  // ---- runs of this waveform so far, for the claim about the noise -------------------------------------------------
  int runs_q, processed;
  logic first_of_all_q;
  always_ff @(posedge clk) begin
    if (rst || ends) runs_q <= 0;
    else runs_q <= runs_q + 32'(kept);
    first_of_all_q <= !rst && 32'(next_q) + 32'(s_valid) < NOISE_SAMPLES && finishes == 0 && !ends
        && !(s_valid && s_last);
  end
  assign processed = valid_q ? 32'(position_q) : 32'(next_q);  // beats before that in work

  // What may still come: of each beat until the source stops an entry, and of a run in work one more; kept runs are
  // three beats apart, or two where the second is cut by the end of its waveform.
  int beats_to_come, entries_to_come, thirds;
  always_comb begin
    beats_to_come = room ? IN_FLIGHT + 1 : IN_FLIGHT - 32'(low_q);
    entries_to_come = 32'(dut.component_q) + 32'(dut.finish_q2) + 32'(dut.finish_q) + 32'(kept) + 32'(ends)
        + 32'(valid_q ? !last_q && !positive && (starts || in_run_q) : in_run_q);
    thirds = 3 * components + 32'(valid_q) + (in_run_q ? (run_q == 1 ? 1 : 2) : processed == 0 ? -1 : 0);
  end

  logic few_q;  // entries and slots, a cycle ago
  always_ff @(posedge clk) begin
    few_q <= 32'(dut.entries) < ENTRIES - dut.BEATS && 32'(dut.slots_q) < SLOTS - 1 - dut.LATE_RUNS;
  end

  logic fell_q;  // there has been no room
  always_ff @(posedge clk) fell_q <= !rst && (fell_q || (started && !room && dut.entries != '0));

  always_comb begin
    if (started) begin
      entries_do_not_overflow : assert (!(dut.component_q || dut.finish_q2) || dut.unused_entry_ready);
      one_entry_a_cycle : assert (!(dut.component_q && dut.finish_q2));
      slot_in_work_does_not_wait : assert (components < SLOTS);
      room_for_the_noise_to_come : assert (!first_of_all_q || room);
      empty_queue_has_room : assert (dut.entries != '0 || 32'(dut.slots_q) == 32'(dut.popped_q));
      legal_state : assert (2'(dut.state_q) == IDLE || 2'(dut.state_q) == ABOVE || 2'(dut.state_q) == BELOW);
    end
    cover_idle_to_above : cover (started && valid_q && 2'(dut.state_q) == IDLE && 2'(dut.state_d) == ABOVE);
    cover_idle_to_below : cover (started && valid_q && 2'(dut.state_q) == IDLE && 2'(dut.state_d) == BELOW);
    cover_above_to_below : cover (started && valid_q && 2'(dut.state_q) == ABOVE && 2'(dut.state_d) == BELOW);
    cover_below_to_above : cover (started && valid_q && 2'(dut.state_q) == BELOW && 2'(dut.state_d) == ABOVE);
    cover_shoulder : cover (started && leave && !m_last && m_flags[FLAG_NO_PEAK]);
    cover_peak : cover (started && leave && !m_last && !m_flags[FLAG_NO_PEAK]);
    cover_truncated_left : cover (started && kept && truncated);
    cover_truncated_right : cover (started && kept && cut);
    cover_two_ends_in_a_row : cover (started && leave && m_last && dut.finish_q2);
    cover_room_comes_back : cover (started && room && fell_q);
  end

  // ---- for the induction: the module and what is expected go in step -----------------------------------------------
  always_comb begin
    if (started) begin
      queues_are_those_of_the_module : assert (dut.SLOTS == SLOTS && dut.ENTRIES == ENTRIES);
      same_beat : assert (dut.valid_q == valid_q && dut.fresh_q == (next_q == '0));
      position_counts : assert (!valid_q || next_q == (last_q ? INDEX_W'(0) : position_q + 1'b1));
      between_beats : assert (valid_q || next_q == '0 || (next_q == position_q + 1'b1 && !last_q));
      last_in_time : assert (!valid_q || 32'(position_q) != MAX_SAMPLES - 1 || last_q);
      idle_at_first : assert (!valid_q || position_q != '0 || !in_run_q);
      idle_behind_the_last : assert (valid_q || next_q != '0 || !in_run_q);
      same_values :
      assert ((!valid_q && next_q == '0)
              || {dut.last_q, dut.overlong_q, dut.raw_q, dut.second_q, dut.first_q, dut.bin_q}
                 == {last_q, overlong_q, raw_q, second_q, first_q, bin});
      same_signs :
      assert ((!valid_q && next_q == '0)
              || {dut.positive_q, dut.climbing_q, dut.full_q}
                 == {positive, first_q > 0, 32'(position_q) > TAP_COUNT});
      same_before :
      assert (!valid_q || position_q == '0
              || {dut.second_q2, dut.first_q2, dut.climbing_q2}
                 == {second_before_q, first_before_q, first_before_q > 0});
      differ_by_the_second :
      assert (!valid_q || position_q == '0
              || (SECOND_W + 1)'(second_q) == (SECOND_W + 1)'(first_q) - (SECOND_W + 1)'(first_before_q));
      same_state : assert (in_run_q == (2'(dut.state_q) == BELOW));
      idle_until_the_window_is_full : assert ((2'(dut.state_q) == IDLE) == (processed <= TAP_COUNT + 1));
      same_run :
      assert (!in_run_q
              || {dut.run_q, dut.truncated_q, dut.maximum_q, dut.has_peak_q}
                 == {run_q + INDEX_W'(1), truncated_q, maximum_q, has_peak_q});
      same_length :
      assert (!in_run_q || {dut.long_q, dut.long_q2} == {run_q >= min_interval_q, run_q > min_interval_q && run_q > 1});
      run_fits : assert (!in_run_q || (32'(run_q) <= processed - TAP_COUNT - 1 && run_q != '0));
      runs_in_range : assert (runs_q >= 0 && runs_q <= MAX_SAMPLES);
      runs_are_apart :
      assert (3 * runs_q + (!in_run_q ? 0 : run_q == 1 ? 1 : 2)
              <= (processed > TAP_COUNT ? processed - TAP_COUNT - 1 : 0));
      left_is_stored :
      assert (!in_run_q || dut.inflections[{dut.slot_q, 1'b0}] == {truncated_q, left_bin_q, left_y_q, left_y_next_q});
      peak_is_stored :
      assert (!in_run_q || !has_peak_q
              || dut.peaks[dut.slot_q] == {peak_bin_q, SECOND_W'(peak_y_q), SECOND_W'(peak_y_next_q)});
      peak_fits :
      assert (!in_run_q || !has_peak_q
              || (FIRST_W'(SECOND_W'(peak_y_q)) == peak_y_q && FIRST_W'(SECOND_W'(peak_y_next_q)) == peak_y_next_q));
      slots_are_counted : assert (components + 32'(dut.popped_q) == 32'(dut.slots_q) + 32'(dut.component_q));
      level_in_range : assert (32'(dut.entries) <= ENTRIES && m_valid == (dut.entries != '0));
      pointers_agree : assert (dut.u_entries.write_q == dut.u_entries.read_q + ADDRESS_W'(dut.entries));
      slots_in_order : assert (dut.slot_q == dut.head_slot_q + SLOT_W'(components));
      components_are_counted : assert (components == components_found);
      ends_are_counted : assert (finishes == ends_found);
      waveforms_are_counted : assert (waveform_in_q == waveform_out_q + NUMBER_W'(finishes));
      runs_of_this_waveform : assert (of_this_waveform <= runs_q);
      finish_behind : assert ((!dut.finish_q || processed == 0) && (!dut.finish_q2 || processed <= 1));
      marked_component_is_in_its_place : assert (component_in_place);
      marked_end_is_in_its_place : assert (end_in_place);
      marked_zeros_are_in_their_slot :
      assert (!component_marked || {left, peak, right} == {component.left, component.peak, component.right});
      room_while_few_wait : assert (!room || few_q);
      few_entries_on_their_way : assert (entries_to_come <= 3);
      entries_have_room :
      assert (32'(dut.entries) < ENTRIES - dut.BEATS || 32'(dut.entries) + entries_to_come + beats_to_come <= ENTRIES);
      slots_have_room :
      assert (32'(dut.slots_q) < SLOTS - 1 - dut.LATE_RUNS || thirds + beats_to_come <= 3 * SLOTS - 2);
      popped_one : assert (components >= 0 && components <= SLOTS);
      low_for : assert (32'(low_q) <= IN_FLIGHT);
    end
  end
endmodule

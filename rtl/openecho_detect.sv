// Finds the runs that are components, and keeps what their interpolation needs until it is asked for (Zhou 2022, Eq (3)
// as corrected by its worked example, and its state machine).
//
// Sign machine. A second difference is positive or it is not (zero is not). A component is a run of not-positive beats:
//
//   state  | this beat    | next  | event
//   IDLE   | positive     | ABOVE |            IDLE waits for the first beat with a full window
//   IDLE   | not positive | BELOW | left       truncated: the run began before the record
//   ABOVE  | not positive | BELOW | left       left inflection between the last beat and this one
//   BELOW  | positive     | ABOVE | right      right inflection between the last beat and this one
//   BELOW  | last         | IDLE  | right      truncated: the run goes on past the record
//
// The paper's states "inflection 1" and "inflection 2" are the two transitions here, so that an echo directly behind
// another is found too. A run is kept if it is longer than max(min_interval, 1) beats (a run of one is the paper's
// "false turning point") and not truncated at both ends.
//
// Peak. The first difference falls all along a run, so it goes from positive to not positive at most once: there the
// filtered waveform has its maximum. A run without one is a shoulder (FLAG_NO_PEAK).
//
// Maximum of the raw samples strictly between the beats that bracket the run. FLAG_SATURATED: it is full scale.
//
// Output: components, and behind those of a waveform its end (m_last), in order. m_maximum is that of a component, m_length
// that of the waveform. Beside a component `crossing` chooses its left inflection, its right one or its peak: of this zero
// m_y and m_y_next are the differences before and after, m_bin is where the one before stands, and m_edge says that the
// zero lies beyond the edge of the record, which stands for it: then it is at the difference after, a bin later.
//
// Beat i of the second difference stands at i - (TAP_COUNT+1)/2 raw bins, of the first at i - TAP_COUNT/2. m_bin leaves
// the halves out: an inflection is half a bin later if TAP_COUNT is even, and a peak half a bin later than an inflection.
//
// A beat is always taken: it is `room` that tells the source to stop. IN_FLIGHT is how many beats may still come in the
// cycles after it has fallen. Latency from the beat that ends a run to its component: 3 cycles; of the end of a waveform: 4.
module openecho_detect
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    parameter int IN_FLIGHT = 0,
    localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, EXP_W, FRAC),
    localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, EXP_W, FRAC),
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int LENGTH_W = INDEX_W + 1
) (
    input  logic                       clk,
    input  logic                       rst,
    input  logic        [ INDEX_W-1:0] min_interval,
    output logic                       room,
    input  logic                       s_valid,
    input  logic                       s_last,
    input  logic signed [ FIRST_W-1:0] s_first,
    input  logic signed [SECOND_W-1:0] s_second,
    input  logic        [SAMPLE_W-1:0] s_raw,
    input  logic                       s_overlong,
    output logic                       m_valid,
    input  logic                       m_ready,
    output logic                       m_last,
    output logic        [SAMPLE_W-1:0] m_maximum,
    output logic        [LENGTH_W-1:0] m_length,
    output logic        [ FLAGS_W-1:0] m_flags,
    input  logic        [         1:0] crossing,
    output logic                       m_edge,
    output logic        [ INDEX_W-1:0] m_bin,
    output logic signed [SECOND_W-1:0] m_y,
    output logic signed [SECOND_W-1:0] m_y_next
);
  // The raw sample beside a beat lies half a bin before it if TAP_COUNT is even: then the sample beside the beat that
  // ends a run is still inside.
  localparam bit EVEN = TAP_COUNT % 2 == 0;
  localparam int DELAY = (TAP_COUNT + 4) / 2;
  localparam int FULL_W = $clog2(TAP_COUNT + 2);  // bits that tell the beats apart before the window is full

  // ---- the beat, and the one before ---------------------------------------------------------------------------------
  logic valid_q, last_q, overlong_q, full_q, positive_q, climbing_q, climbing_q2;
  logic [SAMPLE_W-1:0] raw_q;
  logic fresh_q;  // the next beat is the first of its waveform
  logic [INDEX_W-1:0] bin_q;
  logic signed [SECOND_W-1:0] second_q, second_q2;
  logic signed [FIRST_W-1:0] first_q, first_q2;

  always_ff @(posedge clk) begin
    valid_q <= s_valid && !rst;
    if (rst) fresh_q <= 1'b1;
    else if (s_valid) fresh_q <= s_last;
    if (s_valid) begin
      last_q <= s_last;
      overlong_q <= s_overlong;
      full_q <= !fresh_q && (full_q || bin_q[FULL_W-1:0] == FULL_W'(TAP_COUNT - DELAY));
      positive_q <= s_second > 0;
      climbing_q <= s_first > 0;
      climbing_q2 <= climbing_q;
      raw_q <= s_raw;
      bin_q <= fresh_q ? INDEX_W'(0) - INDEX_W'(DELAY) : bin_q + 1'b1;
      second_q <= s_second;
      second_q2 <= second_q;
      first_q <= s_first;
      first_q2 <= first_q;
    end
  end

  // ---- sign machine -------------------------------------------------------------------------------------------------
  typedef enum logic [1:0] {
    IDLE,
    ABOVE,
    BELOW
  } state_e;
  state_e state_q, state_d;

  logic run_starts, run_cut, run_over, kept, falls, higher;
  logic truncated_q, has_peak_q;
  logic [INDEX_W-1:0] run_q;  // beats of the run, with this one
  logic long_q, long_q2;  // with this one there are more than min_interval; without it
  logic [SAMPLE_W-1:0] maximum_q, unused_height;

  assign run_starts = full_q && !positive_q && state_q != BELOW;
  assign run_cut = state_q == BELOW && !positive_q && last_q;
  assign run_over = state_q == BELOW && positive_q;

  always_comb begin
    state_d = state_q;
    if (full_q) state_d = BELOW;
    if (full_q && positive_q) state_d = ABOVE;
    if (last_q) state_d = IDLE;
  end

  assign kept = valid_q && ((run_over && long_q2) || (run_cut && long_q && !truncated_q));
  // x + ~y carries where x > y.
  assign {higher, unused_height} = {1'b0, raw_q} + {1'b0, ~maximum_q};
  assign falls = climbing_q2 && !climbing_q && !positive_q;

  always_ff @(posedge clk) begin
    if (rst) state_q <= IDLE;
    else if (valid_q) state_q <= state_d;
    if (valid_q) begin
      run_q <= run_starts ? INDEX_W'(2) : run_q + 1'b1;
      if (run_starts) long_q <= min_interval <= 1;
      else long_q <= long_q || run_q == min_interval;
      long_q2 <= long_q && !run_starts;
      if (run_starts) truncated_q <= state_q == IDLE;
      else if (run_cut) truncated_q <= 1'b1;
      has_peak_q <= falls || (has_peak_q && !run_starts);
      if (run_starts || (higher && (EVEN || !positive_q))) maximum_q <= raw_q;
    end
  end

  // ---- crossings: a slot for each run, written on every beat until the run is kept -----------------------------------
  // Words made from integers of INT_W bits have INT_W - 2 fraction bits; below them there is nothing to store.
  localparam int INT_W = response_width(TAPS, TAP_COUNT, 2, SAMPLE_W);
  localparam int EMPTY_W = EXP_W > 0 && FRAC > INT_W - 2 ? FRAC - (INT_W - 2) : 0;
  localparam int Y_W = SECOND_W - EMPTY_W;
  // Kept runs are at least three beats apart. So many may come once `room` is known to fall, and so many before a
  // waveform's noise is known, until when none of them is taken away: there must always be room for those.
  localparam int BEATS = IN_FLIGHT + 4;
  localparam int LATE_RUNS = (BEATS + 2) / 3;
  localparam int EARLY_RUNS = NOISE_SAMPLES > TAP_COUNT + 4 ? (NOISE_SAMPLES - TAP_COUNT - 4) / 3 + 1 : 1;
  localparam int NEEDED_SLOTS = EARLY_RUNS + LATE_RUNS + 2;  // one is being written
  localparam int SLOTS = NEEDED_SLOTS > 16 ? 2 ** $clog2(NEEDED_SLOTS) : 16;
  localparam int SLOT_W = $clog2(SLOTS);
  localparam int ZERO_W = INDEX_W + 2 * Y_W;

  logic [ZERO_W:0] inflections[2 * SLOTS];  // left, right
  logic [ZERO_W-1:0] peaks[SLOTS];
  logic [SLOT_W-1:0] slot_q;
  logic [SLOT_W:0] slots_q;  // in use
  logic [Y_W-1:0] y, y_next;
  logic pop_component, popped_q;

  always_ff @(posedge clk) begin
    if (valid_q) begin
      inflections[{
        slot_q, state_q==BELOW
      }] <= {
        state_q == IDLE || (state_q == BELOW && !positive_q),
        bin_q,
        Y_W'(second_q2 >> EMPTY_W),
        Y_W'(second_q >> EMPTY_W)
      };
    end
    // Of opposite signs and -second apart, so that Y_W bits hold either.
    if (valid_q && falls) peaks[slot_q] <= {bin_q, Y_W'(first_q2 >> EMPTY_W), Y_W'(first_q >> EMPTY_W)};
  end

  logic [SLOT_W-1:0] head_slot_q;
  logic [  ZERO_W:0] inflection;
  logic [ZERO_W-1:0] peak;
  assign inflection = inflections[{head_slot_q, crossing[1]}];
  assign peak = peaks[head_slot_q];
  assign {m_edge, m_bin, y, y_next} = crossing == CROSSING_PEAK ? {1'b0, peak} : inflection;
  assign m_y = SECOND_W'(y) << EMPTY_W;
  assign m_y_next = SECOND_W'(y_next) << EMPTY_W;

  // ---- entries: a component the cycle after its run, an end of waveform the cycle after that -------------------------
  // A run ends with its waveform or later than any end before it, so no two entries come in the same cycle.
  localparam int ENTRIES = 2 ** $clog2(SLOTS + BEATS);
  logic component_q, finish_q, finish_q2, too_long_q, too_long_q2, too_short_q, too_short_q2;
  logic [INDEX_W-1:0] length_q, length_q2;  // 0 if it has one bit more
  logic [FLAGS_W-1:0] entry_flags;
  logic [$clog2(ENTRIES):0] entries;
  logic unused_entry_ready;

  always_ff @(posedge clk) begin
    component_q <= kept && !rst;
    finish_q <= valid_q && last_q && !rst;
    finish_q2 <= finish_q && !rst;
    length_q <= bin_q + INDEX_W'(DELAY + 1);
    length_q2 <= length_q;
    {too_long_q, too_short_q} <= {overlong_q, !full_q};
    {too_long_q2, too_short_q2} <= {too_long_q, too_short_q};
  end

  always_comb begin
    entry_flags = '0;
    entry_flags[FLAG_SATURATED] = &maximum_q;
    entry_flags[FLAG_TRUNCATED] = truncated_q;
    entry_flags[FLAG_NO_PEAK] = !has_peak_q;
    if (finish_q2) begin
      entry_flags = '0;
      entry_flags[FLAG_TOO_SHORT] = too_short_q2;
      entry_flags[FLAG_TOO_LONG] = too_long_q2;
    end
  end

  openecho_fifo #(
      .WIDTH(1 + SAMPLE_W + LENGTH_W + FLAGS_W),
      .DEPTH(ENTRIES)
  ) u_entries (
      .clk,
      .rst,
      .s_valid(component_q || finish_q2),
      .s_ready(unused_entry_ready),
      .s_data ({finish_q2, maximum_q, length_q2 == '0, length_q2, entry_flags}),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data ({m_last, m_maximum, m_length, m_flags}),
      .level  (entries)
  );

  assign pop_component = m_valid && m_ready && !m_last;

  always_ff @(posedge clk) begin
    if (rst) begin
      room <= 1'b0;
      slot_q <= '0;
      head_slot_q <= '0;
      popped_q <= 1'b0;
      slots_q <= '0;
    end else begin
      room <= 32'(entries) < ENTRIES - BEATS && 32'(slots_q) < SLOTS - 1 - LATE_RUNS;
      slot_q <= slot_q + SLOT_W'(kept);
      head_slot_q <= head_slot_q + SLOT_W'(pop_component);
      popped_q <= pop_component;
      slots_q <= slots_q + (SLOT_W + 1)'(component_q) - (SLOT_W + 1)'(popped_q);
    end
  end
endmodule

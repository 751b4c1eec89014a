// Finds each component's two inflection points and its peak, and interpolates all three (Zhou 2022, Eqs (3) to (5) as
// corrected by its worked example, and its state machine).
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
// filtered waveform has its maximum. A run without one is a shoulder (FLAG_NO_PEAK, m_peak undefined).
//
// Interpolation. All three lie between a beat and the next, of opposite signs: openecho_interpolate makes a position of
// the two values, in the arithmetic that EXP_W chooses. A kept run queues its operations (left, peak, right); positions
// come back in that order. An inflection at the edge of the record is that of a zero at the edge's beat. Differences are
// compared with zero, which takes no more than the sign and any bit, in either arithmetic.
//
// Maximum of the raw samples strictly between the beats that bracket the run. FLAG_SATURATED: it is full scale.
//
// Latency from the beat that ends a run to its component: 4 + rows of the divider cycles (22 at FRAC 16), and 1 more
// with a peak, if the divider is idle; from the last beat of a waveform without a run in work to its trailer: 3.
// Throughput: one beat a clock. In fixed point a run takes the divider 3 * 2 = 6 clocks and kept runs are at least
// min_interval + 2 beats apart, so with min_interval >= 5 the input never waits for it, whatever the waveform; below
// that, QUEUE operations take up a burst and then the input stalls. The queue also bridges the time until a waveform's
// noise is known, for which runs 7 beats apart just fit it. In floating point an operation takes about FRAC + 9 clocks:
// the queue takes up what comes faster, as in a waveform of several echoes, and noise of many kept runs stalls the input.
module openecho_inflection
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, EXP_W, FRAC),
    localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, EXP_W, FRAC),
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int LENGTH_W = INDEX_W + 1,
    localparam int POSITION_W = position_width(EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic        [   INDEX_W-1:0] min_interval,
    input  logic                         s_valid,
    output logic                         s_ready,
    input  logic                         s_last,
    input  logic signed [   FIRST_W-1:0] s_first,
    input  logic signed [  SECOND_W-1:0] s_second,
    input  logic        [  SAMPLE_W-1:0] s_raw,
    input  logic        [   INDEX_W-1:0] s_index,
    input  logic                         s_overlong,
    output logic                         m_valid,
    input  logic                         m_ready,
    output logic                         m_last,
    output logic        [POSITION_W-1:0] m_left,
    output logic        [POSITION_W-1:0] m_right,
    output logic        [POSITION_W-1:0] m_peak,
    output logic        [  SAMPLE_W-1:0] m_maximum,
    output logic        [  LENGTH_W-1:0] m_length,
    output logic        [   FLAGS_W-1:0] m_flags
);
  localparam int QUEUE = 64;
  localparam int QUEUE_MARGIN = 4;  // what the beats already accepted may still queue: left, peak, right, end

  // Beat i of `second` stands at i - (TAP_COUNT+1)/2 raw bins, of `first` at i - TAP_COUNT/2: whole bins, and half a
  // bin for one of the two, depending on whether TAP_COUNT is even.
  localparam bit EVEN = TAP_COUNT % 2 == 0;
  localparam int DELAY = (TAP_COUNT + 2) / 2;

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT)
  ) u_check ();

  // ---- sign machine -------------------------------------------------------------------------------------------------
  typedef enum logic [1:0] {
    IDLE,
    ABOVE,
    BELOW
  } state_e;
  state_e state_q, state_d;

  logic accept, full, positive, run_starts, run_ends, run_cut, kept;
  logic truncated_q;  // the run began before the record
  logic [INDEX_W-1:0] run_q, run;  // beats of the run so far
  logic signed [SECOND_W-1:0] second_q;  // of the beat before
  logic signed [ FIRST_W-1:0] first_q;

  assign accept = s_valid && s_ready;
  assign full = s_index >= INDEX_W'(TAP_COUNT + 1);
  assign positive = s_second > 0;

  assign run_starts = full && !positive && state_q != BELOW;
  assign run_ends = full && positive && state_q == BELOW;
  assign run_cut = full && !positive && s_last;

  always_comb begin
    state_d = state_q;
    if (full) state_d = BELOW;
    if (full && positive) state_d = ABOVE;
    if (s_last) state_d = IDLE;
  end

  always_ff @(posedge clk) begin
    if (rst) state_q <= IDLE;
    else if (accept) state_q <= state_d;
    if (accept) begin
      second_q <= s_second;
      first_q <= s_first;
      run_q <= run;
      if (run_starts) truncated_q <= state_q == IDLE;
    end
  end

  // A run that is cut counts this beat too; one that begins and is cut at once is too short to matter.
  assign run  = run_starts ? INDEX_W'(1) : run_q + INDEX_W'(!positive);
  assign kept = (run_ends || (run_cut && !run_starts && !truncated_q)) && run > min_interval && run > INDEX_W'(1);

  // ---- operands of the three interpolations: what lies on either side of the zero, and the index of the first ---------
  // Words made from integers of INT_W bits have INT_W - 2 fraction bits; below them there is nothing to store.
  localparam int INT_W = response_width(TAPS, TAP_COUNT, 2, SAMPLE_W);
  localparam int EMPTY_W = EXP_W > 0 && FRAC > INT_W - 2 ? FRAC - (INT_W - 2) : 0;
  localparam int Y_W = SECOND_W - EMPTY_W;
  localparam logic [Y_W-1:0] POSITIVE = Y_W'(1) << (Y_W - 2);  // any number, and 2 in floating point
  logic edge_of_record;
  logic [INDEX_W-1:0] crossing_index;
  logic [Y_W-1:0] crossing_y, crossing_next;
  logic [Y_W-1:0] left_y_q, left_next_q, peak_y_q, peak_next_q, right_y_q, right_next_q;
  logic [INDEX_W-1:0] left_index_q, peak_index_q, right_index_q;
  logic peak_now, has_peak_q, has_peak;
  logic [SAMPLE_W-1:0] maximum_q, maximum;

  assign edge_of_record = run_starts ? state_q == IDLE : run_cut;
  assign crossing_index = s_index - INDEX_W'(DELAY + 1) + INDEX_W'(edge_of_record);
  assign crossing_y = edge_of_record ? '0 : Y_W'(second_q >> EMPTY_W);
  assign crossing_next = edge_of_record ? POSITIVE : Y_W'(s_second >> EMPTY_W);

  assign peak_now = first_q > 0 && s_first <= 0;
  assign has_peak = (!run_starts && has_peak_q) || (peak_now && !positive);

  // The raw sample beside a beat lies half a bin before it if TAP_COUNT is even: then the sample beside the beat that
  // ends a run is still inside.
  always_comb begin
    maximum = maximum_q;
    if (run_starts || (s_raw > maximum_q && (EVEN || !positive))) maximum = s_raw;
  end

  always_ff @(posedge clk) begin
    if (accept) begin
      maximum_q  <= maximum;
      has_peak_q <= has_peak;
      if (run_starts) begin
        left_y_q <= crossing_y;
        left_next_q <= crossing_next;
        left_index_q <= crossing_index;
      end
      // Of opposite signs and -second apart, so that Y_W bits hold either.
      if (peak_now && !positive) begin
        peak_y_q <= Y_W'(first_q >> EMPTY_W);
        peak_next_q <= Y_W'(s_first >> EMPTY_W);
        peak_index_q <= s_index - INDEX_W'(EVEN ? DELAY : DELAY + 1);
      end
      if (kept) begin
        right_y_q <= crossing_y;
        right_next_q <= crossing_next;
        right_index_q <= crossing_index;
      end
    end
  end

  // ---- queue: a kept run's left at once, its peak and right in the next two clocks; then the end of the waveform ----
  // No run ends within three beats of another, and the next run's peak comes later than its left: nothing that waits
  // here is overwritten. Only two ends of waveforms have to be held back: one within three beats of another, and one
  // that cuts a run of two beats right behind another run.
  localparam logic [1:0] LEFT = 2'd0;
  localparam logic [1:0] PEAK = 2'd1;
  localparam logic [1:0] RIGHT = 2'd2;
  localparam logic [1:0] FINISH = 2'd3;
  localparam int NOTE_W = 2 + LENGTH_W + SAMPLE_W + FLAGS_W;

  logic peak_waits_q, right_waits_q, finish_waits_q, waits, queue_ready;
  logic [LENGTH_W-1:0] length_q;
  logic overlong_q;

  logic note_push, unused_note_ready, note_valid, note_pop;
  logic [$clog2(QUEUE):0] note_level, unused_operand_level;
  logic [1:0] push_kind, kind;
  logic [LENGTH_W-1:0] push_index, index;
  logic [FLAGS_W-1:0] push_flags, flags;
  logic [SAMPLE_W-1:0] note_maximum;
  logic [  NOTE_W-1:0] note;
  logic operand_push, unused_operand_ready, operand_valid, operand_ready;
  logic [Y_W-1:0] push_y, push_next, operand_y, operand_next;

  assign waits = peak_waits_q || right_waits_q || finish_waits_q;
  assign queue_ready = note_level <= ($clog2(QUEUE) + 1)'(QUEUE - QUEUE_MARGIN - 1);
  assign s_ready = queue_ready && !(s_last && (finish_waits_q || (waits && min_interval < 2)));

  always_ff @(posedge clk) begin
    if (rst) begin
      peak_waits_q   <= 1'b0;
      right_waits_q  <= 1'b0;
      finish_waits_q <= 1'b0;
    end else if (accept && kept) begin
      peak_waits_q   <= has_peak;
      right_waits_q  <= 1'b1;
      finish_waits_q <= s_last;
    end else begin
      peak_waits_q   <= 1'b0;
      right_waits_q  <= right_waits_q && peak_waits_q;
      finish_waits_q <= (accept && s_last) || (finish_waits_q && right_waits_q);
    end
    if (accept && s_last) begin
      length_q   <= LENGTH_W'(s_index) + 1'b1;
      overlong_q <= s_overlong;
    end
  end

  always_comb begin
    push_kind = LEFT;
    push_index = LENGTH_W'(left_index_q);
    push_y = left_y_q;
    push_next = left_next_q;
    push_flags = '0;
    push_flags[FLAG_SATURATED] = &maximum;
    push_flags[FLAG_TRUNCATED] = truncated_q || run_cut;
    push_flags[FLAG_NO_PEAK] = !has_peak;
    if (peak_waits_q) begin
      push_kind  = PEAK;
      push_index = LENGTH_W'(peak_index_q);
      push_y     = peak_y_q;
      push_next  = peak_next_q;
    end else if (right_waits_q) begin
      push_kind  = RIGHT;
      push_index = LENGTH_W'(right_index_q);
      push_y     = right_y_q;
      push_next  = right_next_q;
    end else if (finish_waits_q) begin
      push_kind = FINISH;
      push_index = length_q;
      push_flags = '0;
      push_flags[FLAG_TOO_SHORT] = length_q < LENGTH_W'(TAP_COUNT + 2);
      push_flags[FLAG_TOO_LONG] = overlong_q;
    end
  end
  assign note_push = waits || (accept && kept);
  assign operand_push = note_push && push_kind != FINISH;

  openecho_fifo #(
      .WIDTH(NOTE_W),
      .DEPTH(QUEUE)
  ) u_notes (
      .clk,
      .rst,
      .s_valid(note_push),
      .s_ready(unused_note_ready),
      .s_data ({push_kind, push_index, maximum, push_flags}),
      .m_valid(note_valid),
      .m_ready(note_pop),
      .m_data (note),
      .level  (note_level)
  );

  openecho_fifo #(
      .WIDTH(2 * Y_W),
      .DEPTH(QUEUE)
  ) u_operands (
      .clk,
      .rst,
      .s_valid(operand_push),
      .s_ready(unused_operand_ready),
      .s_data ({push_y, push_next}),
      .m_valid(operand_valid),
      .m_ready(operand_ready),
      .m_data ({operand_y, operand_next}),
      .level  (unused_operand_level)
  );

  // ---- interpolate, and put the component together ------------------------------------------------------------------
  logic position_valid, m_free;
  logic [POSITION_W-1:0] position;

  openecho_interpolate #(
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .VALUE_W(SECOND_W)
  ) u_interpolate (
      .clk,
      .rst,
      .s_valid(operand_valid),
      .s_ready(operand_ready),
      .s_y(SECOND_W'(operand_y) << EMPTY_W),
      .s_y_next(SECOND_W'(operand_next) << EMPTY_W),
      .s_base_valid(note_valid && kind != FINISH),
      .s_index(index[INDEX_W-1:0]),
      .s_half((kind == PEAK) != EVEN),
      .m_valid(position_valid),
      .m_ready(m_free),
      .m_position(position)
  );

  assign {kind, index, note_maximum, flags} = note;
  assign m_free = !m_valid || m_ready;
  assign note_pop = m_free && (kind == FINISH || position_valid);

  always_ff @(posedge clk) begin
    if (rst) m_valid <= 1'b0;
    else if (m_free) m_valid <= note_valid && note_pop && (kind == RIGHT || kind == FINISH);
    if (m_free) begin
      m_last  <= kind == FINISH;
      m_right <= position;
      if (note_valid && kind == LEFT) begin
        m_left <= position;
        m_maximum <= note_maximum;
      end
      if (note_valid && kind == PEAK) m_peak <= position;
      if (note_valid && (kind == LEFT || kind == FINISH)) m_flags <= flags;
      m_length <= index;
    end
  end
endmodule

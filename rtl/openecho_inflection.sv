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
// Interpolation. All three are base + numerator / denominator with a numerator between zero and the denominator, so
// they share one divider. A kept run queues its operations (left, peak, right); the quotients come back in that order.
// Rounding: half up to FRAC bits. Positions cannot overflow: they lie inside the record.
//
// Maximum of the raw samples strictly between the beats that bracket the run. FLAG_SATURATED: it is full scale.
//
// Latency from the beat that ends a run to its component: 3 + rows of the divider cycles (21 at FRAC 16), and 1 more
// with a peak, if the divider is idle; from the last beat of a waveform without a run in work to its trailer: 3.
// Throughput: one beat a clock. A run takes the divider 3 * DIVIDE_LOOPS = 6 clocks and kept runs are at least
// min_interval + 2 beats apart, so with min_interval >= 5 the input never waits for it, whatever the waveform; below
// that, QUEUE operations take up a burst and then the input stalls. The queue also bridges the time until a waveform's
// noise is known, for which runs 7 beats apart just fit it.
module openecho_inflection
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    localparam int FIRST_W = response_width(TAPS, TAP_COUNT, 1, SAMPLE_W),
    localparam int SECOND_W = response_width(TAPS, TAP_COUNT, 2, SAMPLE_W),
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int LENGTH_W = INDEX_W + 1,
    localparam int POSITION_W = INDEX_W + FRAC
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
  localparam int DIVIDE_LOOPS = 2;
  localparam int DEN_W = SECOND_W;  // |second| + |next second| of opposite sign

  // Beat i of `second` stands at i - (TAP_COUNT+1)/2 raw bins, of `first` at i - TAP_COUNT/2: whole bins, and half a
  // bin for one of the two, depending on whether TAP_COUNT is even.
  localparam bit EVEN = TAP_COUNT % 2 == 0;
  localparam int DELAY = (TAP_COUNT + 2) / 2;
  localparam logic [FRAC-1:0] HALF_BIN = {1'b1, {(FRAC - 1) {1'b0}}};

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
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

  // ---- operands of the three interpolations -------------------------------------------------------------------------
  logic edge_of_record;  // an inflection at the edge of the record is not interpolated
  logic [INDEX_W-1:0] crossing_index;
  logic [DEN_W-1:0] crossing_num, crossing_den;
  logic [DEN_W-1:0] left_num_q, left_den_q, peak_num_q, peak_den_q, right_num_q, right_den_q;
  logic [INDEX_W-1:0] left_index_q, peak_index_q, right_index_q;
  logic peak_now, has_peak_q, has_peak;
  logic [SAMPLE_W-1:0] maximum_q, maximum;

  assign edge_of_record = run_starts ? state_q == IDLE : run_cut;
  assign crossing_index = s_index - INDEX_W'(DELAY + 1) + INDEX_W'(edge_of_record);
  always_comb begin
    crossing_num = positive ? -second_q : second_q;
    crossing_den = positive ? s_second - second_q : second_q - s_second;
    if (edge_of_record) begin
      crossing_num = '0;
      crossing_den = DEN_W'(1);
    end
  end

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
        left_num_q   <= crossing_num;
        left_den_q   <= crossing_den;
        left_index_q <= crossing_index;
      end
      if (peak_now && !positive) begin
        peak_num_q   <= DEN_W'(first_q);
        peak_den_q   <= -s_second;
        peak_index_q <= s_index - INDEX_W'(EVEN ? DELAY : DELAY + 1);
      end
      if (kept) begin
        right_num_q   <= crossing_num;
        right_den_q   <= crossing_den;
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
  logic [DEN_W-1:0] push_num, push_den, operand_num, operand_den;

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
    push_num = left_num_q;
    push_den = left_den_q;
    push_flags = '0;
    push_flags[FLAG_SATURATED] = &maximum;
    push_flags[FLAG_TRUNCATED] = truncated_q || run_cut;
    push_flags[FLAG_NO_PEAK] = !has_peak;
    if (peak_waits_q) begin
      push_kind  = PEAK;
      push_index = LENGTH_W'(peak_index_q);
      push_num   = peak_num_q;
      push_den   = peak_den_q;
    end else if (right_waits_q) begin
      push_kind  = RIGHT;
      push_index = LENGTH_W'(right_index_q);
      push_num   = right_num_q;
      push_den   = right_den_q;
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
      .WIDTH(2 * DEN_W),
      .DEPTH(QUEUE)
  ) u_operands (
      .clk,
      .rst,
      .s_valid(operand_push),
      .s_ready(unused_operand_ready),
      .s_data ({push_num, push_den}),
      .m_valid(operand_valid),
      .m_ready(operand_ready),
      .m_data ({operand_num, operand_den}),
      .level  (unused_operand_level)
  );

  // ---- divide, and put the component together -----------------------------------------------------------------------
  logic quotient_valid, quotient_ready, m_free;
  logic [FRAC:0] quotient;  // one bit below FRAC, for rounding
  logic half_bin;
  logic [POSITION_W-1:0] position;

  openecho_divide #(
      .DEN_W (DEN_W),
      .QUO_W (FRAC + 1),
      .STAGES((FRAC + DIVIDE_LOOPS) / DIVIDE_LOOPS)
  ) u_divide (
      .clk,
      .rst,
      .s_valid(operand_valid),
      .s_ready(operand_ready),
      .s_head(operand_num),
      .s_tail({(FRAC + 1) {1'b0}}),
      .s_den(operand_den),
      .m_valid(quotient_valid),
      .m_ready(quotient_ready),
      .m_quotient(quotient)
  );

  assign {kind, index, note_maximum, flags} = note;
  assign m_free = !m_valid || m_ready;
  assign note_pop = m_free && (kind == FINISH || quotient_valid);
  assign quotient_ready = note_valid && m_free && kind != FINISH;

  assign half_bin = (kind == PEAK) != EVEN;
  assign position = {index[INDEX_W-1:0], half_bin ? HALF_BIN : FRAC'(0)}
                  + POSITION_W'(quotient[FRAC:1]) + POSITION_W'(quotient[0]);

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

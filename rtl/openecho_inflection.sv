// Finds each component's two inflection points and its peak (openecho_detect), drops it if it does not stand out of its
// waveform's noise (openecho_threshold), and interpolates all three (openecho_interpolate; Zhou 2022, Eqs (3) to (5)).
//
// The trailer of a waveform (m_last) carries its length, its noise mean and, as amplitude, its noise deviation. A
// component without a peak has FLAG_NO_PEAK and m_peak undefined.
//
// In fixed point one interpolation at a time: an echo takes 3 of them and 7 cycles more, 73 at FRAC 16, a component that
// is dropped 5 cycles. The input is taken at one beat a clock, while the queue of openecho_detect takes up what comes
// faster. When what is left of it is just enough for the beats on their way, s_ready falls.
//
// s_ready comes from a register, and a source that goes on sending for IN_FLIGHT beats after it falls may do so if
// IN_FLIGHT is above 0: each of its beats is taken. So a whole pipeline before this module can do without stalls.
//
// Latency from the last beat of a waveform without a run in work to its trailer: 6 cycles.
module openecho_inflection
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
    localparam int AMP_W = SAMPLE_W + AMP_FRAC,
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int LENGTH_W = INDEX_W + 1,
    localparam int POSITION_W = position_width(EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic        [   INDEX_W-1:0] min_interval,
    input  logic        [  SAMPLE_W-1:0] min_amplitude,
    input  logic        [   RATIO_W-1:0] k,
    input  logic                         noise_valid,
    output logic                         noise_ready,
    input  logic        [     AMP_W-1:0] noise_mean,
    input  logic        [     AMP_W-1:0] noise_deviation,
    input  logic                         noise_none,
    input  logic                         s_valid,
    output logic                         s_ready,
    input  logic                         s_last,
    input  logic signed [   FIRST_W-1:0] s_first,
    input  logic signed [  SECOND_W-1:0] s_second,
    input  logic        [  SAMPLE_W-1:0] s_raw,
    input  logic                         s_overlong,
    output logic                         m_valid,
    input  logic                         m_ready,
    output logic                         m_last,
    output logic        [POSITION_W-1:0] m_left,
    output logic        [POSITION_W-1:0] m_right,
    output logic        [POSITION_W-1:0] m_peak,
    output logic        [     AMP_W-1:0] m_amplitude,
    output logic        [  LENGTH_W-1:0] m_length,
    output logic        [     AMP_W-1:0] m_mean,
    output logic        [   FLAGS_W-1:0] m_flags
);
  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT)
  ) u_check ();

  // Bits 2 to 4 are interpolating, m_valid and head_ready: a state costs no decoding on the longest paths.
  typedef enum logic [4:0] {
    HEAD   = 5'b00000,  // waits for a component or an end, and for the waveform's threshold
    EXCESS = 5'b00001,  // the maximum becomes an amplitude
    TEST   = 5'b00010,
    LEFT   = 5'b00100,  // bits 1 and 0 are the crossing; drops the component if it is not kept
    PEAK   = 5'b00101,
    RIGHT  = 5'b00110,
    PLACE  = 5'b00011,  // the last position is on its way, in floating point
    OFFER  = 5'b01000,
    DONE   = 5'b10000   // with the head of the queue, and behind a trailer with the noise of its waveform
  } state_e;
  state_e state_q, state_d;

  logic head_valid, head_ready, head_last, crossing_edge;
  logic [SAMPLE_W-1:0] head_maximum;
  logic [ FLAGS_W-1:0] head_flags;
  logic [1:0] crossing, place;
  logic [INDEX_W-1:0] crossing_bin;
  logic signed [SECOND_W-1:0] crossing_y, crossing_y_next;
  logic at_head, at_excess, armed, kept, interpolating, crossing_taken, position_valid, placed;
  logic [POSITION_W-1:0] position;

  openecho_detect #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS),
      .IN_FLIGHT(IN_FLIGHT)
  ) u_detect (
      .clk,
      .rst,
      .min_interval,
      .room(s_ready),
      .s_valid(s_valid && (s_ready || IN_FLIGHT > 0)),
      .s_last,
      .s_first,
      .s_second,
      .s_raw,
      .s_overlong,
      .m_valid(head_valid),
      .m_ready(head_ready),
      .m_last(head_last),
      .m_maximum(head_maximum),
      .m_length,
      .m_flags(head_flags),
      .crossing,
      .m_edge(crossing_edge),
      .m_bin(crossing_bin),
      .m_y(crossing_y),
      .m_y_next(crossing_y_next)
  );

  openecho_threshold #(
      .SAMPLE_W(SAMPLE_W)
  ) u_threshold (
      .clk,
      .rst,
      .min_amplitude,
      .k,
      .noise_valid,
      .noise_taken(noise_ready),
      .noise_mean,
      .noise_deviation,
      .armed,
      .load(at_head),
      .subtract(at_excess),
      .finish(m_last),
      .maximum(head_maximum),
      .amplitude(m_amplitude),
      .kept
  );

  openecho_interpolate #(
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .VALUE_W(SECOND_W)
  ) u_interpolate (
      .clk,
      .rst,
      .s_valid(interpolating && kept),
      .s_ready(crossing_taken),
      .s_crossing(crossing),
      .s_edge(crossing_edge),
      .s_bin(crossing_bin),
      .s_y(crossing_y),
      .s_y_next(crossing_y_next),
      .m_valid(position_valid),
      .m_position(position)
  );

  always_comb begin
    state_d = state_q;
    case (state_q)
      HEAD:   if (head_valid && armed) state_d = EXCESS;
      EXCESS: begin
        state_d = TEST;
        if (m_last) state_d = OFFER;
      end
      TEST:    state_d = LEFT;
      LEFT: begin
        if (crossing_taken) state_d = PEAK;
        if (crossing_taken && head_flags[FLAG_NO_PEAK]) state_d = RIGHT;
        if (!kept) state_d = DONE;
      end
      PEAK: begin
        if (crossing_taken) state_d = RIGHT;
      end
      RIGHT: begin
        if (crossing_taken) state_d = PLACE;
        if (placed) state_d = OFFER;
      end
      PLACE:   if (placed) state_d = OFFER;
      OFFER:   if (m_ready) state_d = DONE;
      default: state_d = HEAD;
    endcase
  end

  assign at_head = state_q == HEAD;
  assign at_excess = state_q == EXCESS;
  assign interpolating = state_q[2];
  assign crossing = state_q[1:0];
  assign head_ready = state_q[4];
  assign noise_ready = head_ready && m_last;

  always_ff @(posedge clk) begin
    if (rst) state_q <= HEAD;
    else state_q <= state_d;
    if (at_head) m_last <= head_last;
    if (place == CROSSING_LEFT) m_left <= position;
    if (place == CROSSING_PEAK) m_peak <= position;
    if (place == CROSSING_RIGHT) m_right <= position;
  end

  // Which position is the next to come: in fixed point there is no other operation than that at work.
  if (EXP_W == 0) begin : g_place
    assign place = interpolating ? crossing : CROSSING_NONE;
  end else begin : g_place
    logic [1:0] place_q;
    assign place = interpolating || state_q == PLACE ? place_q : CROSSING_NONE;
    always_ff @(posedge clk) begin
      if (at_head) place_q <= CROSSING_LEFT;
      else if (position_valid && place_q == CROSSING_LEFT && !head_flags[FLAG_NO_PEAK]) place_q <= CROSSING_PEAK;
      else if (position_valid) place_q <= CROSSING_RIGHT;
    end
  end
  assign placed  = position_valid && place == CROSSING_RIGHT;

  assign m_valid = state_q[3];
  assign m_mean  = noise_mean;
  always_comb begin
    m_flags = head_flags;
    if (m_last) m_flags[FLAG_NO_NOISE] = noise_none;
  end
endmodule

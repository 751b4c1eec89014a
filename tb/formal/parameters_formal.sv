// openecho_parameters, fixed point: each component and each trailer comes out once, in order, a trailer in the next
// cycle and a component LATENCY cycles after it has been taken, with its flags and with the centre, width and time that
// the header states, each rounded half up, as the operator / has them; a stalled record is held.
//
// Proved by induction, values included, for positions of 7 bits: the steps of a division are the same at any width.
// Assumed: what is offered stays until it is taken, an interval ends where it begins or later, and n, which is any
// number, holds still. Free: everything else, gaps, stalls and resets among it.
module parameters_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 8,
    localparam int AMP_W = SAMPLE_W + AMP_FRAC,
    localparam int LENGTH_W = $clog2(MAX_SAMPLES) + 1,
    localparam int POSITION_W = position_width(0, FRAC, MAX_SAMPLES),
    localparam int VALUE_W = value_width(SAMPLE_W, 0, FRAC, MAX_SAMPLES)
) (
    input logic                  clk,
    input logic                  rst,
    input logic                  mark,
    input logic                  s_valid,
    input logic                  s_last,
    input logic [POSITION_W-1:0] s_left,
    input logic [POSITION_W-1:0] s_right,
    input logic [POSITION_W-1:0] s_peak,
    input logic [     AMP_W-1:0] s_amplitude,
    input logic [  LENGTH_W-1:0] s_length,
    input logic [     AMP_W-1:0] s_mean,
    input logic [   FLAGS_W-1:0] s_flags,
    input logic                  m_ready
);
  localparam int DIVISION = POSITION_W + 1;  // cycles
  localparam int LATENCY = 2 * DIVISION + 3;

  logic started, s_ready, m_valid, m_last;
  logic [RATIO_W-1:0] n_q;
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
      .n(n_q),
      .s_valid,
      .s_ready,
      .s_last,
      .s_left,
      .s_right,
      .s_peak,
      .s_amplitude,
      .s_length,
      .s_mean,
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
      .WIDTH  (1 + 3 * POSITION_W + 2 * AMP_W + LENGTH_W + FLAGS_W),
      .ASSUMED(1'b1)
  ) u_input (
      .clk,
      .rst,
      .valid  (s_valid),
      .ready  (s_ready),
      .payload({s_last, s_left, s_right, s_peak, s_amplitude, s_length, s_mean, s_flags})
  );

  localparam int RECORD_W = 1 + FLAGS_W + 5 * VALUE_W;
  logic [RECORD_W-1:0] record;
  assign record = {m_last, m_flags, m_amplitude, m_centre, m_peak, m_width, m_time};

  stream_formal #(
      .WIDTH(RECORD_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload(record)
  );

  // What a component is to become. Bits enough for twice any numerator.
  localparam int WIDE_W = 2 * POSITION_W + 3;
  localparam logic [WIDE_W-1:0] K = WIDE_W'($rtoi(1.69864381 * 2.0 ** POSITION_W + 0.5));  // 2 / sqrt(2 ln 2)
  logic [WIDE_W-1:0] ratio, span, width, quarter;
  logic [VALUE_W-1:0] centre, peak;
  logic [RECORD_W-1:0] expected;
  always_comb begin
    ratio = n_q < RATIO_W'(1 << RATIO_FRAC) ? WIDE_W'(1 << RATIO_FRAC) : WIDE_W'(n_q);
    span = WIDE_W'(s_right) - WIDE_W'(s_left);
    width = ((span << (RATIO_FRAC + 1)) + ratio) / (ratio << 1);
    quarter = ((width << (POSITION_W + 1)) + K) / (K << 1);
    centre = VALUE_W'((WIDE_W'(s_left) + WIDE_W'(s_right) + 1'b1) >> 1);
    peak = s_flags[FLAG_NO_PEAK] ? centre : VALUE_W'(s_peak);
    expected = {s_last, s_flags, VALUE_W'(s_amplitude), centre, peak, VALUE_W'(width), centre - VALUE_W'(quarter)};
    if (s_last) begin
      expected = {s_last, s_flags, VALUE_W'(s_amplitude), VALUE_W'(s_length), VALUE_W'(s_mean), (2 * VALUE_W)'(0)};
    end
  end

  logic accept, marked;
  int count, unused_ahead;
  logic [RECORD_W-1:0] content;
  assign accept = s_valid && s_ready;
  order_formal #(
      .WIDTH(RECORD_W),
      .CAPACITY(1)
  ) u_records (
      .clk,
      .rst,
      .mark,
      .in(accept),
      .in_payload(expected),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload(record),
      .count,
      .marked,
      .ahead(unused_ahead),
      .content
  );

  logic [$clog2(LATENCY+1)-1:0] age_q;  // cycles since a component was taken
  logic had_echo_q, known_state;
  logic [4:0] state;
  always_ff @(posedge clk) begin
    n_q <= n_q;
    if (accept) age_q <= s_last ? ($clog2(LATENCY + 1))'(LATENCY) : ($clog2(LATENCY + 1))'(1);
    else if (32'(age_q) < LATENCY) age_q <= age_q + 1'b1;
    had_echo_q <= !rst && (had_echo_q || (m_valid && m_ready && !m_last));
  end
  assign state = 5'(dut.state_q);
  always_comb begin
    if (count == 0) known_state = state == dut.IDLE || state == dut.CENTRE || state == dut.SPAN;
    else if (32'(age_q) == LATENCY) known_state = state == dut.OFFER;
    else if (32'(age_q) == LATENCY - 1) known_state = state == dut.TIME;
    else if (32'(age_q) > DIVISION + 1) known_state = state == dut.QUARTER;
    else if (32'(age_q) == DIVISION + 1) known_state = state == dut.ROUND;
    else known_state = state == dut.WIDTH && age_q != '0;
  end

  always_comb begin
    begins_before_it_ends : assume (s_left <= s_right);
    if (started) begin
      record_in_time : assert (m_valid == (count != 0 && 32'(age_q) == LATENCY));
      k_is_that_of_the_module : assert (WIDE_W'(dut.g_fixed.K) == K);
      // For the induction.
      state_of_its_age : assert (known_state);
      steps_of_a_division :
      assert (state == dut.WIDTH ? 32'(dut.g_fixed.step_q) == DIVISION - 32'(age_q)
              : state == dut.QUARTER ? 32'(dut.g_fixed.step_q) == 2 * DIVISION + 1 - 32'(age_q)
              : state != dut.ROUND || 32'(dut.g_fixed.step_q) == DIVISION - 1 || dut.g_fixed.step_q == '1);
      component_waits_for_its_sums : assert (!(state == dut.CENTRE || state == dut.SPAN) || (s_valid && !s_last));
    end
    cover_echo : cover (started && m_valid && m_ready && !m_last && marked && m_width != '0 && m_time > 0);
    cover_before_the_first_sample : cover (started && m_valid && !m_last && m_time < 0);
    cover_trailer_behind_echo : cover (started && m_valid && m_ready && m_last && had_echo_q);
    cover_stalls_input : cover (started && s_valid && !s_ready && m_valid && m_last && !m_ready);
  end
endmodule

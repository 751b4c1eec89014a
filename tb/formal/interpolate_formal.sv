// openecho_interpolate. Fixed point: each operation gives one position, LATENCY cycles after it has come, and this is
// base + |y| / (|y| + |y'|), the quotient rounded half up, as the operator / has it, or base + 1 at the edge; base is
// the bin with half a bin for an even TAP_COUNT and half a bin for a peak. Proved by induction, for all operands.
//
// Assumed: an operation stays until it is taken; y and y' are of the signs that their crossing has, but at the edge.
// Free: everything else, gaps and resets among it.
module interpolate_formal
  import openecho_pkg::*;
#(
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 16,
    parameter int TAP_COUNT = 4,
    parameter int VALUE_W = 5,
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int POSITION_W = position_width(0, FRAC, MAX_SAMPLES)
) (
    input logic                      clk,
    input logic                      rst,
    input logic                      s_valid,
    input logic        [        1:0] s_crossing,
    input logic                      s_edge,
    input logic        [INDEX_W-1:0] s_bin,
    input logic signed [VALUE_W-1:0] s_y,
    input logic signed [VALUE_W-1:0] s_y_next
);
  localparam int LATENCY = FRAC + 5;  // of FRAC + 6 cycles the last is that of the position

  logic started, s_ready, m_valid;
  logic [POSITION_W-1:0] m_position, expected;

  openecho_interpolate #(
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .VALUE_W(VALUE_W)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_crossing,
      .s_edge,
      .s_bin,
      .s_y,
      .s_y_next,
      .s_ready,
      .m_valid,
      .m_position
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH  (3 + INDEX_W + 2 * VALUE_W),
      .ASSUMED(1'b1)
  ) u_input (
      .clk,
      .rst,
      .valid  (s_valid),
      .ready  (s_ready),
      .payload({s_crossing, s_edge, s_bin, s_y, s_y_next})
  );

  int y, y_next, quotient;
  always_comb begin
    y = 32'(s_y);
    y_next = 32'(s_y_next);
    if (s_crossing == CROSSING_RIGHT) begin
      y = -y;
      y_next = -y_next;
    end
    if (s_edge) quotient = 1 << FRAC;
    else
      quotient = 32'((VALUE_W + FRAC + 3)'((y << (FRAC + 1)) + y - y_next) / (VALUE_W + FRAC + 3)'(2 * (y - y_next)));
    expected = {s_bin, FRAC'(0)} + POSITION_W'(quotient)
        + POSITION_W'((32'(TAP_COUNT % 2 == 0) + 32'(s_crossing == CROSSING_PEAK)) << (FRAC - 1));
  end

  logic [$clog2(LATENCY+1)-1:0] age_q;  // cycles for which the operation has been there
  logic in_step, second_q;
  always_ff @(posedge clk) begin
    age_q <= rst || !s_valid || s_ready ? '0 : age_q + 1'b1;
    second_q <= !rst && (second_q || m_valid);
  end
  assign in_step = {dut.g_fixed.next_q, dut.g_fixed.sum_q, dut.g_fixed.value_q} == {age_q == 1, age_q == 2, age_q == 3};

  always_comb begin
    if (s_valid) begin
      known_crossing : assume (s_crossing != CROSSING_NONE);
      // From left to right + to 0 or -; at a right inflection - or 0 to +.
      signs : assume (s_edge || (s_crossing == CROSSING_RIGHT ? s_y <= 0 && s_y_next > 0 : s_y > 0 && s_y_next <= 0));
    end
    if (started) begin
      one_position_in_time : assert (m_valid == (32'(age_q) == LATENCY));
      taken_with_its_position : assert (s_ready == m_valid);
      position_is_right : assert (!m_valid || m_position == expected);
      // For the induction.
      steps_with_the_operation : assert (32'(dut.g_fixed.step_q) == 32'(age_q));
      phases_in_step : assert (in_step);
    end
    cover_from_zero : cover (started && m_valid && s_y == '0 && !s_edge);
    cover_to_zero : cover (started && m_valid && s_y_next == '0 && !s_edge);
    cover_edge : cover (started && m_valid && s_edge && s_y_next < 0 && s_crossing == CROSSING_RIGHT);
    cover_second : cover (started && m_valid && second_q && s_crossing == CROSSING_PEAK);
  end
endmodule

// sum[i] = sum over k of tap[k] * sample[i-k], exact, with zeros before the waveform (Zhou 2022, Eqs (1), (10), (11)).
// The paper's division by 2^11 is left out: a scale moves no zero crossing.
//
// A smooth impulse response has tiny third differences, {2, -1, -1, 0, -2, 0, -1, -1, 0, ...} for the paper's, except
// where it starts and ends abruptly. So each end is continued in a straight line, the response of the third differences
// is integrated three times, and what the straight lines would add is taken out on the way with two terms:
//
//   curvature += sum over k = 2..T of third[k] * sample[i-k]
//   slope     += curvature + SLOPE * (sample[i] + sample[i-T-1])     SLOPE = tap[1] - tap[0]
//   sum       += slope + STEP * (sample[i] - sample[i-T])            STEP = tap[0] - SLOPE
//
// Integers do not drift, and the integrators start from zero in each waveform. The transposed form has a short path
// between registers for any number of taps. A constant factor is a sum of shifted values, one for each digit of its
// canonical signed form. So there is no multiplier, and for the paper's taps half of the adders that the taps would
// need. Second differences would do without the end terms, but their chain is wider by a third: 43 and -31 go through
// all of it. A direct form that adds mirrored samples first has fewer adders, but a latency that depends on the taps.
//
// Each beat also carries the raw sample that the peak search wants beside it: the one at the centre of the second
// difference of this beat's window (half a bin before it for an even number of taps).
//
// Latency 4 cycles, one sample a clock. The width of `m_sum` holds any response: no overflow, no rounding.
module openecho_filter
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    localparam int SUM_W = response_width(TAPS, TAP_COUNT, 0, SAMPLE_W),
    localparam int INDEX_W = $clog2(MAX_SAMPLES)
) (
    input  logic                       clk,
    input  logic                       rst,
    input  logic                       s_valid,
    output logic                       s_ready,
    input  logic                       s_last,
    input  logic        [SAMPLE_W-1:0] s_sample,
    input  logic        [ INDEX_W-1:0] s_index,
    input  logic                       s_overlong,
    output logic                       m_valid,
    input  logic                       m_ready,
    output logic                       m_last,
    output logic signed [   SUM_W-1:0] m_sum,
    output logic        [SAMPLE_W-1:0] m_raw,
    output logic        [ INDEX_W-1:0] m_index,
    output logic                       m_overlong
);
  localparam int SLOPE = tap(TAPS, TAP_COUNT, 1) - tap(TAPS, TAP_COUNT, 0);
  localparam int STEP = tap(TAPS, TAP_COUNT, 0) - SLOPE;
  localparam bit NEGATED = third_tap(TAP_COUNT) < 0;  // the chain is, so that no adder negates its first product
  localparam int CURVATURE_W = response_bits(2, 0);
  localparam int SLOPE_W = response_bits(1, 0);
  localparam int STEP_W = SAMPLE_W + $clog2((STEP < 0 ? -STEP : STEP) + 1) + 1;
  localparam int RAW_DELAY = (TAP_COUNT + 2) / 2;
  localparam int STAGES = 4;

  // Tap i of the impulse response, continued in a straight line at both ends.
  function automatic int straight_tap(input int i);
    logic signed [TAP_W-1:0] value;
    int mirrored, beyond;
    mirrored = i < (TAP_COUNT + 1) / 2 ? i : TAP_COUNT - 1 - i;
    beyond = mirrored < 0 ? mirrored : 0;
    value = '0;
    if (mirrored < MAX_TAPS / 2) value = TAPS[TAP_W*(mirrored-beyond)+:TAP_W];
    straight_tap = 32'(value) + beyond * SLOPE;
  endfunction

  function automatic int curvature_tap(input int i);
    curvature_tap = straight_tap(i) - 2 * straight_tap(i - 1) + straight_tap(i - 2);
  endfunction

  function automatic int third_tap(input int i);
    third_tap = curvature_tap(i) - curvature_tap(i - 1);
  endfunction

  // Bits of a signed word for any response of the third differences from tap `from` on, of the curvature with its end
  // term, or of the slope: order 3, 2 or 1.
  function automatic int response_bits(input int order, input int from);
    int positive, negative, curvature, slope, value, i;
    positive = 0;
    negative = 0;
    slope = 0;
    for (i = from; i < TAP_COUNT + 2; i = i + 1) begin
      curvature = curvature_tap(i) + (i == 0 || i == TAP_COUNT + 1 ? SLOPE : 0);
      slope = slope + curvature;
      value = order == 3 ? third_tap(i) : order == 2 ? curvature : slope;
      if (value > 0) positive = positive + value;
      else negative = negative - value;
    end
    response_bits = SAMPLE_W + $clog2((positive > negative ? positive : negative) + 1) + 1;
  endfunction

  // value * factor. The digits of 3 * factor that differ from those of the factor are the non-zero ones of twice its
  // canonical signed form; one is negative where the factor has a 1.
  function automatic logic signed [SUM_W-1:0] product(input logic signed [SUM_W-1:0] value, input int factor);
    int digits, d;
    digits  = (factor + 2 * factor) ^ factor;
    product = '0;
    for (d = 30; d >= 0; d = d - 1) begin  // from the highest, which is positive: nothing to negate
      if (digits[d+1]) product = factor[d+1] ? product - (value <<< d) : product + (value <<< d);
    end
  endfunction

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT)
  ) u_check ();

  logic advance;
  assign advance = !m_valid || m_ready;
  assign s_ready = advance;

  // ---- what travels beside the arithmetic; [0] has just been accepted -----------------------------------------------
  logic [STAGES-1:0] valid_q, last_q, overlong_q;
  logic [STAGES-1:0][INDEX_W-1:0] index_q;
  logic [STAGES-1:0][SAMPLE_W-1:0] raw_q;
  logic [TAP_COUNT:0][SAMPLE_W-1:0] history_q;  // [k] came k + 1 samples ago
  logic [1:0] reached_q;  // [k]: the waveform has a sample TAP_COUNT + k ago
  logic [2:0] first_q;  // the beat in the stage is the first of its waveform: nothing before it counts

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q   <= '0;
      reached_q <= '0;
    end else if (advance) begin
      valid_q <= {valid_q[STAGES-2:0], s_valid};
      if (s_valid) begin
        reached_q <= s_last ? '0 : {reached_q[0], reached_q[0] || s_index == INDEX_W'(TAP_COUNT - 1)};
      end
    end
    if (advance) begin
      last_q <= {last_q[STAGES-2:0], s_last};
      overlong_q <= {overlong_q[STAGES-2:0], s_overlong};
      index_q <= {index_q[STAGES-2:0], s_index};
      first_q <= {first_q[1:0], s_index == '0};
      raw_q <= {raw_q[STAGES-2:0], history_q[RAW_DELAY-1]};
      if (s_valid) history_q <= {history_q[TAP_COUNT-1:0], s_sample};
    end
  end

  // ---- third differences --------------------------------------------------------------------------------------------
  // Stage k of the chain holds what the samples so far add to the result k - 1 samples after the latest: from the last
  // sample of a waveform on that is nothing.
  logic signed [SUM_W-1:0] sample;
  assign sample = {{(SUM_W - SAMPLE_W) {1'b0}}, s_sample};

  for (genvar k = 1; k <= TAP_COUNT; k++) begin : g_chain
    localparam int TAP = NEGATED ? -third_tap(k) : third_tap(k);
    localparam int WIDTH = response_bits(3, k);
    logic signed [WIDTH-1:0] product_q, tail, chain_q;
    if (k == TAP_COUNT) begin : g_end
      assign tail = '0;
    end else begin : g_middle
      assign tail = WIDTH'(g_chain[k+1].chain_q);
    end
    always_ff @(posedge clk) begin
      if (advance) product_q <= WIDTH'(product(sample, TAP < 0 ? -TAP : TAP));
      if (rst || (advance && valid_q[0] && last_q[0])) chain_q <= '0;
      else if (advance && valid_q[0]) chain_q <= TAP < 0 ? tail - product_q : tail + product_q;
    end
  end

  // ---- end terms and integrators ------------------------------------------------------------------------------------
  logic [SAMPLE_W-1:0] step_sample, slope_sample;
  logic signed [SAMPLE_W:0] step_q, step_q2;
  logic signed [STEP_W-1:0] step_q3;
  logic [SAMPLE_W:0] ends_q;
  logic signed [CURVATURE_W-1:0] ends_q2, curvature_q;
  logic signed [SLOPE_W-1:0] slope_q;

  assign step_sample  = reached_q[0] ? history_q[TAP_COUNT-1] : '0;
  assign slope_sample = reached_q[1] ? history_q[TAP_COUNT] : '0;

  always_ff @(posedge clk) begin
    if (advance) begin
      ends_q  <= {1'b0, s_sample} + {1'b0, slope_sample};
      ends_q2 <= CURVATURE_W'(product(SUM_W'($signed({1'b0, ends_q})), SLOPE));
      step_q  <= $signed({1'b0, s_sample}) - $signed({1'b0, step_sample});
      step_q2 <= step_q;
      step_q3 <= STEP_W'(product(SUM_W'(step_q2), STEP));
      if (valid_q[0]) begin
        if (first_q[0]) curvature_q <= '0;
        else if (NEGATED) curvature_q <= curvature_q - CURVATURE_W'(g_chain[1].chain_q);
        else curvature_q <= curvature_q + CURVATURE_W'(g_chain[1].chain_q);
      end
      if (valid_q[1]) slope_q <= SLOPE_W'(curvature_q) + SLOPE_W'(ends_q2) + (first_q[1] ? SLOPE_W'(0) : slope_q);
      if (valid_q[2]) m_sum <= SUM_W'(slope_q) + SUM_W'(step_q3) + (first_q[2] ? SUM_W'(0) : m_sum);
    end
  end

  assign m_valid = valid_q[STAGES-1];
  assign m_last = last_q[STAGES-1];
  assign m_raw = raw_q[STAGES-1];
  assign m_index = index_q[STAGES-1];
  assign m_overlong = overlong_q[STAGES-1];
endmodule

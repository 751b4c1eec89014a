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
// What the sum grows by is its first difference, m_first, which the second is made from: where nobody looks at the sum,
// as in the core, synthesis leaves its integrator out.
//
// Integers do not drift, and the integrators start from zero in each waveform. Second differences would do without the
// end terms, but 43 and -31 would go through the whole chain.
//
// The response is symmetric, so third[T+2-k] = -third[k]: half of the third differences are enough, each times the
// difference of two samples T+2-2k apart. Where also third[k+LAG] = -third[k], samples LAG apart do as well, and all
// such k share one subtraction. LAG is chosen to serve the most: for the paper's taps it is 10 and serves five of six.
//
// The transposed chain has a short path between registers for any number of taps. A constant factor is a sum of shifted
// values, one for each digit of its canonical signed form. For the paper's taps there is a single adder before any
// register, 16 of them in all.
//
// Each beat also carries the raw sample that the peak search wants beside it: the one at the centre of the second
// difference of this beat's window (half a bin before it for an even number of taps).
//
// Latency 5 cycles, one sample a clock. The width of `m_sum` holds any response: no overflow, no rounding.
module openecho_filter
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    localparam int SUM_W = response_width(TAPS, TAP_COUNT, 0, SAMPLE_W),
    localparam int FIRST_W = response_width(TAPS, TAP_COUNT, 1, SAMPLE_W),
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
    output logic signed [ FIRST_W-1:0] m_first,
    output logic        [SAMPLE_W-1:0] m_raw,
    output logic        [ INDEX_W-1:0] m_index,
    output logic                       m_overlong
);
  localparam int SLOPE = tap(TAPS, TAP_COUNT, 1) - tap(TAPS, TAP_COUNT, 0);
  localparam int STEP = tap(TAPS, TAP_COUNT, 0) - SLOPE;
  localparam int SLOPE_FACTOR = lowest_positive(SLOPE);
  localparam int STEP_FACTOR = lowest_positive(STEP);
  localparam int HALF = (TAP_COUNT + 1) / 2;  // last third difference of the first half
  localparam int LAG = best_lag();
  localparam int BEND_W = bend_width();
  localparam int RAW_DELAY = (TAP_COUNT + 2) / 2;
  localparam int STAGES = 5;

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

  // Whether a third difference of the first half has its opposite in the second half, so many samples later.
  function automatic bit opposite(input int i, input int lag);
    opposite = 2 * (i + lag) > TAP_COUNT + 2 && third_tap(i + lag) == -third_tap(i);
  endfunction

  function automatic int best_lag();
    int lag, i, served, most;
    most = 0;
    best_lag = 1;
    for (lag = 1; lag < TAP_COUNT; lag = lag + 1) begin
      served = 0;
      for (i = 2; i <= HALF; i = i + 1) if (third_tap(i) != 0 && opposite(i, lag)) served = served + 1;
      if (served > most) begin
        most = served;
        best_lag = lag;
      end
    end
  endfunction

  // Bits of a signed word for what the third differences `from` to HALF add to the curvature.
  function automatic int chain_width(input int from);
    int total, i;
    total = 0;
    for (i = from; i <= HALF; i = i + 1) total = total + (third_tap(i) < 0 ? -third_tap(i) : third_tap(i));
    chain_width = SAMPLE_W + $clog2(total) + 1;
  endfunction

  // The same for the curvature with its end term.
  function automatic int bend_width();
    int positive, negative, value, i;
    positive = 0;
    negative = 0;
    for (i = 0; i < TAP_COUNT + 2; i = i + 1) begin
      value = curvature_tap(i) + (i == 0 || i == TAP_COUNT + 1 ? SLOPE : 0);
      if (value > 0) positive = positive + value;
      else negative = negative - value;
    end
    bend_width = SAMPLE_W + $clog2((positive > negative ? positive : negative) + 1) + 1;
  endfunction

  // The factor or its opposite: that with a positive lowest digit, so that the lowest bits of a product need no adder.
  function automatic int lowest_positive(input int factor);
    lowest_positive = (factor & ((factor & -factor) << 1)) != 0 ? -factor : factor;
  endfunction

  // value * factor. The digits of 3 * factor that differ from those of the factor are the non-zero ones of twice its
  // canonical signed form; one is negative where the factor has a 1.
  function automatic logic signed [SUM_W-1:0] product(input logic signed [SUM_W-1:0] value, input int factor);
    int digits, d;
    digits  = (factor + 2 * factor) ^ factor;
    product = '0;
    for (d = 0; d < TAP_W + 4; d = d + 1) begin  // a third difference of taps has up to three bits more than they
      if (digits[d+1]) product = factor[d+1] ? product - (value <<< d) : product + (value <<< d);
    end
  endfunction

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT)
  ) u_check ();

  logic fresh_q;  // the next sample is the first of its waveform
  logic advance, accept, clear;
  assign advance = !m_valid || m_ready;
  assign accept  = s_valid && advance;
  assign s_ready = advance;
  assign clear   = advance && fresh_q;  // the waveform before counts no more; its last beat is in stage 1 by now

  // ---- samples, and what travels beside the arithmetic; [0] has just been accepted ----------------------------------
  logic [STAGES-1:0] valid_q, last_q, overlong_q;
  logic [STAGES-1:0][INDEX_W-1:0] index_q;
  logic [STAGES-1:0][SAMPLE_W-1:0] raw_q;
  logic [TAP_COUNT:0][SAMPLE_W-1:0] history_q;  // [k] came k + 1 samples ago, zero if before the waveform
  logic [STAGES-1:0] first_q;  // the beat in the stage is

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q <= '0;
      fresh_q <= 1'b1;
    end else if (advance) begin
      valid_q <= {valid_q[STAGES-2:0], s_valid};
      if (s_valid) fresh_q <= s_last;
    end
    if (advance) begin
      last_q <= {last_q[STAGES-2:0], s_last};
      overlong_q <= {overlong_q[STAGES-2:0], s_overlong};
      index_q <= {index_q[STAGES-2:0], s_index};
      raw_q <= {raw_q[STAGES-2:0], history_q[RAW_DELAY-1]};
      first_q <= {first_q[STAGES-2:0], fresh_q};
    end
    if (accept) history_q[0] <= s_sample;
    if (clear) history_q[TAP_COUNT:1] <= '0;
    else if (accept) history_q[TAP_COUNT:1] <= history_q[TAP_COUNT-1:0];
  end

  // ---- third differences --------------------------------------------------------------------------------------------
  // All registers go with the samples: after sample i the difference is that of sample i - 1, and stage k of the chain
  // is what the samples up to i - 2 add to the curvature at i - 2 + k. Stages that subtract the same two samples share
  // the subtraction: synthesis makes equal logic once.
  for (genvar k = 2; k <= HALF; k++) begin : g_chain
    localparam int THIRD = third_tap(k);
    localparam int FACTOR = lowest_positive(THIRD);
    localparam int APART = opposite(k, LAG) ? LAG : TAP_COUNT + 2 - 2 * k;
    localparam int WIDTH = chain_width(k);
    logic signed [WIDTH-1:0] tail, term, chain_q;

    if (k == HALF) begin : g_end
      assign tail = '0;
    end else begin : g_middle
      assign tail = WIDTH'(g_chain[k+1].chain_q);
    end

    if (THIRD == 0) begin : g_nothing
      assign term = '0;
    end else begin : g_term
      logic signed [SAMPLE_W:0] newer, older, difference_q;
      assign newer = {1'b0, history_q[0]};
      assign older = {1'b0, history_q[APART]};
      assign term  = WIDTH'(product(SUM_W'(difference_q), FACTOR));
      always_ff @(posedge clk) begin
        if (clear) difference_q <= '0;
        else if (accept) difference_q <= FACTOR == THIRD ? newer - older : older - newer;
      end
    end

    always_ff @(posedge clk) begin
      if (clear) chain_q <= '0;
      else if (accept) chain_q <= tail + term;
    end
  end

  // ---- end terms and integrators ------------------------------------------------------------------------------------
  logic signed [SAMPLE_W:0] newest, oldest, step_q2, step_q3;
  logic [SAMPLE_W:0] ends_q;
  logic signed [BEND_W-1:0] ends_q2, curvature_q2, bend_q3;
  logic signed [FIRST_W-1:0] step_q4, slope_q4;
  logic signed [SUM_W-1:0] sum_before_q;

  assign newest = {1'b0, history_q[0]};
  assign oldest = {1'b0, history_q[TAP_COUNT]};

  always_ff @(posedge clk) begin
    if (advance) begin
      // stage 1; with the first sample of a waveform the history is still that of the one before
      ends_q <= {1'b0, s_sample} + (fresh_q ? (SAMPLE_W + 1)'(0) : {1'b0, history_q[TAP_COUNT]});
      // stage 2
      if (valid_q[0]) curvature_q2 <= first_q[0] ? '0 : curvature_q2 + BEND_W'(g_chain[2].chain_q);
      ends_q2 <= BEND_W'(product(SUM_W'($signed({1'b0, ends_q})), SLOPE_FACTOR));
      step_q2 <= STEP_FACTOR == STEP ? newest - oldest : oldest - newest;
      // stage 3
      bend_q3 <= SLOPE_FACTOR == SLOPE ? curvature_q2 + ends_q2 : curvature_q2 - ends_q2;
      step_q3 <= step_q2;
      // stage 4
      if (valid_q[2]) slope_q4 <= FIRST_W'(bend_q3) + (first_q[2] ? FIRST_W'(0) : slope_q4);
      step_q4 <= FIRST_W'(product(SUM_W'(step_q3), STEP_FACTOR));
      // stage 5
      m_first <= slope_q4 + step_q4;
      if (valid_q[4]) sum_before_q <= m_sum;
    end
  end

  assign m_sum = SUM_W'(m_first) + (first_q[4] ? SUM_W'(0) : sum_before_q);
  assign m_valid = valid_q[STAGES-1];
  assign m_last = last_q[STAGES-1];
  assign m_raw = raw_q[STAGES-1];
  assign m_index = index_q[STAGES-1];
  assign m_overlong = overlong_q[STAGES-1];
endmodule

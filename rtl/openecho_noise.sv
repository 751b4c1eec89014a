// Mean and deviation of the first NOISE_SAMPLES samples of each waveform (Zhou 2022, section 2.1), one result a
// waveform, in order; a shorter waveform yields `none` with zeros.
//
//   S = sum s, Q = sum s^2, D = 50 Q - S^2        exact
//   mean      = S / 50                            rounded half up to AMP_FRAC bits
//   deviation = floor(sqrt(D)) / 50               root with ROOT_FRAC bits; then rounded half up to AMP_FRAC bits
//
// D grows by s (49 s - 2 S) with each sample s, S the sum before it: one multiplier and its accumulator instead of a
// square and two products afterwards. Then, once a waveform, a digit a clock: the root's digits, highest first, go
// into a long division by 25 as they come, and those of S into another. A step of such a division has six input bits
// and so costs six LUTs. Division by 25 leaves the bits after the point, and the rounding, as a function of its rest.
//
// A waveform arrives each 50 cycles at the most (shorter ones have no statistics), and the digits take less than that.
// `s_ready` falls only where the results are not taken away. Latency from the 50th sample to the result: 6 cycles for
// the sums and ROOT_W for the digits: SAMPLE_W + 15 cycles, 26 at SAMPLE_W 11.
module openecho_noise
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int MAX_SAMPLES = 4096
) (
    input  logic                           clk,
    input  logic                           rst,
    input  logic                           s_valid,
    output logic                           s_ready,
    input  logic                           s_last,
    input  logic [           SAMPLE_W-1:0] s_sample,
    input  logic [$clog2(MAX_SAMPLES)-1:0] s_index,
    output logic                           m_valid,
    input  logic                           m_ready,
    output logic [  SAMPLE_W+AMP_FRAC-1:0] m_mean,
    output logic [  SAMPLE_W+AMP_FRAC-1:0] m_deviation,
    output logic                           m_none
);
  localparam int AMP_W = SAMPLE_W + AMP_FRAC;
  localparam int COUNT_W = $clog2(NOISE_SAMPLES);
  localparam int SUM_W = SAMPLE_W + COUNT_W;
  localparam int FACTOR_W = SAMPLE_W + COUNT_W + 2;  // 49 s - 2 S, signed
  localparam int SPREAD_W = 2 * (SAMPLE_W + 5);  // D <= (25 * full scale)^2, as the deviation is at most half of it
  localparam int ROOT_W = SPREAD_W / 2 + ROOT_FRAC;
  localparam int STEP_W = $clog2(ROOT_W + 1);

  // ---- which waveforms have statistics: one token each, in order ----------------------------------------------------
  logic accept, at_limit, in_window, complete, token_push, token_ready, token_valid, token_none;
  logic held_q;  // D and S of a waveform wait or are at work

  assign accept = s_valid && s_ready;
  assign at_limit = 32'(s_index) == NOISE_SAMPLES - 1;
  assign in_window = 32'(s_index) < NOISE_SAMPLES;
  assign complete = accept && at_limit;
  assign token_push = accept && (at_limit || (s_last && in_window));
  assign s_ready = token_ready && !(at_limit && held_q);

  logic [4:0] unused_token_level;
  openecho_fifo #(
      .WIDTH(1),
      .DEPTH(16)
  ) u_tokens (
      .clk,
      .rst,
      .s_valid(token_push),
      .s_ready(token_ready),
      .s_data (!at_limit),
      .m_valid(token_valid),
      .m_ready(m_valid && m_ready),
      .m_data (token_none),
      .level  (unused_token_level)
  );

  // ---- S and D; [0] has just been accepted --------------------------------------------------------------------------
  logic [2:0] valid_q, first_q;
  logic [3:0] complete_q;
  logic [SAMPLE_W-1:0] sample_q, sample_q2;
  logic [SUM_W-1:0] multiple_q, sum, sum_q, sum_held_q;
  logic signed [FACTOR_W-1:0] factor_q;
  logic signed [FACTOR_W+SAMPLE_W-1:0] growth_q;
  logic [SPREAD_W-1:0] spread, spread_q, spread_held_q;

  // (NOISE_SAMPLES - 1) * sample: the sample, shifted, for each 1 in the factor.
  function automatic logic [SUM_W-1:0] times_49(input logic [SAMPLE_W-1:0] sample);
    int b;
    times_49 = '0;
    for (b = 0; b < COUNT_W; b = b + 1) begin
      if (((NOISE_SAMPLES - 1) >> b) % 2 != 0) times_49 = times_49 + (SUM_W'(sample) << b);
    end
  endfunction

  assign sum = first_q[0] ? '0 : sum_q;
  assign spread = first_q[2] ? '0 : spread_q;

  always_ff @(posedge clk) begin
    valid_q <= rst ? '0 : {valid_q[1:0], accept && in_window};
    complete_q <= rst ? '0 : {complete_q[2:0], complete};
    first_q <= {first_q[1:0], s_index == '0};
    sample_q <= s_sample;
    multiple_q <= times_49(s_sample);
    sample_q2 <= sample_q;
    factor_q <= $signed({2'b0, multiple_q}) - $signed({1'b0, sum, 1'b0});
    growth_q <= factor_q * $signed({1'b0, sample_q2});
    if (valid_q[0]) sum_q <= SUM_W'(sample_q) + sum;
    if (valid_q[2]) spread_q <= SPREAD_W'(growth_q) + spread;
    if (complete_q[1]) sum_held_q <= sum_q;
    if (complete_q[3]) spread_held_q <= spread_q;
  end

  // ---- digits of the root and of both quotients ---------------------------------------------------------------------
  localparam int DIVISOR = NOISE_SAMPLES / 2;
  localparam int REST_W = $clog2(DIVISOR);
  localparam int MEAN_TAIL = AMP_FRAC - 1;  // bits after those that the digits of S, or of the root, decide
  localparam int DEVIATION_TAIL = AMP_FRAC - ROOT_FRAC - 1;

  // Tables, one for each bit `b` of a result. {rest, digit of the dividend} to {digit of the quotient, next rest}:
  function automatic logic [2**(REST_W+1)-1:0] division_step(input int b);
    int value, result;
    for (value = 0; value < 2 ** (REST_W + 1); value = value + 1) begin
      result = value < DIVISOR ? value : value - DIVISOR + 2 ** REST_W;
      division_step[value] = 1'(result >> b);
    end
  endfunction

  // The last rest to rest * 2^bits / DIVISOR, rounded half up:
  function automatic logic [2**REST_W-1:0] division_tail(input int bits, input int b);
    int rest, result;
    for (rest = 0; rest < 2 ** REST_W; rest = rest + 1) begin
      result = (rest * 2 ** bits + DIVISOR / 2) / DIVISOR;
      division_tail[rest] = 1'(result >> b);
    end
  endfunction

  logic busy_q, done, running, clear;
  logic [STEP_W-1:0] step_q;  // digits to come
  logic sum_digit, root_digit;
  logic [1:0] pair;
  logic [REST_W:0] mean_step, deviation_step;
  logic [REST_W-1:0] mean_rest_q, deviation_rest_q;
  logic [SAMPLE_W:0] mean_q;
  logic [SAMPLE_W+ROOT_FRAC-1:0] deviation_q;

  assign done = busy_q && step_q == '0;
  assign clear = !busy_q || (done && m_ready);
  assign running = busy_q && step_q != '0;
  assign sum_digit = 1'({(2 ** STEP_W)'(sum_held_q), 1'b0} >> step_q);
  assign pair = 2'({(2 ** (STEP_W + 1))'(spread_held_q), {(2 * ROOT_FRAC + 2) {1'b0}}} >> {step_q, 1'b0});

  openecho_square_root #(
      .ROOT_W(ROOT_W)
  ) u_root (
      .clk,
      .clear,
      .advance(running),
      .pair,
      .digit  (root_digit)
  );

  for (genvar b = 0; b <= REST_W; b++) begin : g_step
    localparam logic [2**(REST_W+1)-1:0] STEP = division_step(b);
    assign mean_step[b] = STEP[{mean_rest_q, sum_digit}];
    assign deviation_step[b] = STEP[{deviation_rest_q, root_digit}];
  end

  always_ff @(posedge clk) begin
    if (rst) begin
      held_q <= 1'b0;
      busy_q <= 1'b0;
    end else begin
      if (complete_q[3]) held_q <= 1'b1;
      else if (running && step_q == STEP_W'(1)) held_q <= 1'b0;
      if (done) busy_q <= !m_ready;
      else if (held_q && token_valid && !token_none) busy_q <= 1'b1;
    end
    if (clear) begin
      step_q <= STEP_W'(ROOT_W);
      {mean_q, mean_rest_q} <= '0;
      {deviation_q, deviation_rest_q} <= '0;
    end else if (running) begin
      step_q <= step_q - 1'b1;
      {mean_q, mean_rest_q} <= {mean_q[SAMPLE_W-1:0], mean_step};
      {deviation_q, deviation_rest_q} <= {deviation_q[SAMPLE_W+ROOT_FRAC-2:0], deviation_step};
    end
  end

  logic [MEAN_TAIL-1:0] mean_tail;
  logic [DEVIATION_TAIL:0] deviation_tail;
  for (genvar b = 0; b < MEAN_TAIL; b++) begin : g_mean_tail
    localparam logic [2**REST_W-1:0] TAIL = division_tail(MEAN_TAIL, b);
    assign mean_tail[b] = TAIL[mean_rest_q];
  end
  for (genvar b = 0; b <= DEVIATION_TAIL; b++) begin : g_deviation_tail
    localparam logic [2**REST_W-1:0] TAIL = division_tail(DEVIATION_TAIL, b);
    assign deviation_tail[b] = TAIL[deviation_rest_q];
  end

  // While nothing is divided all of this is zero, as it has to be beside `none`.
  assign m_valid = token_valid && (token_none || done);
  assign m_none = token_none;
  assign m_mean = {mean_q, mean_tail};  // rounding carries no further: 24 * 2^7 / 25 < 2^7 - 1
  assign m_deviation = {1'b0, deviation_q, DEVIATION_TAIL'(0)} + AMP_W'(deviation_tail);
endmodule

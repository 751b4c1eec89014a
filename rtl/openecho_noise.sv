// Mean and deviation of the first NOISE_SAMPLES samples of each waveform (Zhou 2022, section 2.1), one result a
// waveform, in order; a shorter waveform yields `none` with zeros.
//
//   S = sum s, Q = sum s^2, D = 50 Q - S^2        exact
//   mean      = S / 50                            rounded half up to AMP_FRAC bits
//   deviation = floor(sqrt(D)) / 50               root with ROOT_FRAC bits; then rounded half up to AMP_FRAC bits
//
// D falls by s (2 S - 51 s) with each sample s, S the sum with it: a multiplier and its accumulator instead of a square
// and two products afterwards. What is summed up is -1 - D, its complement. Then, once a waveform, a digit a clock: the
// root's digits, highest first, go into a long division by 25 as they come, and those of S into another. A step of such
// a division has six input bits and so costs six LUTs. Division by 25 leaves the bits after the point, and the
// rounding, as a function of its rest.
//
// DSP 1 takes two DSP blocks: -51 s with the addition of 2 S, and the sum of products. DSP 0 takes none, and has no
// operator * either: see openecho_multiply.
//
// A waveform arrives each 50 cycles at the most (shorter ones have no statistics), and the digits take less than that.
// `s_ready` falls only where the results are not taken away. Latency from the 50th sample to the result: 3 cycles for
// the factors, those of openecho_multiply, 4 around the digits and ROOT_W for them: SAMPLE_W + 19 cycles, 30 at
// SAMPLE_W 11, or without DSP SAMPLE_W + floor(SAMPLE_W / 2) + 18, 34.
module openecho_noise
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int MAX_SAMPLES = 4096,
    parameter bit DSP = 1'b1
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
  localparam int MULTIPLE_W = SAMPLE_W + COUNT_W + 1;  // -51 s, signed
  localparam int FACTOR_W = SAMPLE_W + COUNT_W + 2;  // 2 S - 51 s, signed
  localparam int SPREAD_W = 2 * (SAMPLE_W + 5);  // D <= (25 * full scale)^2, as the deviation is at most half of it
  localparam int ROOT_W = SPREAD_W / 2 + ROOT_FRAC;
  localparam int STEP_W = $clog2(ROOT_W + 1);

  // ---- which waveforms have statistics: one token each, in order ----------------------------------------------------
  logic accept, token_push, token_ready, token_valid, token_none;
  logic in_window_q, at_limit_q;  // of the sample that comes next: it is one of the window, and its last
  logic held_q;  // D and S of a waveform wait or are at work

  assign accept = s_valid && s_ready;
  assign token_push = accept && (at_limit_q || (s_last && in_window_q));
  assign s_ready = token_ready && !(at_limit_q && held_q);

  always_ff @(posedge clk) begin
    if (rst) begin
      in_window_q <= 1'b1;
      at_limit_q  <= 1'b0;
    end else if (accept) begin
      in_window_q <= s_last || (in_window_q && !at_limit_q);
      at_limit_q  <= !s_last && 32'(s_index) == NOISE_SAMPLES - 2;
    end
  end

  logic [4:0] unused_token_level;
  openecho_fifo #(
      .WIDTH(1),
      .DEPTH(16)
  ) u_tokens (
      .clk,
      .rst,
      .s_valid(token_push),
      .s_ready(token_ready),
      .s_data (!at_limit_q),
      .m_valid(token_valid),
      .m_ready(m_valid && m_ready),
      .m_data (token_none),
      .level  (unused_token_level)
  );

  // ---- S and D ------------------------------------------------------------------------------------------------------
  // sample_q, then -51 s and S, then the factor. What is not in the window is zero, which changes neither S nor D.
  logic [2:0] first_q, complete_q;  // [0]: of sample_q
  logic [SAMPLE_W-1:0] sample_q, sample_q2;
  logic signed [MULTIPLE_W-1:0] multiple_q;
  logic signed [  FACTOR_W-1:0] factor_q;
  logic [SUM_W-1:0] sum_q, sum_held_q;
  logic [SPREAD_W-1:0] spread_n;
  logic spread_done;

  always_ff @(posedge clk) begin
    complete_q <= rst ? '0 : {complete_q[1:0], accept && at_limit_q};
    first_q <= {first_q[1:0], s_index == '0};
    sample_q <= accept && in_window_q ? s_sample : '0;
    sample_q2 <= sample_q;
    sum_q <= SUM_W'(sample_q) + (first_q[0] ? '0 : sum_q);
    factor_q <= FACTOR_W'(multiple_q) + $signed({1'b0, sum_q, 1'b0});
    if (complete_q[1]) sum_held_q <= sum_q;
  end

  // -51 s, without a multiplier as 17 (s - 4 s).
  if (DSP) begin : g_dsp
    always_ff @(posedge clk) multiple_q <= $signed({1'b0, sample_q}) * -MULTIPLE_W'(NOISE_SAMPLES + 1);
  end else begin : g_soft
    logic signed [SAMPLE_W+2:0] part_q;
    always_ff @(posedge clk) begin
      part_q <= accept && in_window_q ? $signed({3'b0, s_sample}) - $signed({1'b0, s_sample, 2'b0}) : '0;
      multiple_q <= MULTIPLE_W'(part_q) + (MULTIPLE_W'(part_q) <<< 4);
    end
  end

  openecho_multiply #(
      .A_W(FACTOR_W),
      .B_W(SAMPLE_W),
      .TOTAL_W(SPREAD_W),
      .DSP(DSP)
  ) u_spread (
      .clk,
      .rst,
      .first(first_q[2]),
      .last (complete_q[2]),
      .a    (factor_q),
      .b    (sample_q2),
      .done (spread_done),
      .total(spread_n)
  );

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

  logic busy_q, fetching_q, done, fetch, clear;
  logic [1:0] fetched_q;  // a cycle ago, two cycles ago: a digit of S and a pair of D are here, a digit of the root is
  logic [STEP_W-1:0] step_q;  // weight of the digit to fetch
  logic sum_digit_q, root_digit;
  logic [1:0] pair_q;
  logic [REST_W:0] mean_step, deviation_step;
  logic [REST_W-1:0] mean_rest_q, deviation_rest_q;
  logic [SAMPLE_W:0] mean_q;
  logic [SAMPLE_W+ROOT_FRAC-1:0] deviation_q;

  // Pairs of bits for the root: those of D, then ROOT_FRAC of zeros. So that the multiplexer has only D to choose from,
  // D is turned until the pair of each step has the number of the step, modulo TURN_W / 2.
  localparam int TURN_W = 2 ** $clog2(SPREAD_W);
  localparam int TURN_STEP_W = $clog2(TURN_W) - 1;
  logic [TURN_W-1:0] turned;
  assign turned = TURN_W'({2{TURN_W'(~spread_n)}} >> (TURN_W - 2 * ROOT_FRAC));

  assign fetch  = busy_q && fetching_q;
  assign done   = busy_q && !fetching_q && fetched_q == '0;
  assign clear  = !busy_q || (done && m_ready);

  openecho_square_root #(
      .ROOT_W(ROOT_W)
  ) u_root (
      .clk,
      .clear,
      .advance(fetched_q[0]),
      .pair   (pair_q),
      .digit  (root_digit)
  );

  for (genvar b = 0; b <= REST_W; b++) begin : g_step
    localparam logic [2**(REST_W+1)-1:0] STEP = division_step(b);
    assign mean_step[b] = STEP[{mean_rest_q, sum_digit_q}];
    assign deviation_step[b] = STEP[{deviation_rest_q, root_digit}];
  end

  always_ff @(posedge clk) begin
    if (rst) begin
      held_q <= 1'b0;
      busy_q <= 1'b0;
      fetched_q <= '0;
    end else begin
      if (spread_done) held_q <= 1'b1;
      else if (fetch && step_q == '0) held_q <= 1'b0;
      if (done) busy_q <= !m_ready;
      else if (held_q && token_valid && !token_none) busy_q <= 1'b1;
      fetched_q <= {fetched_q[0], fetch};
    end
    sum_digit_q <= 1'((2 ** STEP_W)'(sum_held_q) >> step_q);
    pair_q <= 32'(step_q) < ROOT_FRAC ? '0 : 2'(turned >> {step_q[TURN_STEP_W-1:0], 1'b0});
    fetching_q <= clear || (fetching_q && step_q != '0);
    if (clear) step_q <= STEP_W'(ROOT_W - 1);
    else step_q <= step_q - 1'b1;
    if (clear) begin
      {mean_q, mean_rest_q} <= '0;
      {deviation_q, deviation_rest_q} <= '0;
    end else begin
      if (fetched_q[0]) {mean_q, mean_rest_q} <= {mean_q[SAMPLE_W-1:0], mean_step};
      if (fetched_q[1]) {deviation_q, deviation_rest_q} <= {deviation_q[SAMPLE_W+ROOT_FRAC-2:0], deviation_step};
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

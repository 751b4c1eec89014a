// first[i] = sum[i] - sum[i-1] and second[i] = sum[i] - 2 sum[i-1] + sum[i-2], exact, with zeros before the waveform
// (Zhou 2022, Eq (2)). Later modules look at `second` from sample TAP_COUNT + 1 on, where the window is full.
//
// In floating point both then become words, times 2^-11 (the scale of Eq (11), which the filter leaves out) in the same
// rounding, so that no format overflows on the way. 2^-11 is a normal number: none becomes zero.
//
// Latency 2 cycles, in floating point 2 and those of openecho_float_from_int; one sample a clock. The integers have as
// many bits as any response of the differenced taps needs, for smooth taps fewer than the sum has: the differences are
// taken modulo that many bits from the start.
module openecho_second_difference
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    localparam int SUM_W = response_width(TAPS, TAP_COUNT, 0, SAMPLE_W),
    localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, EXP_W, FRAC),
    localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, EXP_W, FRAC),
    localparam int INDEX_W = $clog2(MAX_SAMPLES)
) (
    input  logic                       clk,
    input  logic                       rst,
    input  logic                       s_valid,
    output logic                       s_ready,
    input  logic                       s_last,
    input  logic signed [   SUM_W-1:0] s_sum,
    input  logic        [SAMPLE_W-1:0] s_raw,
    input  logic        [ INDEX_W-1:0] s_index,
    input  logic                       s_overlong,
    output logic                       m_valid,
    input  logic                       m_ready,
    output logic                       m_last,
    output logic signed [ FIRST_W-1:0] m_first,
    output logic signed [SECOND_W-1:0] m_second,
    output logic        [SAMPLE_W-1:0] m_raw,
    output logic        [ INDEX_W-1:0] m_index,
    output logic                       m_overlong
);
  localparam int FIRST_INT_W = response_width(TAPS, TAP_COUNT, 1, SAMPLE_W);
  localparam int SECOND_INT_W = response_width(TAPS, TAP_COUNT, 2, SAMPLE_W);
  localparam int INT_W = FIRST_INT_W > SECOND_INT_W ? FIRST_INT_W : SECOND_INT_W;

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .DIFFERENCE_W(INT_W)
  ) u_check ();

  // ---- exact differences --------------------------------------------------------------------------------------------
  logic advance;
  assign s_ready = advance;

  logic valid_q, last_q, overlong_q, valid_q2, last_q2, overlong_q2;
  logic [SAMPLE_W-1:0] raw_q, raw_q2;
  logic [INDEX_W-1:0] index_q, index_q2;
  logic signed [FIRST_INT_W-1:0] sum_before_q, first_q, first_q2;
  logic signed [SECOND_INT_W-1:0] first_before_q, second_q2;

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q  <= 1'b0;
      valid_q2 <= 1'b0;
    end else if (advance) begin
      valid_q  <= s_valid;
      valid_q2 <= valid_q;
    end
    if (advance) begin
      // stage 1
      last_q <= s_last;
      raw_q <= s_raw;
      index_q <= s_index;
      overlong_q <= s_overlong;
      first_q <= FIRST_INT_W'(s_sum) - (s_index == '0 ? FIRST_INT_W'(0) : sum_before_q);
      if (s_valid) sum_before_q <= FIRST_INT_W'(s_sum);
      // stage 2
      last_q2 <= last_q;
      raw_q2 <= raw_q;
      index_q2 <= index_q;
      overlong_q2 <= overlong_q;
      first_q2 <= first_q;
      second_q2 <= SECOND_INT_W'(first_q) - (index_q == '0 ? SECOND_INT_W'(0) : first_before_q);
      if (valid_q) first_before_q <= SECOND_INT_W'(first_q);
    end
  end

  if (EXP_W == 0) begin : g_fixed
    assign advance = !valid_q2 || m_ready;
    assign m_valid = valid_q2;
    assign m_last = last_q2;
    assign m_first = first_q2;
    assign m_second = second_q2;
    assign m_raw = raw_q2;
    assign m_index = index_q2;
    assign m_overlong = overlong_q2;
  end else begin : g_float
    // ---- words; what belongs to them waits in a queue beside ----------------------------------------------------------
    localparam int BESIDE_W = 2 + SAMPLE_W + INDEX_W;
    localparam int BESIDE_DEPTH = 16;  // more beats than a conversion has stages
    logic push, pop, first_ready, second_ready, beside_ready, first_valid, second_valid, beside_valid;
    logic [4:0] unused_first_flags, unused_second_flags;
    logic [$clog2(BESIDE_DEPTH):0] unused_level;

    assign advance = !valid_q2 || (first_ready && second_ready && beside_ready);
    assign push = valid_q2 && advance;
    assign m_valid = first_valid && second_valid && beside_valid;
    assign pop = m_valid && m_ready;

    openecho_float_from_int #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC),
        .INT_W (INT_W),
        .SCALE (-TAP_FRAC)
    ) u_first (
        .clk,
        .rst,
        .s_valid (push),
        .s_ready (first_ready),
        .s_value (INT_W'(first_q2)),
        .m_valid (first_valid),
        .m_ready (pop),
        .m_result(m_first),
        .m_flags (unused_first_flags)
    );

    openecho_float_from_int #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC),
        .INT_W (INT_W),
        .SCALE (-TAP_FRAC)
    ) u_second (
        .clk,
        .rst,
        .s_valid (push),
        .s_ready (second_ready),
        .s_value (INT_W'(second_q2)),
        .m_valid (second_valid),
        .m_ready (pop),
        .m_result(m_second),
        .m_flags (unused_second_flags)
    );

    openecho_fifo #(
        .WIDTH(BESIDE_W),
        .DEPTH(BESIDE_DEPTH)
    ) u_beside (
        .clk,
        .rst,
        .s_valid(push),
        .s_ready(beside_ready),
        .s_data ({last_q2, overlong_q2, raw_q2, index_q2}),
        .m_valid(beside_valid),
        .m_ready(pop),
        .m_data ({m_last, m_overlong, m_raw, m_index}),
        .level  (unused_level)
    );
  end
endmodule

// first[i] = sum[i] - sum[i-1] and second[i] = sum[i] - 2 sum[i-1] + sum[i-2], exact, with zeros before the waveform
// (Zhou 2022, Eq (2)). Later modules look at `second` from sample TAP_COUNT + 1 on, where the window is full.
//
// Latency 2 cycles, one sample a clock. The outputs have as many bits as any response of the differenced taps needs,
// for smooth taps fewer than the sum has: the differences are taken modulo that many bits from the start.
module openecho_second_difference
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    localparam int SUM_W = response_width(TAPS, TAP_COUNT, 0, SAMPLE_W),
    localparam int FIRST_W = response_width(TAPS, TAP_COUNT, 1, SAMPLE_W),
    localparam int SECOND_W = response_width(TAPS, TAP_COUNT, 2, SAMPLE_W),
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
  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT)
  ) u_check ();

  logic advance;
  assign advance = !m_valid || m_ready;
  assign s_ready = advance;

  logic valid_q, last_q, overlong_q;
  logic [SAMPLE_W-1:0] raw_q;
  logic [ INDEX_W-1:0] index_q;
  logic signed [FIRST_W-1:0] sum_before_q, first_q;
  logic signed [SECOND_W-1:0] first_before_q;

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q <= 1'b0;
      m_valid <= 1'b0;
    end else if (advance) begin
      valid_q <= s_valid;
      m_valid <= valid_q;
    end
    if (advance) begin
      // stage 1
      last_q <= s_last;
      raw_q <= s_raw;
      index_q <= s_index;
      overlong_q <= s_overlong;
      first_q <= FIRST_W'(s_sum) - (s_index == '0 ? FIRST_W'(0) : sum_before_q);
      if (s_valid) sum_before_q <= FIRST_W'(s_sum);
      // stage 2
      m_last <= last_q;
      m_raw <= raw_q;
      m_index <= index_q;
      m_overlong <= overlong_q;
      m_first <= first_q;
      m_second <= SECOND_W'(first_q) - (index_q == '0 ? SECOND_W'(0) : first_before_q);
      if (valid_q) first_before_q <= SECOND_W'(first_q);
    end
  end
endmodule

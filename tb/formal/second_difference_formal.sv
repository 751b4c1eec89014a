// openecho_second_difference, fixed point: each beat in is one beat out, in order, with its index, raw sample and
// marks, and with the differences of its sum from the sums before it in the same waveform, whatever stalls, gaps and
// waveforms lie between. Proved by induction, values included: they are compared with differences taken as the beats
// come in.
//
// Assumed: indices count the samples of a waveform from 0, and none is longer than MAX_SAMPLES. Free: everything else.
module second_difference_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 8,
    parameter int TAP_COUNT = 4,
    parameter logic [TAPS_W-1:0] TAPS = {{(TAPS_W - 2 * TAP_W) {1'b0}}, 16'd2, 16'd1},
    localparam int SUM_W = response_width(TAPS, TAP_COUNT, 0, SAMPLE_W),
    localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, 0, FRAC),
    localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, 0, FRAC),
    localparam int INDEX_W = $clog2(MAX_SAMPLES)
) (
    input logic                       clk,
    input logic                       rst,
    input logic                       mark,
    input logic                       s_valid,
    input logic                       s_last,
    input logic signed [   SUM_W-1:0] s_sum,
    input logic        [SAMPLE_W-1:0] s_raw,
    input logic                       s_overlong,
    input logic                       m_ready
);
  localparam int BESIDE_W = 2 + SAMPLE_W + INDEX_W;
  localparam int BEAT_W = BESIDE_W + FIRST_W + SECOND_W;

  logic started, s_ready, m_valid, m_last, m_overlong, accept;
  logic signed [FIRST_W-1:0] m_first;
  logic signed [SECOND_W-1:0] m_second;
  logic [SAMPLE_W-1:0] m_raw;
  logic [INDEX_W-1:0] m_index, position_q;

  openecho_second_difference #(
      .SAMPLE_W(SAMPLE_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_ready,
      .s_last,
      .s_sum,
      .s_raw,
      .s_index(position_q),
      .s_overlong,
      .m_valid,
      .m_ready,
      .m_last,
      .m_first,
      .m_second,
      .m_raw,
      .m_index,
      .m_overlong
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH(BEAT_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_last, m_overlong, m_raw, m_index, m_first, m_second})
  );

  // What the differences are to be.
  logic signed [FIRST_W-1:0] sum_q, first, first_q;
  logic signed [SECOND_W-1:0] second;
  assign accept = s_valid && s_ready;
  assign first  = FIRST_W'(s_sum) - (position_q == '0 ? FIRST_W'(0) : sum_q);
  assign second = SECOND_W'(first) - (position_q == '0 ? SECOND_W'(0) : SECOND_W'(first_q));

  always_ff @(posedge clk) begin
    if (rst) position_q <= '0;
    else if (accept) position_q <= s_last ? '0 : position_q + 1'b1;
    if (accept) begin
      sum_q   <= FIRST_W'(s_sum);
      first_q <= first;
    end
  end

  int count, ahead;
  logic marked;
  logic [BEAT_W-1:0] content;
  order_formal #(
      .WIDTH(BEAT_W),
      .CAPACITY(2)
  ) u_beats (
      .clk,
      .rst,
      .mark,
      .in(accept),
      .in_payload({s_last, s_overlong, s_raw, position_q, first, second}),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload({m_last, m_overlong, m_raw, m_index, m_first, m_second}),
      .count,
      .marked,
      .ahead,
      .content
  );

  // For the induction: where the marked beat is, and what is remembered of the beat before it.
  logic in_first_stage;
  assign in_first_stage = marked && (ahead == 1 || !dut.valid_q2);

  always_comb begin
    a_waveform_ends_in_time : assume (32'(position_q) != MAX_SAMPLES - 1 || s_last);
    if (started) begin
      ready_sink_is_never_awaited : assert (!m_ready || s_ready);
      stages_hold_what_is_inside : assert (32'(dut.valid_q) + 32'(dut.valid_q2) == count);
      beside_in_first_stage :
      assert (!in_first_stage
              || {dut.last_q, dut.overlong_q, dut.raw_q, dut.index_q, dut.first_q} == content[BEAT_W-1:SECOND_W]);
      second_in_first_stage :
      assert (!in_first_stage
              || SECOND_W'(dut.first_q) - (dut.index_q == '0 ? SECOND_W'(0) : dut.first_before_q)
                 == content[SECOND_W-1:0]);
      sum_is_remembered : assert (position_q == '0 || dut.sum_before_q == sum_q);
      first_is_remembered :
      assert (position_q == '0 || (dut.valid_q ? SECOND_W'(dut.first_q) : dut.first_before_q) == SECOND_W'(first_q));
    end
    cover_waveform : cover (started && m_valid && m_ready && m_last && m_index == 2);
    cover_back_to_back : cover (started && m_valid && m_ready && m_last && dut.valid_q && dut.index_q == '0);
  end
endmodule

// openecho_second_difference, fixed point: each beat in is one beat out, in order, with its index, raw sample and
// marks, with its first difference and that one's difference from the first difference before it in the same waveform,
// whatever stalls, gaps and waveforms lie between. Proved by induction, values included: they are compared with
// differences taken as the beats come in.
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
    localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, 0, FRAC),
    localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, 0, FRAC),
    localparam int INDEX_W = $clog2(MAX_SAMPLES)
) (
    input logic                       clk,
    input logic                       rst,
    input logic                       mark,
    input logic                       s_valid,
    input logic                       s_last,
    input logic signed [ FIRST_W-1:0] s_first,
    input logic        [SAMPLE_W-1:0] s_raw,
    input logic                       s_overlong,
    input logic                       m_ready
);
  localparam int BEAT_W = 2 + SAMPLE_W + INDEX_W + FIRST_W + SECOND_W;

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
      .s_first,
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

  // What the difference is to be.
  logic signed [ FIRST_W-1:0] first_q;
  logic signed [SECOND_W-1:0] second;
  assign accept = s_valid && s_ready;
  assign second = SECOND_W'(s_first) - (position_q == '0 ? SECOND_W'(0) : SECOND_W'(first_q));

  always_ff @(posedge clk) begin
    if (rst) position_q <= '0;
    else if (accept) position_q <= s_last ? '0 : position_q + 1'b1;
    if (accept) first_q <= s_first;
  end

  int count, unused_ahead;
  logic unused_marked;
  logic [BEAT_W-1:0] unused_content;
  order_formal #(
      .WIDTH(BEAT_W),
      .CAPACITY(1)
  ) u_beats (
      .clk,
      .rst,
      .mark,
      .in(accept),
      .in_payload({s_last, s_overlong, s_raw, position_q, s_first, second}),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload({m_last, m_overlong, m_raw, m_index, m_first, m_second}),
      .count,
      .marked(unused_marked),
      .ahead(unused_ahead),
      .content(unused_content)
  );

  always_comb begin
    a_waveform_ends_in_time : assume (32'(position_q) != MAX_SAMPLES - 1 || s_last);
    if (started) begin
      ready_sink_is_never_awaited : assert (!m_ready || s_ready);
      // For the induction: what is inside, and what is remembered of the beat before.
      output_is_what_is_inside : assert (m_valid == (count != 0));
      first_of_a_waveform_is_known : assert (dut.fresh_q == (position_q == '0));
      first_is_remembered : assert (position_q == '0 || dut.first_q == first_q);
    end
    cover_waveform : cover (started && m_valid && m_ready && m_last && m_index == 2);
    cover_back_to_back : cover (started && m_valid && m_ready && m_last && accept && position_q == '0);
  end
endmodule

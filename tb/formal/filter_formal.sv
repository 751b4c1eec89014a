// openecho_filter: each beat in is one beat out, in order, with its index and marks and with the raw sample RAW_DELAY
// beats before it where its waveform has one, whatever stalls, gaps and waveforms lie between; a ready sink is never
// waited for. What is summed from has the samples of the waveform in it, and zeros for those before.
//
// Proved by induction. Sums are held while the output is stalled, but not compared with anything: the control never
// looks at one, the bench compares them all, and no solver here gets far with three integrators against a direct form.
//
// Assumed: indices count the samples of a waveform from 0, and none is longer than MAX_SAMPLES. Free: everything else.
module filter_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int MAX_SAMPLES = 8,
    parameter int TAP_COUNT = 4,
    parameter logic [TAPS_W-1:0] TAPS = {{(TAPS_W - 2 * TAP_W) {1'b0}}, 16'd2, 16'd1},
    localparam int SUM_W = response_width(TAPS, TAP_COUNT, 0, SAMPLE_W),
    localparam int FIRST_W = response_width(TAPS, TAP_COUNT, 1, SAMPLE_W),
    localparam int INDEX_W = $clog2(MAX_SAMPLES)
) (
    input logic                clk,
    input logic                rst,
    input logic                mark,
    input logic                s_valid,
    input logic                s_last,
    input logic [SAMPLE_W-1:0] s_sample,
    input logic                s_overlong,
    input logic                m_ready
);
  localparam int STAGES = 5;
  localparam int RAW_DELAY = (TAP_COUNT + 2) / 2;
  localparam int BEAT_W = 2 + INDEX_W + SAMPLE_W;

  logic started, s_ready, m_valid, m_last, m_overlong, accept;
  logic signed [SUM_W-1:0] m_sum;
  logic signed [FIRST_W-1:0] m_first;
  logic [SAMPLE_W-1:0] m_raw;
  logic [INDEX_W-1:0] m_index, position_q;

  openecho_filter #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_ready,
      .s_last,
      .s_sample,
      .s_index(position_q),
      .s_overlong,
      .m_valid,
      .m_ready,
      .m_last,
      .m_sum,
      .m_first,
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
      .WIDTH(BEAT_W + SUM_W + FIRST_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_last, m_overlong, m_index, m_raw, m_first, m_sum})
  );

  // The samples before, [0] the latest.
  logic [TAP_COUNT:0][SAMPLE_W-1:0] before_q;
  assign accept = s_valid && s_ready;

  always_ff @(posedge clk) begin
    if (rst) position_q <= '0;
    else if (accept) position_q <= s_last ? '0 : position_q + 1'b1;
    if (accept) before_q <= {before_q[TAP_COUNT-1:0], s_sample};
  end

  logic [SAMPLE_W-1:0] raw, raw_out;
  assign raw = position_q >= INDEX_W'(RAW_DELAY) ? before_q[RAW_DELAY-1] : '0;
  assign raw_out = m_index >= INDEX_W'(RAW_DELAY) ? m_raw : '0;

  int count, ahead;
  logic marked;
  logic [BEAT_W-1:0] content;
  order_formal #(
      .WIDTH(BEAT_W),
      .CAPACITY(STAGES)
  ) u_beats (
      .clk,
      .rst,
      .mark,
      .in(accept),
      .in_payload({s_last, s_overlong, position_q, raw}),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload({m_last, m_overlong, m_index, raw_out}),
      .count,
      .marked,
      .ahead,
      .content
  );

  // For the induction: where the marked beat is.
  logic in_its_place, remembered, first_is_marked;
  int later;  // beats in later stages
  logic [SAMPLE_W-1:0] raw_inside;
  always_comb begin
    in_its_place = 1'b1;
    later = 0;
    raw_inside = '0;
    for (int k = STAGES - 1; k >= 0; k--) begin
      if (marked && dut.valid_q[k] && later == ahead) begin
        raw_inside = 32'(dut.index_q[k]) >= RAW_DELAY ? dut.raw_q[k] : '0;
        if ({dut.last_q[k], dut.overlong_q[k], dut.index_q[k], raw_inside} != content) in_its_place = 1'b0;
      end
      later = later + 32'(dut.valid_q[k]);
    end
    remembered = dut.fresh_q == (position_q == '0);
    if (position_q != '0) begin
      for (int k = 0; k <= TAP_COUNT; k++) begin
        if (dut.history_q[k] != (k < 32'(position_q) ? before_q[k] : '0)) remembered = 1'b0;
      end
    end
    if (position_q == 1 && (dut.g_chain[2].chain_q != '0 || dut.g_chain[2].g_term.difference_q != '0)) begin
      remembered = 1'b0;
    end
    first_is_marked = 1'b1;
    for (int k = 0; k < STAGES; k++) begin
      if (dut.valid_q[k] && dut.first_q[k] != (dut.index_q[k] == '0)) first_is_marked = 1'b0;
    end
  end

  always_comb begin
    a_waveform_ends_in_time : assume (32'(position_q) != MAX_SAMPLES - 1 || s_last);
    if (started) begin
      ready_sink_is_never_awaited : assert (!m_ready || s_ready);
      stages_hold_what_is_inside : assert (later == count);
      marked_is_in_its_place : assert (in_its_place);
      samples_are_remembered : assert (remembered);
      integrators_know_the_first : assert (first_is_marked);
    end
    cover_waveform : cover (started && m_valid && m_ready && m_last && m_index == 4);
    cover_back_to_back : cover (started && m_valid && m_ready && m_last && dut.first_q[4] && dut.valid_q[4]);
  end
endmodule

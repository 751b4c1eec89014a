// openecho_encoder before its packer: each sample is one code, in order, with the marks of its waveform's ends,
// whatever stalls and gaps lie between. A code has 1 to SAMPLE_W + 16 bits, so never more than 32, and no ones above
// them; and the first codes of a waveform, however many, are at most 32 bits more than their samples.
//
// Proved by induction. The row cuts the packer loose, which has its own proof, from these codes on: with that, a
// waveform is exactly one record of all its codes. Which code a sample has the bench compares. Assumed: the settings
// stand still while a sample is on its way. Free: settings, samples, stalls, gaps, resets.
module encoder_formal
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 8
) (
    input logic                clk,
    input logic                rst,
    input logic                mark,
    input logic                mode,
    input logic [SAMPLE_W-1:0] threshold,
    input logic [SAMPLE_W-1:0] baseline_even,
    input logic [SAMPLE_W-1:0] baseline_odd,
    input logic                s_valid,
    input logic                s_last,
    input logic [SAMPLE_W-1:0] s_sample,
    input logic                m_ready
);
  localparam int STAGES = 5;
  localparam int BEAT_W = 2 + SAMPLE_W;
  localparam int MAX_LENGTH = SAMPLE_W + ESCAPE;
  localparam int SETTINGS_W = 1 + 3 * SAMPLE_W;

  logic started, s_ready, unused_valid, unused_last;
  logic [31:0] unused_word;

  openecho_encoder #(
      .SAMPLE_W(SAMPLE_W)
  ) dut (
      .clk,
      .rst,
      .mode,
      .threshold,
      .baseline_even,
      .baseline_odd,
      .s_valid,
      .s_ready,
      .s_last,
      .s_sample,
      .m_valid(unused_valid),
      .m_ready,
      .m_last (unused_last),
      .m_word (unused_word)
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  logic accept, leave, fresh_q, was_stalled_q;
  logic [SETTINGS_W-1:0] settings, settings_q;
  assign accept = s_valid && s_ready;
  assign leave = dut.coded_valid && s_ready;
  assign settings = {mode, threshold, baseline_even, baseline_odd};
  always_ff @(posedge clk) begin
    if (rst) fresh_q <= 1'b1;
    else if (accept) fresh_q <= s_last;
    settings_q <= settings;
    was_stalled_q <= !rst && dut.coded_valid && !s_ready;
  end

  stream_formal #(
      .WIDTH(BEAT_W + SAMPLE_W + 7)
  ) u_codes (
      .clk,
      .rst,
      .valid  (started && dut.coded_valid),
      .ready  (s_ready),
      .payload({dut.coded_first, dut.coded_last, dut.coded_sample, dut.code, dut.length})
  );

  int count, ahead;
  logic marked;
  logic [BEAT_W-1:0] content;
  order_formal #(
      .WIDTH(BEAT_W),
      .CAPACITY(STAGES)
  ) u_samples (
      .clk,
      .rst,
      .mark,
      .in(accept),
      .in_payload({fresh_q, s_last, s_sample}),
      .out_valid(started && dut.coded_valid),
      .out(leave),
      .out_payload({dut.coded_first, dut.coded_last, dut.coded_sample}),
      .count,
      .marked,
      .ahead,
      .content
  );

  // Bits that the waveform's codes may yet take more than its samples; more than the module ever remembers don't count.
  int room_q, room;
  always_comb begin
    room = room_q;
    if (dut.coded_valid) begin
      room = dut.coded_last ? START_CREDIT : room_q + SAMPLE_W - 32'(dut.length);
      if (room > 1 << CREDIT_W) room = 1 << CREDIT_W;
    end
  end
  always_ff @(posedge clk) begin
    if (rst) room_q <= START_CREDIT;
    else if (leave) room_q <= room;
  end

  // ---- for the induction --------------------------------------------------------------------------------------------
  // The stages, the oldest first.
  logic [STAGES-1:0] valid;
  logic [STAGES-1:0][BEAT_W-1:0] beat;
  assign valid = {
    dut.u_predictor.valid_q, dut.predicted_valid, dut.u_coder.valid_q, dut.u_coder.valid_q2, dut.coded_valid
  };
  assign beat = {
    {dut.u_predictor.head_q, dut.u_predictor.last_q, dut.u_predictor.sample_q},
    {dut.predicted_first, dut.predicted_last, dut.predicted_sample},
    {dut.u_coder.first_q, dut.u_coder.last_q, dut.u_coder.sample_q},
    {dut.u_coder.first_q2, dut.u_coder.last_q2, dut.u_coder.sample_q2},
    {dut.coded_first, dut.coded_last, dut.coded_sample}
  };

  int   older;
  logic in_its_place;
  always_comb begin
    older = 0;
    in_its_place = 1'b1;
    for (int i = 0; i < STAGES; i++) begin
      if (valid[i] && marked && older == ahead && beat[i] != content) in_its_place = 1'b0;
      older = older + 32'(valid[i]);
    end
  end

  // Whether a number is a code so long.
  function automatic logic fits(input logic [SAMPLE_W:0] code, input logic [5:0] length);
    fits = length >= 1 && 32'(length) <= MAX_LENGTH && (64'(code) >> length) == '0;
  endfunction

  always_comb begin
    settings_stand_still : assume (count == 0 || settings == settings_q);
    if (started) begin
      codes_fit : assert (!dut.coded_valid || fits(dut.code, dut.length));
      payload_is_bounded : assert (room >= 0 && room_q >= 0);
      // For the induction.
      stages_hold_what_is_inside : assert (older == count);
      marked_is_in_its_place : assert (in_its_place);
      knows_the_first : assert (dut.u_predictor.first_q == fresh_q);
      low_bits_fit :
      assert (!valid[2] || (32'(dut.u_coder.k_q) <= SAMPLE_W
                                           && (64'(dut.u_coder.low_q) >> (dut.u_coder.k_q + 6'd1)) == '0));
      lengths_fit :
      assert (!valid[1] || (dut.u_coder.escape_q2 ? 32'(dut.u_coder.length_q2) == SAMPLE_W + (mode ? ESCAPE : 1) : fits(
          (SAMPLE_W + 1)'(dut.u_coder.low_q2), dut.u_coder.length_q2
      )));
      gains_are_of_lengths : assert (!valid[1] || dut.u_coder.gain_q2 == 7'(SAMPLE_W) - 7'(dut.u_coder.length_q2));
      credit_is_room : assert (32'(dut.u_coder.credit_q) <= room && room_q <= 1 << CREDIT_W);
    end
    cover_longest : cover (started && leave && 32'(dut.length) == MAX_LENGTH);
    cover_large : cover (started && leave && !mode && dut.code[SAMPLE_W]);
    cover_plain : cover (started && leave && dut.coded_last && dut.u_coder.m_length == 6'(SAMPLE_W) && room_q < ESCAPE);
    cover_waveforms :
    cover (started && leave && dut.coded_last && dut.u_coder.valid_q2 && dut.u_coder.first_q2 && !was_stalled_q);
  end
endmodule

// openecho_decoder, whatever the words are: a record of any length is exactly one beat with `last`, and no beat comes
// but of a record. Its flags say that its head is wrong, or that it ends before its tail, if and only if that is so.
// None is set if and only if, besides, it has as many beats as it says, less than 2^16, their codes end in its last
// word of payload, with zeros behind, and its checksum is that of the samples that left. Every record begins in the
// same state, so that it is decoded the same behind any other. A stalled beat is held. With a ready sink a word waits
// no longer than LIMIT cycles, and a record is out LIMIT cycles after its last word.
//
// Proved by induction. Free: words, where records end, stalls, gaps, resets. Not here: which sample a code is, which
// the bench compares.
module decoder_formal
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 8
) (
    input logic        clk,
    input logic        rst,
    input logic        s_valid,
    input logic        s_last,
    input logic [31:0] s_word,
    input logic        m_ready
);
  // The module's states.
  localparam logic [2:0] HEAD_0 = 0, HEAD_1 = 1, FILL_0 = 2, FILL_1 = 3, RUN = 4, DRAIN = 5, REPORT = 6;
  localparam int LIMIT = 35;
  localparam int BEATS_W = 17;

  logic started, s_ready, m_valid, m_last, take, out;
  logic [SAMPLE_W-1:0] m_sample;
  logic [2:0] m_flags, state;

  openecho_decoder #(
      .SAMPLE_W(SAMPLE_W)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_ready,
      .s_last,
      .s_word,
      .m_valid,
      .m_ready,
      .m_last,
      .m_sample,
      .m_flags
  );

  assign state = 3'(dut.state_q);
  assign take  = s_valid && s_ready;
  assign out   = m_valid && m_ready;

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH(SAMPLE_W + 4)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_last, m_sample, m_flags})
  );

  function automatic logic [31:0] crc(input logic [31:0] start, input logic [SAMPLE_W-1:0] sample);
    crc = start;
    for (int i = SAMPLE_W - 1; i >= 0; i--) crc = {crc[30:0], 1'b0} ^ (crc[31] ^ sample[i] ? 32'h0040_0007 : 32'h0);
  endfunction

  // ---- the record that comes in -------------------------------------------------------------------------------------
  logic [2:0] words_q;  // of it so far; no more than 5
  logic ill_q, ill, ended_q, short_q;  // a wrong head; its last word has come, as one of the first four
  logic [31:0] before_q, before_q2, padded_q, count_q, check_q;  // words before this one; last words, once it has come
  logic prediction;
  logic [15:0] upper, lower;
  assign {upper, lower} = s_word;
  assign prediction = upper[8];
  always_comb begin
    ill = words_q != '0 && ill_q;
    if (words_q == 0 && (upper[15:12] != 4'(CODEC_VERSION) || upper[11:9] != '0 || 32'(upper[7:4]) != SAMPLE_W - 1
                         || upper[3:0] != '0 || 32'(lower) >= 1 << SAMPLE_W || (prediction && lower != '0)))
      ill = 1'b1;
    if (words_q == 1 && (32'(upper) >= 1 << SAMPLE_W || 32'(lower) >= 1 << SAMPLE_W)) ill = 1'b1;
    if (words_q < 3 && s_last) ill = 1'b1;
  end

  // ---- the record that goes out: its beats so far, and their checksum -----------------------------------------------
  logic [BEATS_W-1:0] beats_q, beats;  // those from 2^16 on don't count
  logic [31:0] crc_q;
  logic ill_out_q, short_out_q;
  logic [31:0] padding_out_q, count_out_q, check_out_q;
  logic signed [7:0] left_q, left_out_q;  // bits of the payload behind the codes, if the last two words are the tail
  logic leave;  // the last beat goes to the output
  assign leave = dut.advance && (dut.finish || state == REPORT);
  assign beats = beats_q[BEATS_W-1] ? beats_q : beats_q + 1'b1;

  // Records of which the last word has come, and the last beat has not left.
  logic [1:0] owed_q;

  always_ff @(posedge clk) begin
    if (rst) begin
      words_q <= '0;
      ended_q <= 1'b0;
      owed_q  <= '0;
      beats_q <= '0;
      crc_q   <= '1;
    end else begin
      owed_q <= owed_q + 2'(take && s_last) - 2'(out && m_last);
      if (take) words_q <= s_last ? '0 : words_q < 5 ? words_q + 1'b1 : words_q;
      if (take && s_last) ended_q <= 1'b1;
      else if (leave) ended_q <= 1'b0;
      if (out) begin
        beats_q <= m_last ? '0 : beats;
        crc_q   <= m_last ? '1 : crc(crc_q, m_sample);
      end
    end
    if (take) begin
      ill_q <= ill;
      short_q <= words_q < 4;
      {before_q2, before_q} <= {before_q, s_word};
      if (s_last) begin
        padded_q <= before_q2;
        count_q  <= before_q;
        check_q  <= s_word;
      end
    end
    if (state == FILL_0) left_q <= '0;
    else left_q <= left_q + (take && state == RUN ? 8'sd32 : 8'sd0) - (dut.step ? 8'(dut.length) : 8'sd0);
    if (leave) begin
      {ill_out_q, short_out_q, count_out_q, check_out_q, left_out_q} <= {ill_q, short_q, count_q, check_q, left_q};
      padding_out_q <= padded_q & ((32'd1 << left_q) - 32'd1);
    end
  end

  // What makes the record at its last beat a sound one, but for the head.
  logic long_enough, counted, padded, checked;
  assign long_enough = !short_out_q;
  assign counted = 32'(beats) == count_out_q && count_out_q < 1 << 16;
  assign padded = left_out_q inside {[0 : 31]} && padding_out_q == '0;
  assign checked = crc(crc_q, m_sample) == check_out_q;

  // ---- in time ------------------------------------------------------------------------------------------------------
  // Cycles until the last beat of a record that has ended, or until a word is taken.
  int to_go;
  always_comb begin
    to_go = 0;
    if (state == REPORT) to_go = 1;
    else if (dut.run && dut.tail) to_go = dut.over_q ? 1 : 34 - 32'(dut.at_q);
    else if (dut.run) to_go = 31 - 32'(dut.at_q);
  end

  progress_formal #(
      .LIMIT(LIMIT)
  ) u_word_waits (
      .clk,
      .rst,
      .waiting(started && m_ready && !s_ready),
      .to_go
  );
  progress_formal #(
      .LIMIT(LIMIT)
  ) u_record_waits (
      .clk,
      .rst,
      .waiting(started && m_ready && owed_q != '0 && !(m_valid && m_last)),
      .to_go
  );

  // ---- for the induction --------------------------------------------------------------------------------------------
  logic clean, has_last;
  assign clean = dut.at_q == '0 && dut.count_q == '0 && !dut.over_q && !dut.last_word_q && !dut.next_valid_q;
  assign has_last = m_valid && m_last;
  logic restorer_clean;
  assign restorer_clean = dut.u_restorer.first_q && dut.u_restorer.credit_q == CREDIT_W'(START_CREDIT)
      && dut.u_restorer.spread_0_q == SAMPLE_W'(START_SPREAD) && dut.u_restorer.spread_2_q == SAMPLE_W'(START_SPREAD)
      && dut.u_restorer.step_q == '0
      && dut.u_restorer.here_q == {dut.even_q, 1'b1, (BASELINE_FRAC - 1)'(0)}
      && dut.u_restorer.other_q == {dut.odd_q, 1'b1, (BASELINE_FRAC - 1)'(0)};

  // Beats of the record that comes in, once what stands at the output has left.
  logic [BEATS_W-1:0] beats_then;
  logic [31:0] crc_then;
  assign beats_then = !m_valid ? beats_q : m_last ? '0 : beats;
  assign crc_then   = !m_valid ? crc_q : m_last ? '1 : crc(crc_q, m_sample);

  always_comb begin
    if (started) begin
      one_last_a_record : assert (!has_last || owed_q != '0);
      no_beat_without_a_record : assert (!m_valid || m_last || (state == RUN));
      flags_with_the_last : assert (!m_valid || m_last || m_flags == '0);
      says_ill_formed : assert (!has_last || m_flags[0] == ill_out_q);
      flagged_unless_sound : assert (!has_last || m_flags != '0 || {long_enough, counted, padded, checked} == '1);
      not_flagged_if_sound :
      assert (!has_last || m_flags == '0 || ill_out_q || {long_enough, counted, padded, checked} != '1);
      begins_clean : assert (state != FILL_1 || (clean && restorer_clean));
      // For the induction.
      known_state : assert (state != 3'd7);
      ends_once : assert (32'(owed_q) == 32'(ended_q) + 32'(has_last));
      ended : assert (ended_q == (state == REPORT || (state == RUN && dut.last_word_q && dut.next_valid_q)));
      nothing_of_the_next : assert (!ended_q || words_q == '0);
      words_in_step :
      assert (ended_q || (state == HEAD_0 ? words_q == 0 : state == HEAD_1 ? words_q == 1
                          : state == FILL_0 ? words_q == 2 : state == FILL_1 ? words_q == 3
                          : state == DRAIN ? words_q >= 2 : words_q >= 4));
      knows_the_head :
      assert (state == HEAD_0 || (dut.form_q == ill_q
                                  && (state == HEAD_1 || state == REPORT || ill_q == (state == DRAIN))));
      reports_have_a_reason : assert (!ended_q || (state == REPORT ? ill_q || short_q : !short_q));
      words_ahead_in_run : assert (state == RUN || !dut.next_valid_q);
      tail_is_there : assert (state != RUN || !dut.last_word_q || dut.next_valid_q);
      words_in_their_place :
      assert (state == FILL_1 ? dut.now_q == before_q
              : state != RUN || ended_q || {before_q2, before_q} == (dut.next_valid_q ? {dut.then_q, dut.next_q}
                                                                     : {dut.now_q, dut.then_q}));
      tail_in_its_place :
      assert (state != RUN || !ended_q || {dut.now_q, dut.then_q, dut.next_q} == {padded_q, count_q, check_q});
      bits_left :
      assert (!(state inside {FILL_1, RUN}) || (dut.over_q ? left_q inside {[-32:-1]}
                                                : left_q == (dut.next_valid_q ? 8'sd32 : 8'sd0) - 8'(dut.at_q)));
      codes_have_bits : assert (dut.length >= 1 && dut.length <= 32);
      bits_in_range : assert (state != RUN || (dut.tail ? dut.over_q || dut.at_q <= 32 : !dut.over_q && dut.at_q < 32));
      beats_are_counted :
      assert (dut.count_q == '0 || state != RUN ? beats_then == '0 : dut.count_q[COUNT_W-1] ? beats_then >= '1 >> 1
              : beats_then == dut.count_q - 1'b1);
      none_over_at_first : assert (state != RUN || !dut.over_q || dut.count_q != '0);
      count_in_range : assert (state != RUN || !dut.count_q[COUNT_W-1] || dut.count_q == 1 << (COUNT_W - 1));
      beats_are_checked : assert (crc_then == (state != RUN || dut.count_q == '0 || dut.first_q ? '1 : dut.checksum_q));
      knows_the_first : assert (state != RUN || dut.count_q == '0 || dut.first_q == (dut.count_q == 1));
    end
    cover_samples : cover (started && has_last && m_flags == '0 && beats_q == 3);
    cover_report : cover (started && out && m_last && short_out_q && !ill_out_q);
    cover_drain : cover (started && state == DRAIN && take && s_last);
    cover_shift : cover (started && state == RUN && dut.shift && dut.behind == 32);
    cover_two_owed : cover (started && owed_q == 2);
    cover_over : cover (started && has_last && m_flags[1] && beats_q > 1);
  end
endmodule

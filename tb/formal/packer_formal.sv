// openecho_packer: its words are those of a packer that has 64 bits and all the time: head 0, head 1, each full word of
// the codes end to end, what is left behind the last one, the number of codes, the checksum of the samples; each once,
// in this order, with `last` on the checksum alone, held while stalled. So a waveform is exactly one record, and no bit
// of a code is lost, moved or touched by another. With a ready sink a code waits no longer than WAIT cycles, and a
// record is out LIMIT cycles after its last code.
//
// Proved by induction. The harness has the codes in a row of three places beside the module's, and packs each as it
// leaves. Assumed: a code has 1 to 32 bits and no ones above them, which encoder_formal proves; the head stands still
// while a waveform is inside. Free: codes, lengths and samples, stalls, gaps, resets.
module packer_formal
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 16
) (
    input logic                clk,
    input logic                rst,
    input logic [        31:0] head_0,
    input logic [        31:0] head_1,
    input logic                s_valid,
    input logic                s_last,
    input logic [SAMPLE_W-1:0] s_sample,
    input logic [  SAMPLE_W:0] s_code,
    input logic [         5:0] s_length,
    input logic                m_ready
);
  localparam int WAIT = 5;
  localparam int LIMIT = WAIT + 6;
  // What the module shows.
  localparam logic [2:0] HEAD_0 = 3'b011, HEAD_1 = 3'b010, COUNT = 3'b101, CHECK = 3'b100;

  typedef struct packed {
    logic first;
    logic last;
    logic [5:0] length;
    logic [SAMPLE_W:0] code;
    logic [SAMPLE_W-1:0] sample;
  } code_t;

  logic started, s_ready, m_valid, m_last, fresh_q;
  logic [31:0] m_word;

  openecho_packer #(
      .SAMPLE_W(SAMPLE_W)
  ) dut (
      .clk,
      .rst,
      .head_0,
      .head_1,
      .s_valid,
      .s_ready,
      .s_first(fresh_q),
      .s_last,
      .s_sample,
      .s_code,
      .s_length,
      .m_valid,
      .m_ready,
      .m_last,
      .m_word
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH(33)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_last, m_word})
  );

  // ---- codes on their way: `third` is the oldest --------------------------------------------------------------------
  logic accept, put, valid_q, valid_q2, valid_q3;
  code_t first, second, third;
  assign accept = s_valid && s_ready;
  assign put = s_ready && valid_q3;

  always_ff @(posedge clk) begin
    if (rst) begin
      {valid_q, valid_q2, valid_q3} <= '0;
      fresh_q <= 1'b1;
    end else if (s_ready) begin
      {valid_q, valid_q2, valid_q3} <= {s_valid, valid_q, valid_q2};
      if (s_valid) fresh_q <= s_last;
    end
    if (s_ready) {first, second, third} <= {fresh_q, s_last, s_length, s_code, s_sample, first, second};
  end

  // ---- what they become ---------------------------------------------------------------------------------------------
  function automatic logic [31:0] crc(input logic [31:0] start, input logic [SAMPLE_W-1:0] sample);
    crc = start;
    for (int i = SAMPLE_W - 1; i >= 0; i--) crc = {crc[30:0], 1'b0} ^ (crc[31] ^ sample[i] ? 32'h0040_0007 : 32'h0);
  endfunction

  logic [ 4:0] fill_q;  // bits of the word that is being filled
  logic [31:0] bits_q;  // they themselves, from the highest on
  logic [16:0] codes_q, codes;  // of the waveform; from 2^16 on it stays there
  logic [31:0] crc_q, crc_put;
  logic inside_q;  // a code of the waveform has been packed, and its last one has not
  logic [63:0] both;
  logic [6:0] behind;
  logic fills;
  assign behind = 7'(fill_q) + 7'(third.length);
  assign fills = behind >= 32;
  assign both = {bits_q, 32'b0} | (64'(third.code) << (7'd64 - behind));
  assign codes = codes_q[16] ? codes_q : codes_q + 17'd1;
  assign crc_put = crc(crc_q, third.sample);

  // What is due at the output: parts of one record, in their order.
  typedef enum logic [1:0] {
    IS_HEAD_0,
    IS_HEAD_1,
    IS_BODY,
    IS_CHECK
  } turn_t;
  turn_t turn_q;
  logic full_due_q, rest_due_q, ended_q, out;
  logic [31:0] full_word_q, rest_word_q, crc_due_q, expected;
  logic [16:0] count_due_q;
  logic is_count, due;
  assign out = m_valid && m_ready;
  assign is_count = turn_q == IS_BODY && !full_due_q && !rest_due_q && ended_q;

  always_comb begin
    due = 1'b1;
    expected = head_0;
    case (turn_q)
      IS_HEAD_0: due = inside_q || valid_q3;
      IS_HEAD_1: expected = head_1;
      IS_BODY: begin
        expected = full_due_q ? full_word_q : rest_word_q;
        due = full_due_q || ended_q;
      end
      default:   expected = crc_due_q;
    endcase
  end

  always_ff @(posedge clk) begin
    if (rst) begin
      {fill_q, bits_q, codes_q, inside_q} <= '0;
      crc_q <= '1;
      turn_q <= IS_HEAD_0;
      {full_due_q, rest_due_q, ended_q} <= '0;
    end else begin
      if (out) begin
        case (turn_q)
          IS_HEAD_0: turn_q <= IS_HEAD_1;
          IS_HEAD_1: turn_q <= IS_BODY;
          IS_BODY: begin
            if (full_due_q) full_due_q <= 1'b0;
            else if (rest_due_q) rest_due_q <= 1'b0;
            else turn_q <= IS_CHECK;
          end
          default: begin
            turn_q  <= IS_HEAD_0;
            ended_q <= 1'b0;
          end
        endcase
      end
      if (put) begin
        inside_q <= !third.last;
        fill_q <= third.last ? '0 : behind[4:0];
        bits_q <= third.last ? '0 : fills ? both[31:0] : both[63:32];
        codes_q <= third.last ? '0 : codes;
        crc_q <= third.last ? '1 : crc_put;
        if (fills) begin
          full_due_q  <= 1'b1;
          full_word_q <= both[63:32];
        end
        if (third.last) begin
          ended_q <= 1'b1;
          rest_due_q <= behind[4:0] != '0;
          rest_word_q <= fills ? both[31:0] : both[63:32];
          count_due_q <= codes;
          crc_due_q <= crc_put;
        end
      end
    end
  end

  // ---- waveforms inside ---------------------------------------------------------------------------------------------
  logic [ 2:0] open_q;
  logic [63:0] head_q;
  always_ff @(posedge clk) begin
    open_q <= rst ? '0 : open_q + 3'(accept && fresh_q) - 3'(out && m_last);
    head_q <= {head_0, head_1};
  end

  // ---- in time ------------------------------------------------------------------------------------------------------
  // Cycles until a last code or one that fills a word can be packed, with the head of its waveform to come or not.
  function automatic int blocked(input logic head_to_come);
    blocked = head_to_come ? 2 : 0;
    if (dut.flush_q) blocked = blocked + 3;
    else if (dut.flushed_q) blocked = blocked + 2;
    else if (dut.show_q[0]) blocked = blocked + 1;
  endfunction

  progress_formal #(
      .LIMIT(WAIT)
  ) u_code_waits (
      .clk,
      .rst,
      .waiting(started && m_ready && !s_ready),
      .to_go  (blocked(dut.begun_q))
  );

  // Cycles until the checksum of the oldest waveform that is complete.
  logic complete;
  int   to_go;
  assign complete = ended_q || (valid_q3 && third.last) || (valid_q2 && second.last) || (valid_q && first.last);
  always_comb begin
    if (ended_q) to_go = dut.flush_q ? 3 : dut.flushed_q ? 2 : dut.show_q == COUNT ? 1 : 0;
    else if (valid_q3 && third.last) to_go = blocked(dut.begun_q) + 4;
    else if (valid_q2 && second.last) to_go = blocked(dut.begun_q || second.first) + 5;
    else to_go = blocked(dut.begun_q || first.first || (valid_q2 && second.first)) + 6;
  end

  progress_formal #(
      .LIMIT(LIMIT)
  ) u_record_waits (
      .clk,
      .rst,
      .waiting(started && m_ready && complete && !(m_valid && m_last)),
      .to_go
  );

  // ---- for the induction: where everything is in the module ---------------------------------------------------------
  // Bits of a word before each code, and whether a waveform is open there.
  logic [4:0] fill_2, fill_1, fill_0, end_1, end_2, end_3;
  logic open_2, open_1, open_0, current;
  assign end_3   = behind[4:0];
  assign fill_2  = !valid_q3 ? fill_q : third.last ? '0 : end_3;
  assign end_2   = fill_2 + second.length[4:0];
  assign fill_1  = !valid_q2 ? fill_2 : second.last ? '0 : end_2;
  assign end_1   = fill_1 + first.length[4:0];
  assign fill_0  = !valid_q ? fill_1 : first.last ? '0 : end_1;
  assign open_2  = valid_q3 ? !third.last : inside_q;
  assign open_1  = valid_q2 ? !second.last : open_2;
  assign open_0  = valid_q ? !first.last : open_1;
  assign current = inside_q || valid_q3;

  // Once the third place is empty.
  logic [16:0] codes_then;
  logic [31:0] crc_then;
  assign codes_then = !valid_q3 ? codes_q : third.last ? '0 : codes;
  assign crc_then   = !valid_q3 ? crc_q : third.last ? '1 : crc_put;

  logic [3:0] fine_2, fine_3;
  assign fine_2 = -end_2[3:0];
  assign fine_3 = -end_3[3:0];

  function automatic logic proper(input code_t beat);
    proper = beat.length >= 1 && beat.length <= 32 && (64'(beat.code) >> beat.length) == '0;
  endfunction

  function automatic logic counts(input logic [16:0] found, input logic [16:0] number);
    counts = number[16] ? found[16] : found == number;
  endfunction

  always_comb begin
    codes_are_codes : assume (s_length >= 1 && s_length <= 32 && (64'(s_code) >> s_length) == '0);
    head_stands_still : assume (open_q == '0 || head_q == {head_0, head_1});
    if (started) begin
      nothing_invented : assert (!m_valid || (due && open_q != '0));
      in_order_unchanged :
      assert (!m_valid || (is_count ? counts(m_word[16:0], count_due_q) && m_word[31:17] == '0 : m_word == expected));
      last_is_the_checksum : assert (!m_valid || m_last == (turn_q == IS_CHECK));
      nothing_lost : assert (!(put && (fills || third.last)) || (!ended_q && (out || !full_due_q)));
      // For the induction.
      codes_stay_codes :
      assert ((!valid_q || proper(first)) && (!valid_q2 || proper(second)) && (!valid_q3 || proper(third)));
      places : assert ({dut.valid_q, dut.valid_q2, dut.valid_q3} == {valid_q, valid_q2, valid_q3});
      firsts :
      assert ((!valid_q3 || third.first == !inside_q) && (!valid_q2 || second.first == !open_2)
              && (!valid_q || first.first == !open_1) && fresh_q == !open_0);
      open_waveforms :
      assert (32'(open_q) == 32'(valid_q && first.first) + 32'(valid_q2 && second.first) + 32'(current) + 32'(ended_q));
      first_place :
      assert (!valid_q || ({dut.first_q, dut.last_q, dut.code_q, dut.sample_q}
                           == {first.first, first.last, first.code, first.sample}
                           && {dut.full_q, dut.end_q} == 6'(fill_1) + first.length));
      end_of_the_last : assert (!open_0 || dut.end_q == fill_0);
      second_place :
      assert (!valid_q2 || ({dut.first_q2, dut.last_q2, dut.sample_q2} == {second.first, second.last, second.sample}
                            && {dut.full_q2, dut.end_q2} == 6'(fill_2) + second.length
                            && dut.moved_q2 == (SAMPLE_W + 4)'(second.code) << fine_2[1:0]
                            && dut.coarse_q2 == fine_2[3:2]));
      third_place :
      assert (!valid_q3 || (dut.last_q3 == third.last && dut.full_q3 == fills && dut.whole_q3 == (end_3 == '0)
                            && dut.ends_high_q3 == (end_3 >= 1 && end_3 <= 16)
                            && dut.moved_q3 == (SAMPLE_W + 16)'(third.code) << fine_3));
      nothing_behind_the_bits : assert (bits_q << fill_q == '0);
      starts_empty : assert (inside_q || (fill_q == '0 && codes_q == '0 && crc_q == '1));
      bits_in_their_place : assert (dut.held_q == (dut.flush_q ? rest_word_q : bits_q));
      counted : assert (counts(dut.count_q, codes_then));
      counted_last : assert (!(valid_q3 && third.last) || counts(dut.counted_q, codes));
      checked : assert (dut.checksum_q == crc_then);
      checked_last : assert (!(valid_q3 && third.last) || dut.checked_q == crc_put);
      tail_is_kept : assert (!ended_q || (counts(dut.tail_count_q, count_due_q) && dut.tail_check_q == crc_due_q));
      known_show : assert (dut.show_q inside {3'b0, HEAD_0, HEAD_1, COUNT, CHECK});
      shows_heads :
      assert ((dut.show_q != HEAD_0 || turn_q == IS_HEAD_0) && (dut.show_q == HEAD_1) == (turn_q == IS_HEAD_1));
      shows_tail : assert ((dut.show_q != COUNT || is_count) && (dut.show_q == CHECK) == (turn_q == IS_CHECK));
      shows_words : assert (!dut.word_q || (dut.show_q == '0 && turn_q == IS_BODY));
      full_word_is_there :
      assert (full_due_q == (dut.word_q && !dut.flushed_q) && (!full_due_q || dut.payload_q == full_word_q));
      rest_is_there :
      assert (rest_due_q == (dut.flush_q ? dut.rest_q : dut.flushed_q && dut.word_q)
              && (!(rest_due_q && dut.flushed_q) || dut.payload_q == rest_word_q) && (!rest_due_q || ended_q));
      ends_once :
      assert (32'(dut.flush_q) + 32'(dut.flushed_q) + 32'(dut.show_q == COUNT || dut.show_q == CHECK) == 32'(ended_q));
      flushes_the_body : assert (!(dut.flush_q || dut.flushed_q) || turn_q == IS_BODY);
      flushes_before_the_next : assert (!dut.flush_q || (!inside_q && (dut.rest_q || rest_word_q == '0)));
      head_waits :
      assert (turn_q == IS_HEAD_0 ? !ended_q && {dut.begun_q, dut.show_q == HEAD_0} == {current && dut.show_q == '0,
                                                                                        current && dut.show_q != '0}
              : dut.begun_q == (ended_q && current));
      body_is_open : assert (turn_q == IS_HEAD_0 || ended_q || current);
    end
    cover_waits : cover (started && s_valid && !s_ready && m_ready);
    cover_full_at_first : cover (started && put && third.first && fills);
    cover_three_inside : cover (started && open_q == 3);
    cover_words_and_rest : cover (started && put && third.last && fills && end_3 != '0 && codes_q > 2);
    cover_no_rest : cover (started && out && is_count && count_due_q > 1 && !dut.rest_q);
    cover_waveforms : cover (started && out && m_last && open_q == 3);
  end
endmodule

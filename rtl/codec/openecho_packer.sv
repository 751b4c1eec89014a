// Codes end to end in 32-bit words, the first bit highest, behind two words of head and before two of tail: the number of
// samples, and the checksum.
//
// A code of up to 32 bits has at most SAMPLE_W + 1 behind its leading zeros, and those alone are moved into their place:
// by less than a half word to where the code ends, and then into one half or the other. One code a clock; a waveform's
// first codes come while the tail of the one before goes out, and wait only if they fill a word before the head is out.
module openecho_packer
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 11
) (
    input  logic                clk,
    input  logic                rst,
    input  logic [        31:0] head_0,
    input  logic [        31:0] head_1,
    input  logic                s_valid,
    output logic                s_ready,
    input  logic                s_first,
    input  logic                s_last,
    input  logic [SAMPLE_W-1:0] s_sample,
    input  logic [  SAMPLE_W:0] s_code,
    input  logic [         5:0] s_length,
    output logic                m_valid,
    input  logic                m_ready,
    output logic                m_last,
    output logic [        31:0] m_word
);
  localparam int MOVED_W = SAMPLE_W + 16;

  logic free, move;  // the output can go on; so can the codes
  assign free = !m_valid || m_ready;
  assign s_ready = move;

  // ---- where a code ends --------------------------------------------------------------------------------------------
  logic valid_q, first_q, last_q, full_q;
  logic [4:0] end_q;  // bits of a word that are taken behind the code
  logic [5:0] total;
  logic [SAMPLE_W:0] code_q;
  logic [SAMPLE_W-1:0] sample_q;

  assign total = (s_first ? 6'd0 : 6'(end_q)) + s_length;

  always_ff @(posedge clk) begin
    if (rst) valid_q <= 1'b0;
    else if (move) valid_q <= s_valid;
    if (move && s_valid) begin
      first_q <= s_first;
      last_q <= s_last;
      {full_q, end_q} <= total;
      code_q <= s_code;
      sample_q <= s_sample;
    end
  end

  // ---- moved to the end of a half word, in two steps ----------------------------------------------------------------
  logic valid_q2, first_q2, last_q2, full_q2, valid_q3, last_q3, full_q3;
  logic whole_q3, ends_high_q3;  // the code ends with a word, in its high half
  logic [4:0] end_q2;
  logic [1:0] fine;
  logic [1:0] coarse_q2;
  logic [SAMPLE_W+3:0] moved_q2;
  logic [MOVED_W-1:0] moved_q3;
  logic [SAMPLE_W-1:0] sample_q2;

  assign fine = -end_q[1:0];

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q2 <= 1'b0;
      valid_q3 <= 1'b0;
    end else if (move) begin
      valid_q2 <= valid_q;
      valid_q3 <= valid_q2;
    end
    if (move && valid_q) begin
      first_q2 <= first_q;
      last_q2 <= last_q;
      full_q2 <= full_q;
      end_q2 <= end_q;
      moved_q2 <= (SAMPLE_W + 4)'(code_q) << fine;
      coarse_q2 <= ~end_q[3:2] + 2'(fine == 0);
      sample_q2 <= sample_q;
    end
    if (move && valid_q2) begin
      last_q3 <= last_q2;
      full_q3 <= full_q2;
      whole_q3 <= end_q2 == 0;
      ends_high_q3 <= end_q2[4] ? end_q2[3:0] == 0 : end_q2[3:0] != 0;
      moved_q3 <= MOVED_W'(moved_q2) << {coarse_q2, 2'b0};
    end
  end

  // ---- what the tail will say ---------------------------------------------------------------------------------------
  logic [COUNT_W-1:0] count, count_q, counted_q;
  logic [31:0] checksum, checksum_q, checked_q;

  openecho_crc #(
      .SAMPLE_W(SAMPLE_W)
  ) u_crc (
      .s_crc(checksum_q),
      .s_sample(sample_q2),
      .m_crc(checksum)
  );
  assign count = {count_q[COUNT_W-1], {(COUNT_W - 1) {1'b0}}} | (count_q + COUNT_W'(1));

  always_ff @(posedge clk) begin
    if (rst || (move && valid_q2 && last_q2)) begin
      checksum_q <= '1;
      count_q <= '0;
    end else if (move && valid_q2) begin
      checksum_q <= checksum;
      count_q <= count;
    end
    if (move && valid_q2 && last_q2) begin
      checked_q <= checksum;
      counted_q <= count;
    end
  end

  // ---- words --------------------------------------------------------------------------------------------------------
  // What goes out next: after a waveform's last code what is left of it, its count and its checksum; then, once the next
  // waveform has begun, its head. Full words come in between where none of these is due.
  localparam logic [2:0] HEAD_0 = 3'b011, HEAD_1 = 3'b010, COUNT = 3'b101, CHECK = 3'b100;
  logic [2:0] show_q;  // which of these stands at the output, or 0
  logic flush_q, flushed_q;  // what is left behind a last code goes to the output, and is there
  logic begun_q;  // a waveform whose head is not out
  logic due;  // the next clock is for a count, a checksum or a second word of a head
  logic word_q, rest_q;  // a full word does; bits are left behind a last code
  logic old_high, old_low, put;
  logic [15:0] high, low;
  logic [31:0] payload_q, held_q, tail_check_q, tail, head;
  logic [COUNT_W-1:0] tail_count_q;

  // The half word in which the code ends, and the one before it; with the word full, that may be in the word before.
  assign high = ends_high_q3 ? moved_q3[15:0] : 16'(moved_q3 >> 16);
  assign low = ends_high_q3 ? 16'(moved_q3 >> 16) : moved_q3[15:0];
  assign old_high = full_q3 && whole_q3;
  assign old_low = full_q3 && (whole_q3 || ends_high_q3);

  assign move = free && !(valid_q3 && (full_q3 || last_q3) && (flush_q || due || begun_q));
  assign put = move && valid_q3;
  assign due = flushed_q || show_q[0];

  always_ff @(posedge clk) begin
    if (rst) begin
      flush_q <= 1'b0;
      flushed_q <= 1'b0;
      begun_q <= 1'b0;
      show_q <= '0;
      word_q <= 1'b0;
    end else if (free) begin
      flush_q   <= put && last_q3;
      flushed_q <= flush_q;
      if (move && valid_q2 && first_q2) begun_q <= 1'b1;
      else if (!flush_q && !due) begun_q <= 1'b0;
      show_q <= '0;
      if (flushed_q) show_q <= COUNT;
      else if (show_q == COUNT) show_q <= CHECK;
      else if (show_q == HEAD_0) show_q <= HEAD_1;
      else if (begun_q && !flush_q) show_q <= HEAD_0;
      word_q <= flush_q ? rest_q : put && full_q3;
    end
    if (rst || (free && flush_q && !put)) held_q <= '0;
    else if (put) held_q <= (full_q3 || flush_q ? '0 : held_q) | {high & {16{!old_high}}, low & {16{!old_low}}};
    if (put && last_q3) begin
      rest_q <= !whole_q3;
      tail_check_q <= checked_q;
      tail_count_q <= counted_q;
    end
    if (free) payload_q <= held_q | {high & {16{old_high && !flush_q}}, low & {16{old_low && !flush_q}}};
  end

  assign m_valid = word_q || show_q != 0;
  assign m_last = show_q == CHECK;
  assign tail = show_q[0] ? 32'(tail_count_q) : tail_check_q;
  assign head = show_q[0] ? head_0 : head_1;
  assign m_word = show_q[2] ? tail : (show_q[1] ? head : payload_q);
endmodule

// Records of the lossless codec (specification: model/openecho/codec/__init__.py) back into waveforms.
//
// One sample a clock inside a waveform; between two of them the first five words of a record are taken in. What is wrong
// with a record stands in the flags of its last beat: bit 0 its head, bit 1 its length, bit 2 its checksum; a bad record
// gives at least that one beat, and the next is unharmed.
module openecho_decoder
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 11
) (
    input  logic                clk,
    input  logic                rst,
    input  logic                s_valid,
    output logic                s_ready,
    input  logic                s_last,
    input  logic [        31:0] s_word,
    output logic                m_valid,
    input  logic                m_ready,
    output logic                m_last,
    output logic [SAMPLE_W-1:0] m_sample,
    output logic [         2:0] m_flags
);
  typedef enum logic [2:0] {
    HEAD_0,  // the first word of a record comes
    HEAD_1,
    FILL_0,  // the first word of the payload, or of the tail
    FILL_1,
    RUN,     // samples go out
    DRAIN,   // the rest of a record with a bad head
    REPORT   // the one beat of a record without a sample
  } state_t;

  // ---- the head -----------------------------------------------------------------------------------------------------
  state_t state_q;
  logic form_q, mode_q;  // `form_q`: the head is not that of a record
  logic [SAMPLE_W-1:0] threshold_q, even_q, odd_q;
  logic bad_0, bad_1, take_word;
  logic [15:0] upper, lower;

  assign {upper, lower} = s_word;
  assign take_word = s_valid && s_ready;
  assign bad_0 = upper[15:9] != {4'(CODEC_VERSION), 3'b0} || upper[7:4] != 4'(SAMPLE_W - 1) || upper[3:0] != 0
                 || lower >> SAMPLE_W != 0 || (upper[8] && lower != 0);
  assign bad_1 = upper >> SAMPLE_W != 0 || lower >> SAMPLE_W != 0;

  // ---- three words: what is decoded, the next, and one to know whether that is of the tail -----------------------------
  logic advance, run, tail, step, shift, next_valid_q, last_word_q;
  logic [31:0] now_q, then_q, next_q, window, unused_window;
  logic [5:0] at_q, length;  // bits of `now_q` that have been read
  logic [6:0] behind;

  assign run = state_q == RUN && next_valid_q;
  assign tail = last_word_q;  // the tail is `then_q` and `next_q`, and `now_q` the payload's last word
  assign {window, unused_window} = {now_q, tail ? 32'b0 : then_q} << at_q;
  assign behind = 7'(at_q) + 7'(length);
  assign shift = step && behind >= 32 && !tail;
  assign s_ready = state_q == RUN ? !next_valid_q || shift : state_q != REPORT;

  // ---- samples ------------------------------------------------------------------------------------------------------
  logic start, finish, wrong, over_q;
  logic [SAMPLE_W-1:0] sample;
  logic [ COUNT_W-1:0] count_q;

  assign start = state_q == FILL_0;  // (Icarus 11 takes the enum in a port's expression for a new net)

  openecho_restorer #(
      .SAMPLE_W(SAMPLE_W)
  ) u_restorer (
      .clk,
      .start,
      .take(step),
      .mode(mode_q),
      .threshold(threshold_q),
      .baseline_even(even_q),
      .baseline_odd(odd_q),
      .window,
      .sample,
      .length
  );

  // A sample is held until it is known whether another follows: its code may end in the payload's last word.
  assign finish = run && advance && tail && (over_q || 32'(count_q) >= then_q);
  assign step = run && advance && !finish;
  assign wrong = over_q || count_q == 0 || count_q[COUNT_W-1] || 32'(count_q) != then_q || at_q == 0
                 || (now_q & (32'hffffffff >> at_q)) != 0;

  always_ff @(posedge clk) begin
    if (rst) begin
      state_q <= HEAD_0;
      next_valid_q <= 1'b0;
    end else begin
      if (take_word) begin
        next_valid_q <= state_q == RUN;
        case (state_q)
          HEAD_0: begin
            state_q <= HEAD_1;
            form_q  <= bad_0;
          end
          HEAD_1: begin
            if (form_q || bad_1) state_q <= DRAIN;
            else state_q <= FILL_0;
            form_q <= form_q || bad_1;
          end
          FILL_0:  state_q <= FILL_1;
          FILL_1:  state_q <= RUN;
          default: ;
        endcase
        if (s_last && state_q != RUN) begin
          state_q <= REPORT;
          if (state_q != FILL_1) form_q <= 1'b1;
        end
      end else if (shift) begin
        next_valid_q <= 1'b0;
      end
      if (finish || (state_q == REPORT && advance)) begin
        state_q <= HEAD_0;
        next_valid_q <= 1'b0;
      end
    end
    if (take_word) begin
      case (state_q)
        HEAD_0: begin
          mode_q <= upper[8];
          threshold_q <= lower[SAMPLE_W-1:0];
        end
        HEAD_1: begin
          even_q <= upper[SAMPLE_W-1:0];
          odd_q  <= lower[SAMPLE_W-1:0];
        end
        FILL_0:  now_q <= s_word;
        FILL_1:  then_q <= s_word;
        RUN: begin
          next_q <= s_word;
          last_word_q <= s_last;
        end
        default: ;
      endcase
    end
    if (shift) begin
      now_q  <= then_q;
      then_q <= next_q;
    end
    if (start) begin
      at_q <= '0;
      count_q <= '0;
      over_q <= 1'b0;
      last_word_q <= 1'b0;
    end else if (step) begin
      at_q <= shift ? 6'(behind[4:0]) : behind[5:0];
      count_q <= count_q + COUNT_W'(!count_q[COUNT_W-1]);
      over_q <= tail && behind > 32;
    end
  end

  // ---- the checksum, and the beat -----------------------------------------------------------------------------------
  logic first_q;
  logic [SAMPLE_W-1:0] sample_q;
  logic [31:0] checksum_q, checksum;

  assign advance = !m_valid || m_ready;

  openecho_crc #(
      .SAMPLE_W(SAMPLE_W)
  ) u_crc (
      .s_crc(checksum_q | {32{first_q}}),
      .s_sample(sample_q),
      .m_crc(checksum)
  );

  always_ff @(posedge clk) begin
    if (rst) begin
      m_valid <= 1'b0;
    end else if (advance) begin
      m_valid <= (step && count_q != 0) || finish || state_q == REPORT;
    end
    if (step) begin
      first_q  <= count_q == 0;
      sample_q <= sample;
      if (count_q != 0) checksum_q <= checksum;
    end
    if (advance) begin
      m_last   <= finish || state_q == REPORT;
      m_sample <= sample_q;
      if (state_q == REPORT) m_flags <= {1'b0, !form_q, form_q};
      else m_flags <= finish ? {checksum != next_q, wrong, 1'b0} : '0;
    end
  end
endmodule

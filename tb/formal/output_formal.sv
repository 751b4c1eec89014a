// openecho_output: the record of each beat is offered with it and held with it, numbered by an independent count of
// waveforms and echoes, marked as a trailer if and only if it is one; the echo counter never wraps. Proved by
// induction.
//
// Assumed: the input keeps the stream contract, and a waveform has no more echoes than samples (inflection_formal
// proves far fewer). The fields of an echo are only moved to their words: the bench compares them.
module output_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 16,
    localparam int VALUE_W = value_width(SAMPLE_W, 0, FRAC, MAX_SAMPLES),
    localparam int WORD_W = record_word_width(SAMPLE_W, 0, FRAC, MAX_SAMPLES)
) (
    input logic                      clk,
    input logic                      rst,
    input logic                      s_valid,
    input logic                      s_last,
    input logic        [VALUE_W-1:0] s_centre,
    input logic        [VALUE_W-1:0] s_peak,
    input logic        [VALUE_W-1:0] s_width,
    input logic signed [VALUE_W-1:0] s_time,
    input logic        [VALUE_W-1:0] s_amplitude,
    input logic        [FLAGS_W-1:0] s_flags,
    input logic                      m_ready
);
  logic started, s_ready, m_valid, m_last;
  logic [RECORD_WORDS*WORD_W-1:0] m_record;
  logic [SEQUENCE_W-1:0] waveforms_q = '0;
  int echoes_q = 0;

  openecho_output #(
      .SAMPLE_W(SAMPLE_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_ready,
      .s_last,
      .s_centre,
      .s_peak,
      .s_width,
      .s_time,
      .s_amplitude,
      .s_flags,
      .m_valid,
      .m_ready,
      .m_last,
      .m_record
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH  (1 + 5 * VALUE_W + FLAGS_W),
      .ASSUMED(1'b1)
  ) u_input (
      .clk,
      .rst,
      .valid  (s_valid),
      .ready  (s_ready),
      .payload({s_last, s_centre, s_peak, s_width, s_time, s_amplitude, s_flags})
  );

  stream_formal #(
      .WIDTH(1 + RECORD_WORDS * WORD_W)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload({m_last, m_record})
  );

  // Counted at the output, where the module counts at its input.
  always_ff @(posedge clk) begin
    if (rst) begin
      waveforms_q <= '0;
      echoes_q <= 0;
    end else if (m_valid && m_ready) begin
      waveforms_q <= waveforms_q + SEQUENCE_W'(m_last);
      echoes_q <= m_last ? 0 : echoes_q + 1;
    end
  end

  always_comb begin
    echoes_of_a_waveform : assume (!(s_valid && !s_last) || echoes_q < MAX_SAMPLES);
    if (started) begin
      a_beat_in_is_a_beat_out : assert ((s_valid && s_ready) == (m_valid && m_ready));
      last_is_kept : assert (m_last == s_last);
      trailer_bit_is_last : assert (m_record[WORD_HEADER*WORD_W+HEADER_TRAILER] == m_last);
      waveforms_are_counted : assert (m_record[WORD_SEQUENCE*WORD_W+:SEQUENCE_W] == waveforms_q);
      echoes_are_counted : assert (32'(m_record[WORD_NUMBER*WORD_W+:NUMBER_W]) == echoes_q);
      echo_count_never_wraps : assert (echoes_q >= 0 && echoes_q <= MAX_SAMPLES && MAX_SAMPLES < 2 ** NUMBER_W);
    end
    cover_echoes_then_trailer : cover (started && m_valid && m_ready && m_last && echoes_q == 2);
    cover_second_trailer : cover (started && m_valid && m_ready && m_last && waveforms_q == 1 && echoes_q == 1);
  end
endmodule

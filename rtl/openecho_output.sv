// Numbers waveforms and echoes and lays each echo, and each waveform's trailer, out as a record of RECORD_WORDS words
// (openecho_pkg states the layout). Packing and two counters: latency 0 cycles, one record a clock.
module openecho_output
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    localparam int VALUE_W = value_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES),
    localparam int WORD_W = record_word_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                                  clk,
    input  logic                                  rst,
    input  logic                                  s_valid,
    output logic                                  s_ready,
    input  logic                                  s_last,
    input  logic        [            VALUE_W-1:0] s_centre,
    input  logic        [            VALUE_W-1:0] s_peak,
    input  logic        [            VALUE_W-1:0] s_width,
    input  logic signed [            VALUE_W-1:0] s_time,
    input  logic        [            VALUE_W-1:0] s_amplitude,
    input  logic        [            FLAGS_W-1:0] s_flags,
    output logic                                  m_valid,
    input  logic                                  m_ready,
    output logic                                  m_last,
    output logic        [RECORD_WORDS*WORD_W-1:0] m_record
);
  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) u_check ();

  logic [SEQUENCE_W-1:0] sequence_q;
  logic [  NUMBER_W-1:0] number_q;

  assign m_valid = s_valid;
  assign s_ready = m_ready;
  assign m_last  = s_last;

  logic accept;
  assign accept = s_valid && s_ready;

  always_ff @(posedge clk) begin
    if (rst) sequence_q <= '0;
    else if (accept && s_last) sequence_q <= sequence_q + 1'b1;
    if (rst || (accept && s_last)) number_q <= '0;
    else if (accept) number_q <= number_q + 1'b1;
  end

  always_comb begin
    m_record = '0;
    m_record[WORD_HEADER*WORD_W+:FLAGS_W] = s_flags;
    m_record[WORD_HEADER*WORD_W+HEADER_TRAILER] = s_last;
    m_record[WORD_SEQUENCE*WORD_W+:SEQUENCE_W] = sequence_q;
    m_record[WORD_NUMBER*WORD_W+:NUMBER_W] = number_q;
    m_record[WORD_CENTRE*WORD_W+:VALUE_W] = s_centre;
    m_record[WORD_PEAK*WORD_W+:VALUE_W] = s_peak;
    m_record[WORD_WIDTH*WORD_W+:VALUE_W] = s_width;
    m_record[WORD_TIME*WORD_W+:WORD_W] = WORD_W'(s_time);
    m_record[WORD_AMPLITUDE*WORD_W+:VALUE_W] = s_amplitude;
  end
endmodule

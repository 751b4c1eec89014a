// Waveforms into records of the lossless codec (specification: model/openecho/codec/__init__.py), of any length up to
// 65,535 samples; the count of a longer waveform has bit 16 set. `m_last` comes with a record's last word.
//
// One sample a clock, waveforms back to back. Four words frame a record, and only where the first samples of a waveform,
// right behind another, fill a word before these are out does the input wait, for up to five clocks. Latency 9 cycles from
// the sample that fills a word. The settings must stand still from a clock before a waveform until its record is out.
module openecho_encoder
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 11
) (
    input  logic                clk,
    input  logic                rst,
    input  logic                mode,           // 0 threshold, 1 prediction
    input  logic [SAMPLE_W-1:0] threshold,
    input  logic [SAMPLE_W-1:0] baseline_even,
    input  logic [SAMPLE_W-1:0] baseline_odd,
    input  logic                s_valid,
    output logic                s_ready,
    input  logic                s_last,
    input  logic [SAMPLE_W-1:0] s_sample,
    output logic                m_valid,
    input  logic                m_ready,
    output logic                m_last,
    output logic [        31:0] m_word
);
  logic predicted_valid, predicted_first, predicted_last, coded_valid, coded_first, coded_last;
  logic [SAMPLE_W-1:0] predicted_sample, predicted_value, predicted_below, coded_sample;
  logic [SAMPLE_W:0] code;
  logic [5:0] length;

  openecho_predictor #(
      .SAMPLE_W(SAMPLE_W)
  ) u_predictor (
      .clk,
      .rst,
      .advance (s_ready),
      .mode,
      .threshold,
      .baseline_even,
      .baseline_odd,
      .s_valid,
      .s_last,
      .s_sample,
      .m_valid (predicted_valid),
      .m_first (predicted_first),
      .m_last  (predicted_last),
      .m_sample(predicted_sample),
      .m_value (predicted_value),
      .m_below (predicted_below)
  );

  openecho_coder #(
      .SAMPLE_W(SAMPLE_W)
  ) u_coder (
      .clk,
      .rst,
      .advance (s_ready),
      .mode,
      .s_valid (predicted_valid),
      .s_first (predicted_first),
      .s_last  (predicted_last),
      .s_sample(predicted_sample),
      .s_value (predicted_value),
      .s_below (predicted_below),
      .m_valid (coded_valid),
      .m_first (coded_first),
      .m_last  (coded_last),
      .m_sample(coded_sample),
      .m_code  (code),
      .m_length(length)
  );

  openecho_packer #(
      .SAMPLE_W(SAMPLE_W)
  ) u_packer (
      .clk,
      .rst,
      .head_0  ({4'(CODEC_VERSION), 3'b0, mode, 4'(SAMPLE_W - 1), 4'b0, 16'(threshold)}),
      .head_1  ({16'(baseline_even), 16'(baseline_odd)}),
      .s_valid (coded_valid),
      .s_ready,
      .s_first (coded_first),
      .s_last  (coded_last),
      .s_sample(coded_sample),
      .s_code  (code),
      .s_length(length),
      .m_valid,
      .m_ready,
      .m_last,
      .m_word
  );
endmodule

// Reads samples as a stream (AXI4-Stream handshake), numbers them within their waveform and measures the noise.
//
// A waveform ends with `s_last`. One that goes on past MAX_SAMPLES is cut there: its last forwarded beat carries
// `m_overlong`, and the rest is swallowed up to and including `s_last`, so that the next waveform is unharmed.
//
// Latency 1 cycle, one sample a clock. The noise statistics leave on a stream of their own, one beat a waveform, see
// openecho_noise. The raw waveform needs no memory: the filter's own delay line keeps what the peak search looks at.
module openecho_reader
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int MAX_SAMPLES = 4096,
    parameter bit DSP = 1'b1  // see openecho_noise
) (
    input  logic                           clk,
    input  logic                           rst,
    input  logic                           s_valid,
    output logic                           s_ready,
    input  logic                           s_last,
    input  logic [           SAMPLE_W-1:0] s_sample,
    output logic                           m_valid,
    input  logic                           m_ready,
    output logic                           m_last,
    output logic [           SAMPLE_W-1:0] m_sample,
    output logic [$clog2(MAX_SAMPLES)-1:0] m_index,
    output logic                           m_overlong,
    output logic                           noise_valid,
    input  logic                           noise_ready,
    output logic [  SAMPLE_W+AMP_FRAC-1:0] noise_mean,
    output logic [  SAMPLE_W+AMP_FRAC-1:0] noise_deviation,
    output logic                           noise_none
);
  localparam int INDEX_W = $clog2(MAX_SAMPLES);

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) u_check ();

  logic skipping_q;  // past MAX_SAMPLES, until the waveform's end
  logic [INDEX_W-1:0] index_q;
  logic m_free, noise_s_ready, accept, at_limit, last;

  assign m_free = !m_valid || m_ready;
  assign s_ready = skipping_q || (m_free && noise_s_ready);
  assign accept = s_valid && s_ready && !skipping_q;
  assign at_limit = index_q == INDEX_W'(MAX_SAMPLES - 1);
  assign last = s_last || at_limit;

  always_ff @(posedge clk) begin
    if (rst) begin
      skipping_q <= 1'b0;
      index_q <= '0;
      m_valid <= 1'b0;
    end else begin
      if (skipping_q) skipping_q <= !(s_valid && s_last);
      else skipping_q <= accept && at_limit && !s_last;
      if (accept) index_q <= last ? '0 : index_q + 1'b1;
      if (m_free) m_valid <= accept;
    end
    if (m_free) begin
      m_last <= last;
      m_sample <= s_sample;
      m_index <= index_q;
      m_overlong <= at_limit && !s_last;
    end
  end

  openecho_noise #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .DSP(DSP)
  ) u_noise (
      .clk,
      .rst,
      .s_valid(s_valid && m_free && !skipping_q),
      .s_ready(noise_s_ready),
      .s_last(last),
      .s_sample(s_sample),
      .s_index(index_q),
      .m_valid(noise_valid),
      .m_ready(noise_ready),
      .m_mean(noise_mean),
      .m_deviation(noise_deviation),
      .m_none(noise_none)
  );
endmodule

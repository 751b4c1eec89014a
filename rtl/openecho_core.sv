// Samples in, echoes out: reader, filter, second_difference, inflection, parameters and output in a row.
//
// One sample a clock, waveforms back to back, with the sink always ready. An echo takes 73 cycles in fixed point at FRAC 16
// (openecho_inflection), a component that does not stand out of the noise 5; 10 components that come faster wait in the
// queue of openecho_detect. Nothing is lost: a queue that fills up stops the input, and only the input. What has been
// taken in goes on to the queue without a stall, so that no path leads from the output back through all modules.
// The settings n, min_interval, min_amplitude and k must not change while a waveform is in the core.
module openecho_core
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    parameter bit DSP = 1'b1,  // of openecho_noise
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int WORD_W = record_word_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                           clk,
    input  logic                           rst,
    input  logic [            RATIO_W-1:0] n,              // Eq (7), 4.4 bits; 2 gives the sigma of the filtered echo
    input  logic [            INDEX_W-1:0] min_interval,   // bins between the inflections; longer ones are kept
    input  logic [           SAMPLE_W-1:0] min_amplitude,  // counts
    input  logic [            RATIO_W-1:0] k,              // threshold in noise deviations, 4.4 bits
    input  logic                           s_valid,
    output logic                           s_ready,
    input  logic                           s_last,
    input  logic [           SAMPLE_W-1:0] s_sample,
    output logic                           m_valid,
    input  logic                           m_ready,
    output logic                           m_last,
    output logic [RECORD_WORDS*WORD_W-1:0] m_record
);
  localparam int AMP_W = SAMPLE_W + AMP_FRAC;
  localparam int POSITION_W = position_width(EXP_W, FRAC, MAX_SAMPLES);
  localparam int VALUE_W = value_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES);
  localparam int SUM_W = response_width(TAPS, TAP_COUNT, 0, SAMPLE_W);
  localparam int RISE_W = response_width(TAPS, TAP_COUNT, 1, SAMPLE_W);
  localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, EXP_W, FRAC);
  localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, EXP_W, FRAC);

  // Beats that are between the reader and the queue, and so still come when there is no more room: filter, difference,
  // and in floating point those that its conversion can hold.
  localparam int IN_FLIGHT = EXP_W > 0 ? 16 : 7;
  logic room, reader_ready, unused_sum_ready;
  assign s_ready = reader_ready && room;

  logic sample_valid, sample_ready, sample_last, sample_overlong;
  logic [SAMPLE_W-1:0] sample;
  logic [ INDEX_W-1:0] sample_index;

  logic noise_valid, noise_ready, noise_none, figures_valid, figures_ready, figures_none;
  logic [AMP_W-1:0] noise_mean, noise_deviation, figures_mean, figures_deviation;

  logic sum_valid, sum_last, sum_overlong;
  logic signed [SUM_W-1:0] unused_sum;
  logic signed [RISE_W-1:0] rise;
  logic [SAMPLE_W-1:0] sum_raw;
  logic [INDEX_W-1:0] sum_index;

  logic second_valid, second_last, second_overlong;
  logic signed [FIRST_W-1:0] first;
  logic signed [SECOND_W-1:0] second;
  logic [SAMPLE_W-1:0] second_raw;
  logic [INDEX_W-1:0] unused_index;

  logic component_valid, component_ready, component_last;
  logic [POSITION_W-1:0] component_left, component_right, component_peak;
  logic [AMP_W-1:0] component_amplitude, component_mean;
  logic [  INDEX_W:0] component_length;
  logic [FLAGS_W-1:0] component_flags;

  logic echo_valid, echo_ready, echo_last;
  logic [VALUE_W-1:0] echo_centre, echo_peak, echo_width, echo_amplitude;
  logic signed [VALUE_W-1:0] echo_time;
  logic [FLAGS_W-1:0] echo_flags;

  openecho_reader #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .DSP(DSP)
  ) u_reader (
      .clk,
      .rst,
      .s_valid(s_valid && room),
      .s_ready(reader_ready),
      .s_last,
      .s_sample,
      .m_valid(sample_valid),
      .m_ready(sample_ready),
      .m_last(sample_last),
      .m_sample(sample),
      .m_index(sample_index),
      .m_overlong(sample_overlong),
      .noise_valid,
      .noise_ready,
      .noise_mean,
      .noise_deviation,
      .noise_none
  );

  openecho_filter #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS)
  ) u_filter (
      .clk,
      .rst,
      .s_valid(sample_valid),
      .s_ready(sample_ready),
      .s_last(sample_last),
      .s_sample(sample),
      .s_index(sample_index),
      .s_overlong(sample_overlong),
      .m_valid(sum_valid),
      .m_ready(1'b1),
      .m_last(sum_last),
      .m_sum(unused_sum),
      .m_first(rise),
      .m_raw(sum_raw),
      .m_index(sum_index),
      .m_overlong(sum_overlong)
  );

  openecho_second_difference #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS)
  ) u_second_difference (
      .clk,
      .rst,
      .s_valid(sum_valid),
      .s_ready(unused_sum_ready),
      .s_last(sum_last),
      .s_first(rise),
      .s_raw(sum_raw),
      .s_index(sum_index),
      .s_overlong(sum_overlong),
      .m_valid(second_valid),
      .m_ready(1'b1),
      .m_last(second_last),
      .m_first(first),
      .m_second(second),
      .m_raw(second_raw),
      .m_index(unused_index),
      .m_overlong(second_overlong)
  );

  // An echo takes long in floating point: the noise figures of waveforms that have come meanwhile wait here.
  if (EXP_W == 0) begin : g_figures
    assign {figures_valid, figures_mean, figures_deviation, figures_none} = {
      noise_valid, noise_mean, noise_deviation, noise_none
    };
    assign noise_ready = figures_ready;
  end else begin : g_figures
    logic [4:0] unused_figures;
    openecho_fifo #(
        .WIDTH(2 * AMP_W + 1),
        .DEPTH(16)
    ) u_figures (
        .clk,
        .rst,
        .s_valid(noise_valid),
        .s_ready(noise_ready),
        .s_data ({noise_mean, noise_deviation, noise_none}),
        .m_valid(figures_valid),
        .m_ready(figures_ready),
        .m_data ({figures_mean, figures_deviation, figures_none}),
        .level  (unused_figures)
    );
  end

  openecho_inflection #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS),
      .IN_FLIGHT(IN_FLIGHT)
  ) u_inflection (
      .clk,
      .rst,
      .min_interval,
      .min_amplitude,
      .k,
      .noise_valid(figures_valid),
      .noise_ready(figures_ready),
      .noise_mean(figures_mean),
      .noise_deviation(figures_deviation),
      .noise_none(figures_none),
      .s_valid(second_valid),
      .s_ready(room),
      .s_last(second_last),
      .s_first(first),
      .s_second(second),
      .s_raw(second_raw),
      .s_overlong(second_overlong),
      .m_valid(component_valid),
      .m_ready(component_ready),
      .m_last(component_last),
      .m_left(component_left),
      .m_right(component_right),
      .m_peak(component_peak),
      .m_amplitude(component_amplitude),
      .m_length(component_length),
      .m_mean(component_mean),
      .m_flags(component_flags)
  );

  openecho_parameters #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) u_parameters (
      .clk,
      .rst,
      .n,
      .s_valid(component_valid),
      .s_ready(component_ready),
      .s_last(component_last),
      .s_left(component_left),
      .s_right(component_right),
      .s_peak(component_peak),
      .s_amplitude(component_amplitude),
      .s_length(component_length),
      .s_mean(component_mean),
      .s_flags(component_flags),
      .m_valid(echo_valid),
      .m_ready(echo_ready),
      .m_last(echo_last),
      .m_centre(echo_centre),
      .m_peak(echo_peak),
      .m_width(echo_width),
      .m_time(echo_time),
      .m_amplitude(echo_amplitude),
      .m_flags(echo_flags)
  );

  openecho_output #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) u_output (
      .clk,
      .rst,
      .s_valid(echo_valid),
      .s_ready(echo_ready),
      .s_last(echo_last),
      .s_centre(echo_centre),
      .s_peak(echo_peak),
      .s_width(echo_width),
      .s_time(echo_time),
      .s_amplitude(echo_amplitude),
      .s_flags(echo_flags),
      .m_valid,
      .m_ready,
      .m_last,
      .m_record
  );
endmodule

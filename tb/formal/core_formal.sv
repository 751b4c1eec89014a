// openecho_core: each waveform in is exactly one trailer out, in order, numbered from reset, with its own length, cut
// mark and number of echoes; an offered record stays until it is taken; nothing comes out that nothing went in for.
//
// GATE 0, in bounded time, from a single reset, with the settings held as the core demands. Waveforms are too short for
// noise figures, which reader_formal and noise_formal have. Cut loose are the differences, so that the sign machine
// sees any signs, also those of no waveform; the verdict of the threshold and when it is there; and how long
// interpolations and divisions take and what comes of them. What holds for these holds for the true ones, and the
// control sees nothing else of the data. Over all time, modules hand one another nothing but streams, of which each has
// its own proof.
//
// GATE 1, by induction, with `room` cut loose: whatever it does, no beat comes to openecho_inflection later than
// IN_FLIGHT cycles after it has fallen, which is what detect_formal assumes to prove that its queue does not overflow;
// and what runs without a stall is never asked for one.
//
// EASY 1 narrows the inputs to a first waveform with one echo, so that its cover is found sooner.
module core_formal
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 8,
    parameter int TAP_COUNT = 4,
    parameter logic [TAPS_W-1:0] TAPS = {{(TAPS_W - 2 * TAP_W) {1'b0}}, 16'd2, 16'd1},
    parameter bit EASY = 1'b0,
    parameter bit GATE = 1'b0,
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int WORD_W = record_word_width(SAMPLE_W, 0, FRAC, MAX_SAMPLES)
) (
    input logic                clk,
    input logic                rst,
    input logic                mark,
    input logic                s_valid,
    input logic                s_last,
    input logic [SAMPLE_W-1:0] s_sample,
    input logic                m_ready
);
  localparam int WAVEFORMS = 40;  // more than any bounded proof lets in
  localparam int TRAILER_W = 1 + INDEX_W + 1 + 8;

  logic started, s_ready, m_valid, m_last;
  logic [RECORD_WORDS*WORD_W-1:0] m_record;
  logic [RATIO_W-1:0] n_q, k_q;
  logic [ INDEX_W-1:0] min_interval_q;
  logic [SAMPLE_W-1:0] min_amplitude_q;

  openecho_core #(
      .SAMPLE_W(SAMPLE_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS)
  ) dut (
      .clk,
      .rst,
      .n(n_q),
      .min_interval(min_interval_q),
      .min_amplitude(min_amplitude_q),
      .k(k_q),
      .s_valid,
      .s_ready,
      .s_last,
      .s_sample,
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
      .WIDTH  (1 + SAMPLE_W),
      .ASSUMED(1'b1)
  ) u_input (
      .clk,
      .rst,
      .valid  (s_valid),
      .ready  (s_ready),
      .payload({s_last, s_sample})
  );

  logic [FLAGS_W-1:0] flags;
  logic [SEQUENCE_W-1:0] number;
  logic [NUMBER_W-1:0] echo_number;
  logic [INDEX_W:0] length;
  assign flags = m_record[WORD_HEADER*WORD_W+:FLAGS_W];
  assign number = m_record[WORD_SEQUENCE*WORD_W+:SEQUENCE_W];
  assign echo_number = m_record[WORD_NUMBER*WORD_W+:NUMBER_W];
  assign length = m_record[WORD_CENTRE*WORD_W+:INDEX_W+1];

  logic accept, leave, ends;
  logic [INDEX_W:0] position_q = '0;  // samples of the waveform so far; MAX_SAMPLES: cut
  logic [7:0] waveforms_in_q = '0, waveforms_out_q = '0, echoes_q = '0;
  logic too_long;
  logic [INDEX_W:0] length_in;
  assign accept = s_valid && s_ready;
  assign leave = m_valid && m_ready;
  // A waveform ends for the core with its last sample, or where it is cut.
  assign too_long = 32'(position_q) == MAX_SAMPLES - 1 && !s_last;
  assign ends = accept && 32'(position_q) < MAX_SAMPLES && (s_last || too_long);
  assign length_in = position_q + 1'b1;

  always_ff @(posedge clk) begin
    n_q <= n_q;
    k_q <= k_q;
    min_interval_q <= min_interval_q;
    min_amplitude_q <= min_amplitude_q;
    if (rst) begin
      position_q <= '0;
      waveforms_in_q <= '0;
      waveforms_out_q <= '0;
      echoes_q <= '0;
    end else begin
      if (accept) position_q <= s_last ? '0 : 32'(position_q) < MAX_SAMPLES ? position_q + 1'b1 : position_q;
      waveforms_in_q  <= waveforms_in_q + 8'(ends);
      waveforms_out_q <= waveforms_out_q + 8'(leave && m_last);
      if (leave) echoes_q <= m_last ? '0 : echoes_q + 1'b1;
    end
  end

  if (GATE) begin : g_gate
    localparam int BEATS = 7;  // IN_FLIGHT of the module
    logic [7:0] low_q;  // cycles in which there has been no room, without this one
    always_ff @(posedge clk) begin
      if (rst) low_q <= 8'(BEATS);
      else if (dut.room) low_q <= '0;
      else if (32'(low_q) < BEATS) low_q <= low_q + 1'b1;
    end
    always_comb begin
      if (started) begin
        as_many_as_the_module_says : assert (dut.IN_FLIGHT == BEATS);
        beats_stop_in_time : assert (!dut.second_valid || dut.room || 32'(low_q) < BEATS);
        no_stall_on_the_way : assert (dut.unused_sum_ready);
        low_in_range : assert (32'(low_q) <= BEATS);
      end
      cover_latest : cover (started && dut.second_valid && !dut.room && 32'(low_q) == BEATS - 1);
    end
  end else begin : g_waveforms
    stream_formal #(
        .WIDTH(1 + SEQUENCE_W + NUMBER_W)
    ) u_output (
        .clk,
        .rst,
        .valid  (started && m_valid),
        .ready  (m_ready),
        .payload({m_last, number, echo_number})
    );

    int waveforms, unused_ahead;
    logic unused_marked;
    logic [TRAILER_W-1:0] unused_trailer;
    order_formal #(
        .WIDTH(TRAILER_W),
        .CAPACITY(WAVEFORMS)
    ) u_waveforms (
        .clk,
        .rst,
        .mark,
        .in(ends),
        .in_payload({too_long, length_in, waveforms_in_q}),
        .out_valid(started && m_valid && m_last),
        .out(leave && m_last),
        .out_payload({flags[FLAG_TOO_LONG], length, 8'(number)}),
        .count(waveforms),
        .marked(unused_marked),
        .ahead(unused_ahead),
        .content(unused_trailer)
    );

    logic stalled_q = 1'b0;  // has been
    always_ff @(posedge clk) stalled_q <= stalled_q || (m_valid && !m_ready);

    always_comb begin
      no_reset_again : assume (!started || !rst);
      if (EASY) begin
        no_gaps : assume (s_valid);
        an_echo_first : assume (waveforms_in_q != '0 || s_last == (32'(position_q) == MAX_SAMPLES - 1));
        signs_of_an_echo : assume ((dut.second > 0) == (32'(dut.unused_index) == MAX_SAMPLES - 1));
        one_peak : assume ((dut.first > 0) == (32'(dut.unused_index) < MAX_SAMPLES - 2));
        everything_kept : assume (min_interval_q == '0 && dut.u_inflection.kept && dut.u_inflection.armed);
        at_once :
        assume (dut.u_inflection.crossing_taken && dut.u_inflection.position_valid && dut.u_parameters.solved);
        stalls_once : assume (m_ready || !stalled_q);
      end
      if (started) begin
        records_are_numbered : assert (!m_valid || 8'(number) == waveforms_out_q);
        echoes_are_numbered : assert (!m_valid || 8'(echo_number) == echoes_q);
        trailer_bit_is_last : assert (!m_valid || m_record[WORD_HEADER*WORD_W+HEADER_TRAILER] == m_last);
        no_echo_before_its_waveform : assert (!m_valid || m_last || waveforms != 0 || position_q != '0);
        queue_does_not_overflow :
        assert (!(dut.u_inflection.u_detect.component_q || dut.u_inflection.u_detect.finish_q2)
                || dut.u_inflection.u_detect.unused_entry_ready);
      end
      cover_trailer_behind_echo : cover (started && leave && m_last && echoes_q == 1);
    end
  end
endmodule

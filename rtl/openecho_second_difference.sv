// second[i] = first[i] - first[i-1] = sum[i] - 2 sum[i-1] + sum[i-2], exact, with zeros before the waveform (Zhou 2022,
// Eq (2)), from the first differences that the filter's sum grows by, which it passes along. Later modules look at
// `second` from sample TAP_COUNT + 1 on, where the window is full.
//
// In floating point both then become words, times 2^-11 (the scale of Eq (11), which the filter leaves out) in the same
// rounding, so that no format overflows on the way. 2^-11 is a normal number: none becomes zero.
//
// Latency 1 cycle, in floating point 1 and those of openecho_float_from_int; one sample a clock. The integers have as
// many bits as any response of the differenced taps needs, for smooth taps fewer than the sum has: differences are taken
// modulo that many bits.
module openecho_second_difference
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    localparam int FIRST_INT_W = response_width(TAPS, TAP_COUNT, 1, SAMPLE_W),
    localparam int FIRST_W = difference_width(TAPS, TAP_COUNT, 1, SAMPLE_W, EXP_W, FRAC),
    localparam int SECOND_W = difference_width(TAPS, TAP_COUNT, 2, SAMPLE_W, EXP_W, FRAC),
    localparam int INDEX_W = $clog2(MAX_SAMPLES)
) (
    input  logic                          clk,
    input  logic                          rst,
    input  logic                          s_valid,
    output logic                          s_ready,
    input  logic                          s_last,
    input  logic signed [FIRST_INT_W-1:0] s_first,
    input  logic        [   SAMPLE_W-1:0] s_raw,
    input  logic        [    INDEX_W-1:0] s_index,
    input  logic                          s_overlong,
    output logic                          m_valid,
    input  logic                          m_ready,
    output logic                          m_last,
    output logic signed [    FIRST_W-1:0] m_first,
    output logic signed [   SECOND_W-1:0] m_second,
    output logic        [   SAMPLE_W-1:0] m_raw,
    output logic        [    INDEX_W-1:0] m_index,
    output logic                          m_overlong
);
  localparam int SECOND_INT_W = response_width(TAPS, TAP_COUNT, 2, SAMPLE_W);
  localparam int INT_W = FIRST_INT_W > SECOND_INT_W ? FIRST_INT_W : SECOND_INT_W;

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .DIFFERENCE_W(INT_W)
  ) u_check ();

  // ---- exact differences --------------------------------------------------------------------------------------------
  logic advance;
  assign s_ready = advance;

  logic fresh_q;  // the next beat is the first of its waveform
  logic valid_q, last_q, overlong_q;
  logic [SAMPLE_W-1:0] raw_q;
  logic [INDEX_W-1:0] index_q;
  logic signed [FIRST_INT_W-1:0] first_q;  // of the last beat that came, and so of the one before
  logic signed [SECOND_INT_W-1:0] second_q;

  always_ff @(posedge clk) begin
    if (rst) begin
      valid_q <= 1'b0;
      fresh_q <= 1'b1;
    end else if (advance) begin
      valid_q <= s_valid;
      if (s_valid) fresh_q <= s_last;
    end
    if (advance && s_valid) begin
      last_q <= s_last;
      raw_q <= s_raw;
      index_q <= s_index;
      overlong_q <= s_overlong;
      first_q <= s_first;
      second_q <= SECOND_INT_W'(s_first) - (fresh_q ? SECOND_INT_W'(0) : SECOND_INT_W'(first_q));
    end
  end

  if (EXP_W == 0) begin : g_fixed
    assign advance = !valid_q || m_ready;
    assign m_valid = valid_q;
    assign m_last = last_q;
    assign m_first = first_q;
    assign m_second = second_q;
    assign m_raw = raw_q;
    assign m_index = index_q;
    assign m_overlong = overlong_q;
  end else begin : g_float
    // ---- words; what belongs to them waits in a queue beside ----------------------------------------------------------
    localparam int BESIDE_W = 2 + SAMPLE_W + INDEX_W;
    localparam int BESIDE_DEPTH = 16;  // more beats than a conversion has stages
    logic push, pop, first_ready, second_ready, beside_ready, first_valid, second_valid, beside_valid;
    logic [4:0] unused_first_flags, unused_second_flags;
    logic [$clog2(BESIDE_DEPTH):0] unused_level;

    assign advance = !valid_q || (first_ready && second_ready && beside_ready);
    assign push = valid_q && advance;
    assign m_valid = first_valid && second_valid && beside_valid;
    assign pop = m_valid && m_ready;

    openecho_float_from_int #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC),
        .INT_W (INT_W),
        .SCALE (-TAP_FRAC)
    ) u_first (
        .clk,
        .rst,
        .s_valid (push),
        .s_ready (first_ready),
        .s_value (INT_W'(first_q)),
        .m_valid (first_valid),
        .m_ready (pop),
        .m_result(m_first),
        .m_flags (unused_first_flags)
    );

    openecho_float_from_int #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC),
        .INT_W (INT_W),
        .SCALE (-TAP_FRAC)
    ) u_second (
        .clk,
        .rst,
        .s_valid (push),
        .s_ready (second_ready),
        .s_value (INT_W'(second_q)),
        .m_valid (second_valid),
        .m_ready (pop),
        .m_result(m_second),
        .m_flags (unused_second_flags)
    );

    openecho_fifo #(
        .WIDTH(BESIDE_W),
        .DEPTH(BESIDE_DEPTH)
    ) u_beside (
        .clk,
        .rst,
        .s_valid(push),
        .s_ready(beside_ready),
        .s_data ({last_q, overlong_q, raw_q, index_q}),
        .m_valid(beside_valid),
        .m_ready(pop),
        .m_data ({m_last, m_overlong, m_raw, m_index}),
        .level  (unused_level)
    );
  end
endmodule

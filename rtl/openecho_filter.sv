// sum[i] = sum over k of tap[k] * sample[i-k], exact, with zeros before the waveform (Zhou 2022, Eqs (1), (10), (11)).
// The paper's division by 2^11 is left out: a scale moves no zero crossing.
//
// The taps are differenced twice and the sum is integrated twice: for a smooth impulse response the differenced taps
// are tiny ({43, -31, 2, 1, 0, 0, -2, ...} for the paper's), which saves about half of the adders of the taps
// themselves and needs no multiplier. Integers do not drift, and both integrators start from zero in each waveform.
// The transposed form keeps one adder between registers for any number of taps.
//
// Each beat also carries the raw sample that the peak search wants beside it: the one at the centre of the second
// difference of this beat's window (half a bin before it for an even number of taps).
//
// Latency 4 cycles, one sample a clock. The width of `m_sum` holds any response: no overflow, no rounding.
module openecho_filter
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    localparam int SUM_W = response_width(TAPS, TAP_COUNT, 0, SAMPLE_W),
    localparam int INDEX_W = $clog2(MAX_SAMPLES)
) (
    input  logic                       clk,
    input  logic                       rst,
    input  logic                       s_valid,
    output logic                       s_ready,
    input  logic                       s_last,
    input  logic        [SAMPLE_W-1:0] s_sample,
    input  logic        [ INDEX_W-1:0] s_index,
    input  logic                       s_overlong,
    output logic                       m_valid,
    input  logic                       m_ready,
    output logic                       m_last,
    output logic signed [   SUM_W-1:0] m_sum,
    output logic        [SAMPLE_W-1:0] m_raw,
    output logic        [ INDEX_W-1:0] m_index,
    output logic                       m_overlong
);
  localparam int FIRST_W = response_width(TAPS, TAP_COUNT, 1, SAMPLE_W);
  localparam int SECOND_W = response_width(TAPS, TAP_COUNT, 2, SAMPLE_W);
  localparam int COUNT = TAP_COUNT + 2;  // taps after differencing twice, symmetric again
  localparam int HALF = (COUNT + 1) / 2;
  localparam int RAW_DELAY = (TAP_COUNT + 2) / 2;
  localparam int STAGES = 4;

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT)
  ) u_check ();

  logic advance;
  assign advance = !m_valid || m_ready;
  assign s_ready = advance;

  // ---- what travels beside the arithmetic; [0] has just been accepted -----------------------------------------------
  logic [STAGES-1:0] valid_q, last_q, overlong_q;
  logic [STAGES-1:0][INDEX_W-1:0] index_q;
  logic [STAGES-1:0][SAMPLE_W-1:0] raw_q;
  logic [RAW_DELAY-1:0][SAMPLE_W-1:0] history_q;

  always_ff @(posedge clk) begin
    if (rst) valid_q <= '0;
    else if (advance) valid_q <= {valid_q[STAGES-2:0], s_valid};
    if (advance) begin
      last_q <= {last_q[STAGES-2:0], s_last};
      overlong_q <= {overlong_q[STAGES-2:0], s_overlong};
      index_q <= {index_q[STAGES-2:0], s_index};
      raw_q <= {raw_q[STAGES-2:0], history_q[RAW_DELAY-1]};
      if (s_valid) history_q <= {history_q[RAW_DELAY-2:0], s_sample};
    end
  end

  // ---- products, then the transposed chain --------------------------------------------------------------------------
  logic signed [SECOND_W-1:0] sample;
  logic [HALF-1:0][SECOND_W-1:0] product_q;
  logic [COUNT-1:0][SECOND_W-1:0] chain_q;
  logic [2:0] first_q;  // the beat in the stage is the first of its waveform: nothing before it counts

  assign sample = {{(SECOND_W - SAMPLE_W) {1'b0}}, s_sample};

  for (genvar k = 0; k < HALF; k++) begin : g_product
    localparam int COEFFICIENT = differenced_tap(TAPS, TAP_COUNT, 2, k);
    always_ff @(posedge clk) begin
      if (advance) product_q[k] <= SECOND_W'(sample * COEFFICIENT);
    end
  end

  for (genvar k = 0; k < COUNT; k++) begin : g_chain
    localparam int MIRRORED = k < HALF ? k : COUNT - 1 - k;
    logic [SECOND_W-1:0] tail;
    if (k == COUNT - 1) begin : g_end
      assign tail = '0;
    end else begin : g_middle
      assign tail = first_q[0] ? '0 : chain_q[k+1];
    end
    always_ff @(posedge clk) begin
      if (advance && valid_q[0]) chain_q[k] <= product_q[MIRRORED] + tail;
    end
  end

  // ---- two integrators ----------------------------------------------------------------------------------------------
  logic signed [ FIRST_W-1:0] first_difference_q;
  logic signed [SECOND_W-1:0] second_difference;
  assign second_difference = chain_q[0];

  always_ff @(posedge clk) begin
    if (advance) begin
      first_q <= {first_q[1:0], s_index == '0};
      if (valid_q[1]) begin
        first_difference_q <= (first_q[1] ? FIRST_W'(0) : first_difference_q) + FIRST_W'(second_difference);
      end
      if (valid_q[2]) begin
        m_sum <= (first_q[2] ? SUM_W'(0) : m_sum) + SUM_W'(first_difference_q);
      end
    end
  end

  assign m_valid = valid_q[STAGES-1];
  assign m_last = last_q[STAGES-1];
  assign m_raw = raw_q[STAGES-1];
  assign m_index = index_q[STAGES-1];
  assign m_overlong = overlong_q[STAGES-1];
endmodule

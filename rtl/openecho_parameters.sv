// Drops each component that does not stand out of its waveform's noise and has the parameters of the others solved
// (openecho_solve).
//
//   amplitude = maximum - noise mean               exact; kept if >= max(min_amplitude, k * noise deviation), exact
//
// So the arithmetic that EXP_W chooses has no say in which components are echoes.
//
// The trailer of a waveform (last = 1) carries its length, noise mean and deviation in the fields centre, peak and
// amplitude, as integers in either arithmetic, and zero in width and time.
//
// Latency and throughput are those of openecho_solve; before the first component of a waveform, 11 cycles from its noise
// to its threshold.
module openecho_parameters
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    localparam int AMP_W = SAMPLE_W + AMP_FRAC,
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int LENGTH_W = INDEX_W + 1,
    localparam int POSITION_W = position_width(EXP_W, FRAC, MAX_SAMPLES),
    localparam int VALUE_W = value_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic        [   RATIO_W-1:0] n,
    input  logic        [  SAMPLE_W-1:0] min_amplitude,
    input  logic        [   RATIO_W-1:0] k,
    input  logic                         noise_valid,
    output logic                         noise_ready,
    input  logic        [     AMP_W-1:0] noise_mean,
    input  logic        [     AMP_W-1:0] noise_deviation,
    input  logic                         noise_none,
    input  logic                         s_valid,
    output logic                         s_ready,
    input  logic                         s_last,
    input  logic        [POSITION_W-1:0] s_left,
    input  logic        [POSITION_W-1:0] s_right,
    input  logic        [POSITION_W-1:0] s_peak,
    input  logic        [  SAMPLE_W-1:0] s_maximum,
    input  logic        [  LENGTH_W-1:0] s_length,
    input  logic        [   FLAGS_W-1:0] s_flags,
    output logic                         m_valid,
    input  logic                         m_ready,
    output logic                         m_last,
    output logic        [   VALUE_W-1:0] m_centre,
    output logic        [   VALUE_W-1:0] m_peak,
    output logic        [   VALUE_W-1:0] m_width,
    output logic signed [   VALUE_W-1:0] m_time,
    output logic        [   VALUE_W-1:0] m_amplitude,
    output logic        [   FLAGS_W-1:0] m_flags
);
  localparam int LIMIT_W = AMP_W + RATIO_W;  // k * deviation, AMP_FRAC + RATIO_FRAC fraction bits

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) u_check ();

  // ---- threshold of the waveform: limit = mean + max(min_amplitude, k * deviation), bit by bit of k -----------------
  localparam int ARM_STEPS = RATIO_W + 2;
  logic armed_q, arming_q, none_q;
  logic [$clog2(ARM_STEPS)-1:0] arm_step_q;
  logic [AMP_W-1:0] mean_q, deviation_q;
  logic [RATIO_W-1:0] k_q;
  logic [LIMIT_W-1:0] limit_q, addend_q;
  logic accept;

  assign noise_ready = !armed_q && !arming_q;

  always_ff @(posedge clk) begin
    if (rst) begin
      armed_q  <= 1'b0;
      arming_q <= 1'b0;
    end else begin
      if (noise_ready) arming_q <= noise_valid;
      else if (arming_q && arm_step_q == '0) arming_q <= 1'b0;
      if (arming_q && arm_step_q == '0) armed_q <= 1'b1;
      else if (accept && s_last) armed_q <= 1'b0;
    end
    if (noise_ready) begin
      arm_step_q <= ($clog2(ARM_STEPS))'(ARM_STEPS - 1);
      none_q <= noise_none;
      mean_q <= noise_mean;
      deviation_q <= noise_deviation;
      k_q <= k;
      limit_q <= '0;
      addend_q <= LIMIT_W'(noise_deviation);
    end else if (arming_q) begin
      arm_step_q <= arm_step_q - 1'b1;
      k_q <= k_q >> 1;
      addend_q <= addend_q << 1;
      if (k_q[0] || arm_step_q == '0) limit_q <= limit_q + addend_q;
      if (arm_step_q == 1) begin
        addend_q <= LIMIT_W'(mean_q) << RATIO_FRAC;
        if (limit_q < LIMIT_W'(min_amplitude) << (AMP_FRAC + RATIO_FRAC)) begin
          limit_q <= LIMIT_W'(min_amplitude) << (AMP_FRAC + RATIO_FRAC);
        end
      end
    end
  end

  // ---- keep or drop -------------------------------------------------------------------------------------------------
  logic kept, solve_ready;
  logic [FLAGS_W-1:0] solve_flags;
  logic [  AMP_W-1:0] amplitude;

  assign kept = LIMIT_W'(s_maximum) << (AMP_FRAC + RATIO_FRAC) >= limit_q;
  assign amplitude = {s_maximum, {AMP_FRAC{1'b0}}} - mean_q;
  assign s_ready = armed_q && solve_ready;
  assign accept = s_valid && s_ready;
  always_comb begin
    solve_flags = s_flags;
    if (s_last) solve_flags[FLAG_NO_NOISE] = none_q;
  end

  openecho_solve #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) u_solve (
      .clk,
      .rst,
      .n,
      .s_valid(s_valid && armed_q),
      .s_ready(solve_ready),
      .s_last,
      .s_kept(kept),
      .s_left,
      .s_right,
      .s_peak,
      .s_amplitude(s_last ? deviation_q : amplitude),
      .s_length,
      .s_mean(mean_q),
      .s_flags(solve_flags),
      .m_valid,
      .m_ready,
      .m_last,
      .m_centre,
      .m_peak,
      .m_width,
      .m_time,
      .m_amplitude,
      .m_flags
  );
endmodule

// Solves each component's parameters (Zhou 2022, Eqs (6) to (9)) and drops what does not stand out of the noise.
//
//   amplitude = maximum - noise mean               exact; kept if >= max(min_amplitude, k * noise deviation), exact
//   centre    = (left + right) / 2                 rounded half up
//   width     = (right - left) / n                 rounded half up; n below 1 counts as 1
//   time      = centre - FWHM / 4,  FWHM = 2 sqrt(2 ln 2) * width
//
// FWHM / 4 = width * sqrt(2 ln 2) / 2 takes no multiplier: twice the factor is
// (1 + 2^-4 - 2^-6 - 2^-14) (1 + 2^-3 - 2^-12), 1.2e-7 above the true 1.17741002, five shifted additions on one adder.
// Each addition drops bits below 2^-3 of the last place; the result is rounded half up. `time` is signed, as
// width / n < 2 can put it before the first sample. A component with FLAG_NO_PEAK repeats the centre as its peak.
//
// The trailer of a waveform (last = 1) carries its length, noise mean and deviation in the fields centre, peak and
// amplitude, and zero in width and time.
//
// Latency from a component or trailer to its output: 8 + rows of the divider (38 cycles for positions of 28 bits);
// before the first of a waveform, 11 cycles from its noise to its threshold. Throughput: one component each 6 cycles.
module openecho_parameters
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    localparam int AMP_W = SAMPLE_W + AMP_FRAC,
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int LENGTH_W = INDEX_W + 1,
    localparam int POSITION_W = INDEX_W + FRAC,
    localparam int PEAK_W = POSITION_W > AMP_W ? POSITION_W : AMP_W
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
    output logic        [POSITION_W-1:0] m_centre,
    output logic        [    PEAK_W-1:0] m_peak,
    output logic        [POSITION_W-1:0] m_width,
    output logic signed [  POSITION_W:0] m_time,
    output logic        [     AMP_W-1:0] m_amplitude,
    output logic        [   FLAGS_W-1:0] m_flags
);
  localparam int DIVIDE_LOOPS = 6;  // cycles a component may take, see the throughput of openecho_inflection
  localparam int QUO_W = POSITION_W + 1;  // one bit below FRAC, for rounding
  localparam int LIMIT_W = AMP_W + RATIO_W;  // k * deviation, AMP_FRAC + RATIO_FRAC fraction bits
  localparam int GUARD = 3;
  localparam int SCALE_W = POSITION_W + GUARD + 1;

  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
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

  // ---- stage A: keep or drop; sums and differences ------------------------------------------------------------------
  logic kept, a_valid_q, a_last_q, a_ready, a_free;
  logic [POSITION_W-1:0] a_centre_q, a_span_q;
  logic [PEAK_W-1:0] a_peak_q, a_peak;
  logic [AMP_W-1:0] a_amplitude_q;
  logic [FLAGS_W-1:0] a_flags_q;
  logic [POSITION_W-1:0] middle;
  logic unused_half;

  assign a_free = !a_valid_q || a_ready;
  assign s_ready = armed_q && a_free;
  assign accept = s_valid && s_ready;
  assign kept = s_last || LIMIT_W'(s_maximum) << (AMP_FRAC + RATIO_FRAC) >= limit_q;
  assign {middle, unused_half} = {1'b0, s_left} + {1'b0, s_right} + 1'b1;

  always_ff @(posedge clk) begin
    if (rst) a_valid_q <= 1'b0;
    else if (a_free) a_valid_q <= accept && kept;
    if (a_free) begin
      a_last_q <= s_last;
      a_flags_q <= s_flags;
      a_centre_q <= middle;
      a_span_q <= s_right - s_left;
      a_peak_q <= PEAK_W'(s_peak);
      a_amplitude_q <= {s_maximum, {AMP_FRAC{1'b0}}} - mean_q;
      if (s_last) begin
        a_flags_q[FLAG_NO_NOISE] <= none_q;
        a_centre_q <= POSITION_W'(s_length);
        a_span_q <= '0;
        a_peak_q <= PEAK_W'(mean_q);
        a_amplitude_q <= deviation_q;
      end
    end
  end
  assign a_peak = a_flags_q[FLAG_NO_PEAK] && !a_last_q ? PEAK_W'(a_centre_q) : a_peak_q;

  // ---- width, while the other fields wait in a queue ----------------------------------------------------------------
  localparam int FIELDS_W = 1 + FLAGS_W + POSITION_W + PEAK_W + AMP_W;
  logic fields_ready, unused_fields_valid, divide_ready, quotient_valid, take, write;
  logic [QUO_W-1:0] quotient;
  logic [RATIO_W+QUO_W-1:0] numerator;
  logic [RATIO_W-1:0] divisor;
  logic [POSITION_W-1:0] width;
  logic [3:0] unused_fields_level;
  logic fields_last;
  logic [FLAGS_W-1:0] fields_flags;
  logic [POSITION_W-1:0] fields_centre;
  logic [PEAK_W-1:0] fields_peak;
  logic [AMP_W-1:0] fields_amplitude;

  assign divisor   = n[RATIO_W-1:RATIO_FRAC] == '0 ? RATIO_W'(1) << RATIO_FRAC : n;
  assign numerator = (RATIO_W + QUO_W)'(a_span_q) << (RATIO_FRAC + 1);
  assign a_ready   = fields_ready && divide_ready;

  openecho_divide #(
      .DEN_W (RATIO_W),
      .QUO_W (QUO_W),
      .STAGES((QUO_W + DIVIDE_LOOPS - 1) / DIVIDE_LOOPS)
  ) u_width (
      .clk,
      .rst,
      .s_valid(a_valid_q && fields_ready),
      .s_ready(divide_ready),
      .s_head(numerator[RATIO_W+QUO_W-1:QUO_W]),
      .s_tail(numerator[QUO_W-1:0]),
      .s_den(divisor),
      .m_valid(quotient_valid),
      .m_ready(take),
      .m_quotient(quotient)
  );

  openecho_fifo #(
      .WIDTH(FIELDS_W),
      .DEPTH(8)
  ) u_fields (
      .clk,
      .rst,
      .s_valid(a_valid_q && divide_ready),
      .s_ready(fields_ready),
      .s_data ({a_last_q, a_flags_q, a_centre_q, a_peak, a_amplitude_q}),
      .m_valid(unused_fields_valid),
      .m_ready(write),
      .m_data ({fields_last, fields_flags, fields_centre, fields_peak, fields_amplitude}),
      .level  (unused_fields_level)
  );

  assign width = POSITION_W'(quotient[QUO_W-1:1]) + POSITION_W'(quotient[0]);

  // ---- echo time: scaled = 2 * 2^GUARD * FWHM/4, one addition a clock -----------------------------------------------
  localparam int SCALE_STEPS = 5;
  logic solving_q, solved;
  logic subtract, unused_carry;
  logic [2:0] step_q;
  logic [POSITION_W-1:0] width_q;
  logic [SCALE_W-1:0] term_q, scaled_q, shifted, scaled;
  logic [POSITION_W:0] echo_time;
  logic [GUARD:0] unused_fraction;

  assign solved = solving_q && step_q == 3'(SCALE_STEPS);
  assign write  = solved && (!m_valid || m_ready);
  assign take   = (!solving_q || write) && quotient_valid;

  always_comb begin
    case (step_q)
      3'd0: shifted = scaled_q >> 8;
      3'd1: shifted = scaled_q >> 2;
      3'd2: shifted = scaled_q >> 4;
      3'd3: shifted = scaled_q >> 9;
      default: shifted = scaled_q >> 3;
    endcase
    subtract = step_q == 3'd1 || step_q == 3'd3;
    {scaled, unused_carry} = {term_q, subtract} + {shifted ^ {SCALE_W{subtract}}, subtract};
  end

  // half of the last place added, for rounding half up
  assign {echo_time, unused_fraction} = {1'b0, fields_centre, 1'b1, GUARD'(0)} - {1'b0, scaled_q};

  always_ff @(posedge clk) begin
    if (rst) begin
      solving_q <= 1'b0;
      m_valid   <= 1'b0;
    end else begin
      if (take) solving_q <= 1'b1;
      else if (write) solving_q <= 1'b0;
      if (!m_valid || m_ready) m_valid <= write;
    end
    if (take) begin
      step_q   <= '0;
      width_q  <= width;
      term_q   <= SCALE_W'(width) << GUARD;
      scaled_q <= SCALE_W'(width) << GUARD;
    end else if (!solved) begin
      step_q   <= step_q + 1'b1;
      scaled_q <= scaled;
      if (step_q == 3'd2) term_q <= scaled;
    end
    if (write) begin
      m_last <= fields_last;
      m_flags <= fields_flags;
      m_centre <= fields_centre;
      m_peak <= fields_peak;
      m_amplitude <= fields_amplitude;
      m_width <= width_q;
      m_time <= fields_last ? '0 : echo_time;
    end
  end
endmodule

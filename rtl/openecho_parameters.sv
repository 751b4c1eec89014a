// Solves the parameters of each component (Zhou 2022, Eqs (6), (7) and (9)).
//
//   centre = (left + right) / 2
//   width  = (right - left) / n                                              n below 1 counts as 1
//   time   = centre - FWHM / 4,  FWHM = 2 sqrt(2 ln 2) * width
//
// FWHM / 4 = width / K, K = 2 / sqrt(2 ln 2): the divider is there, a multiplier is not. A component with FLAG_NO_PEAK
// repeats the centre as its peak. The trailer of a waveform (s_last) carries its length as centre, the noise mean as peak
// and the noise deviation as amplitude, as integers in either arithmetic, and zero in width and time. `time` is signed, as
// width / n < 2 can put it before the first sample. s_amplitude and s_mean carry AMP_FRAC fraction bits.
//
// Latency 1 cycle for a trailer. One component at a time; the next is taken while its record is solved for and waits.
//
// Fixed point (EXP_W 0): one adder for all, divisions at a bit a clock, K with POSITION_W fraction bits, each result
// rounded half up. Non-restoring: a negative remainder means that the last subtraction was one too many, so the next step
// adds. So that a path ends behind the adder, its sign alone decides on the next step and is the bit of a quotient: the
// division by n works on the complement of the span and leaves the width, that by K leaves the complement of its quotient,
// and either is then added. An echo takes 2 POSITION_W + 8 cycles: 64 at FRAC 16.
//
// Floating point: left + right, left - right, its quotient by n, that one's by K rounded to the format, and the sum with
// the centre, each rounded to nearest even by one serial unit; halving is exact. The span is taken negative, so that every
// step but the second adds or divides what the step before left behind: rounding is symmetric, the bits are the same. The
// amplitude is converted in one rounding. No infinity or NaN: openecho_check has every sum fit, no divisor is below 1, and
// left + right is at least 1, so that half of it is normal. An echo takes 2 FRAC + 20 cycles and more.
module openecho_parameters
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    localparam int AMP_W = SAMPLE_W + AMP_FRAC,
    localparam int LENGTH_W = $clog2(MAX_SAMPLES) + 1,
    localparam int POSITION_W = position_width(EXP_W, FRAC, MAX_SAMPLES),
    localparam int VALUE_W = value_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                         clk,
    input  logic                         rst,
    input  logic        [   RATIO_W-1:0] n,
    input  logic                         s_valid,
    output logic                         s_ready,
    input  logic                         s_last,
    input  logic        [POSITION_W-1:0] s_left,
    input  logic        [POSITION_W-1:0] s_right,
    input  logic        [POSITION_W-1:0] s_peak,
    input  logic        [     AMP_W-1:0] s_amplitude,
    input  logic        [  LENGTH_W-1:0] s_length,
    input  logic        [     AMP_W-1:0] s_mean,
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
  openecho_check #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES)
  ) u_check ();

  // From CENTRE to TIME one operation after the other. The bits choose operands in fixed point, the highest is m_valid.
  // (Icarus 11 takes no enum inside a generate block.)
  localparam logic [4:0] IDLE = 5'b00000;  // takes a trailer
  localparam logic [4:0] CENTRE = 5'b01000;  // left + right
  localparam logic [4:0] SPAN = 5'b01001;  // of the two, which are read for the last time: takes the component
  localparam logic [4:0] WIDTH = 5'b00100;  // divides by n
  localparam logic [4:0] ROUND = 5'b00001;  // the width, in fixed point
  localparam logic [4:0] QUARTER = 5'b00101;  // of the FWHM: divides by K
  localparam logic [4:0] TIME = 5'b00010;  // centre - quarter
  localparam logic [4:0] OFFER = 5'b10000;

  localparam int FRACTION_W = 56;
  localparam logic [FRACTION_W-1:0] K_FRACTION = 56'hb2da_4e98_08a5_2c;  // of K = 1.69864..., cut

  logic [4:0] state_q, state_d;
  logic solved;  // the operation of this state is done
  logic centre_solved, width_solved;  // `centre` is known, and the component still there; `width` is known
  logic last_q;
  logic [FLAGS_W-1:0] flags_q;
  logic [AMP_W-1:0] amplitude_q;
  logic [VALUE_W-1:0] centre, centre_q, peak_q, width, width_q;
  logic [RATIO_W-1:0] divisor;

  assign divisor = n[RATIO_W-1:RATIO_FRAC] == '0 ? RATIO_W'(1) << RATIO_FRAC : n;
  assign s_ready = state_q == IDLE ? s_last : state_q == SPAN && solved;

  always_comb begin
    state_d = state_q;
    case (state_q)
      IDLE: if (s_valid) state_d = s_last ? OFFER : CENTRE;
      CENTRE: if (solved) state_d = SPAN;
      SPAN: if (solved) state_d = WIDTH;
      WIDTH: if (solved) state_d = EXP_W > 0 ? QUARTER : ROUND;
      ROUND: state_d = QUARTER;
      QUARTER: if (solved) state_d = TIME;
      TIME: if (solved) state_d = OFFER;
      default: if (m_ready) state_d = IDLE;
    endcase
  end

  always_ff @(posedge clk) begin
    state_q <= rst ? IDLE : state_d;
    if (s_ready) begin
      last_q <= s_last;
      flags_q <= s_flags;
      amplitude_q <= s_amplitude;
    end
    if (state_q == IDLE) begin
      centre_q <= VALUE_W'(s_length);
      peak_q   <= VALUE_W'(s_mean);
      width_q  <= '0;
    end
    if (centre_solved) begin
      centre_q <= centre;
      peak_q   <= s_flags[FLAG_NO_PEAK] ? centre : VALUE_W'(s_peak);
    end
    if (width_solved) width_q <= width;
  end

  assign m_valid  = state_q[4];
  assign m_last   = last_q;
  assign m_centre = centre_q;
  assign m_peak   = peak_q;
  assign m_width  = width_q;
  assign m_flags  = flags_q;

  if (EXP_W == 0) begin : g_fixed
    // A quotient has POSITION_W + 1 bits, the last for rounding, of a numerator below 2^POSITION_W: that is where the
    // divisors stand, n and K being at least 1, so that all bits of the numerator are in the first remainder.
    localparam int QUO_W = POSITION_W + 1;
    localparam logic [POSITION_W:0] K = {1'b1, K_FRACTION[FRACTION_W-1-:POSITION_W]}
                                      + QUO_W'(K_FRACTION[FRACTION_W-1-POSITION_W]);
    localparam int STEP_W = $clog2(QUO_W);
    localparam int ADDER_W = POSITION_W + RATIO_W - RATIO_FRAC + 1;

    logic [ STEP_W-1:0] step_q;  // of a division: those to come
    logic [ADDER_W-1:0] divisor_q;
    logic [ADDER_W-1:0] a, b, sum;
    logic [ADDER_W-1:0] remainder_q;  // before a division its numerator; after TIME the time
    logic [  QUO_W-1:0] quotient_q;  // before WIDTH the right inflection
    logic positions, dividing, negative_q, borrow, unused_borrow;

    assign positions = state_q[3];
    assign dividing = state_q[2];
    assign solved = !dividing || step_q == '0;

    always_comb begin
      a = remainder_q << 1;
      a[0] = state_q == WIDTH;
      if (positions) a = ADDER_W'(s_left);
      else if (state_q[1]) a = ADDER_W'(centre_q);
      b = {{(ADDER_W - POSITION_W) {state_q[1]}}, quotient_q[QUO_W-1:1]};
      if (dividing) b = divisor_q;
      borrow = !quotient_q[0];
      if (positions) borrow = state_q[0];
      else if (dividing) borrow = negative_q;
    end

    assign {sum, unused_borrow} = {a, 1'b0} - {b ^ {ADDER_W{negative_q}}, borrow};

    always_ff @(posedge clk) begin
      step_q <= dividing ? step_q - 1'b1 : STEP_W'(QUO_W - 1);
      divisor_q <= ADDER_W'(divisor) << (POSITION_W - RATIO_FRAC);
      if (state_q == ROUND || state_q == QUARTER) divisor_q <= ADDER_W'(K);
      if (!m_valid) {negative_q, remainder_q} <= {sum[ADDER_W-1], sum};
      if (state_q == IDLE || (dividing && solved)) {negative_q, remainder_q} <= {1'b1, ADDER_W'(0)};
      if (state_q == IDLE) quotient_q <= {s_right, 1'b0};
      else if (dividing) quotient_q <= {quotient_q[QUO_W-2:0], sum[ADDER_W-1]};
    end

    assign centre = VALUE_W'(remainder_q[POSITION_W:1]);
    assign centre_solved = state_q == SPAN;
    assign width = VALUE_W'(sum[POSITION_W-1:0]);
    assign width_solved = state_q == ROUND;
    assign m_time = VALUE_W'($signed(remainder_q[POSITION_W:0]));
    assign m_amplitude = VALUE_W'(amplitude_q);
  end else begin : g_float
    localparam logic [EXP_W-1:0] BIAS = {1'b0, {(EXP_W - 1) {1'b1}}};
    localparam logic [POSITION_W-1:0] K = {
      1'b0, BIAS, K_FRACTION[FRACTION_W-1-:FRAC] + FRAC'(K_FRACTION[FRACTION_W-1-FRAC])
    };

    // A step of the serial unit goes from the issue of its operation to its result, which stays at the unit's output
    // until the next operation takes it in.
    logic issued_q, issue, taken, serial_valid, unused_serial_ready, converted_valid, unused_convert_ready;
    logic [POSITION_W-1:0] operand_a, operand_b, result, converted;
    logic [4:0] unused_serial_flags, unused_convert_flags;

    assign issue  = state_q != IDLE && state_q != OFFER && !issued_q && (state_q != WIDTH || converted_valid);
    assign solved = issued_q && serial_valid && (state_q != TIME || converted_valid);
    assign taken  = m_valid && m_ready && !last_q;

    always_ff @(posedge clk) issued_q <= !rst && (issue || (issued_q && !solved));

    always_comb begin
      operand_a = result;
      operand_b = result;
      if (state_q == CENTRE || state_q == SPAN) operand_a = s_left;
      if (state_q == CENTRE || state_q == SPAN) operand_b = s_right;
      if (state_q == WIDTH) operand_b = converted;
      if (state_q == QUARTER) operand_b = K;
      if (state_q == TIME) operand_a = POSITION_W'(centre_q);
    end

    openecho_float_serial #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC)
    ) u_serial (
        .clk,
        .rst,
        .s_valid(issue),
        .s_ready(unused_serial_ready),
        .s_a(operand_a),
        .s_b(operand_b),
        .s_subtract(state_q == SPAN),
        .s_divide(state_q == WIDTH || state_q == QUARTER),
        .m_valid(serial_valid),
        .m_ready(issue || taken),
        .m_result(result),
        .m_flags(unused_serial_flags)
    );

    logic [AMP_W:0] convertible;  // a net, as Icarus 11 makes X of this expression at a signed port
    assign convertible = state_q == CENTRE ? (AMP_W + 1)'(divisor) << (AMP_FRAC - RATIO_FRAC) : {1'b0, amplitude_q};

    // n while the additions go on, the amplitude during the last division.
    openecho_float_from_int #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC),
        .INT_W(AMP_W + 1),
        .SCALE(-AMP_FRAC),
        .ITERATIVE(1)
    ) u_convert (
        .clk,
        .rst,
        .s_valid (issue && (state_q == CENTRE || state_q == QUARTER)),
        .s_ready (unused_convert_ready),
        .s_value (convertible),
        .m_valid (converted_valid),
        .m_ready (taken || (state_q == WIDTH && issue)),
        .m_result(converted),
        .m_flags (unused_convert_flags)
    );

    assign centre = VALUE_W'({result[POSITION_W-1:FRAC] - (1 + EXP_W)'(1), result[FRAC-1:0]});
    assign centre_solved = state_q == SPAN && issue;  // the result is still that of the step before
    assign width_solved = state_q == WIDTH && solved;
    assign width = VALUE_W'({1'b0, result[POSITION_W-2:0]});
    assign m_time = last_q ? '0 : VALUE_W'($signed(result));
    assign m_amplitude = last_q ? VALUE_W'(amplitude_q) : VALUE_W'(converted);
  end
endmodule

// Solves the parameters of a kept component (Zhou 2022, Eqs (6), (7) and (9)); a component that is not kept, it drops.
//
//   centre = (left + right) / 2
//   width  = (right - left) / n                                              n below 1 counts as 1
//   time   = centre - FWHM / 4,  FWHM = 2 sqrt(2 ln 2) * width
//
// A component with FLAG_NO_PEAK repeats the centre as its peak. With s_last the fields are a trailer's: s_length goes to
// centre, s_mean to peak, s_amplitude to amplitude, zero to width and time. `time` is signed, as width / n < 2 can put it
// before the first sample. s_amplitude and s_mean carry AMP_FRAC fraction bits.
//
// Fixed point (EXP_W 0): each is rounded half up. FWHM / 4 = width * sqrt(2 ln 2) / 2 takes no multiplier: twice the
// factor is (1 + 2^-4 - 2^-6 - 2^-14) (1 + 2^-3 - 2^-12), 1.2e-7 above the true 1.17741002, five shifted additions on one
// adder. Each drops bits below 2^-3 of the last place. Latency 8 + rows of the divider (38 cycles for positions of 28
// bits); a component each 6 cycles.
//
// Floating point: left + right, left - right, its quotient by n, that one's by K = 2 / sqrt(2 ln 2), and the sum with the
// centre, each rounded to nearest even by one serial unit; halving is exact. FWHM / 4 = width / K spares a multiplier.
// The span is taken negative, so that every step but the second adds or divides what the step before left behind:
// rounding is symmetric, the bits are the same. The amplitude is converted in one rounding. No infinity or NaN:
// openecho_check has every sum fit, no divisor is below 1, and left + right is at least 1, so that half of it is normal.
// Latency 1 cycle for a trailer, 2 FRAC + 20 and more for an echo; the next component is taken at the same time.
module openecho_solve
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
    input  logic                         s_kept,
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
  logic [RATIO_W-1:0] divisor;
  assign divisor = n[RATIO_W-1:RATIO_FRAC] == '0 ? RATIO_W'(1) << RATIO_FRAC : n;

  if (EXP_W == 0) begin : g_fixed
    // ---- stage A: sums and differences --------------------------------------------------------------------------------
    localparam int PEAK_W = POSITION_W > AMP_W ? POSITION_W : AMP_W;
    logic a_valid_q, a_last_q, a_ready;
    logic [POSITION_W-1:0] a_centre_q, a_span_q;
    logic [PEAK_W-1:0] a_peak_q, a_peak;
    logic [AMP_W-1:0] a_amplitude_q;
    logic [FLAGS_W-1:0] a_flags_q;
    logic [POSITION_W-1:0] middle;
    logic unused_half;

    assign s_ready = !a_valid_q || a_ready;
    assign {middle, unused_half} = {1'b0, s_left} + {1'b0, s_right} + 1'b1;

    always_ff @(posedge clk) begin
      if (rst) a_valid_q <= 1'b0;
      else if (s_ready) a_valid_q <= s_valid && (s_kept || s_last);
      if (s_ready) begin
        a_last_q <= s_last;
        a_flags_q <= s_flags;
        a_centre_q <= s_last ? POSITION_W'(s_length) : middle;
        a_span_q <= s_last ? '0 : s_right - s_left;
        a_peak_q <= s_last ? PEAK_W'(s_mean) : PEAK_W'(s_peak);
        a_amplitude_q <= s_amplitude;
      end
    end
    assign a_peak = a_flags_q[FLAG_NO_PEAK] && !a_last_q ? PEAK_W'(a_centre_q) : a_peak_q;

    // ---- width, while the other fields wait in a queue ----------------------------------------------------------------
    localparam int LOOPS = 6;  // cycles a component may take, see the throughput of openecho_inflection
    localparam int QUO_W = POSITION_W + 1;  // one bit below FRAC, for rounding
    localparam int FIELDS_W = 1 + FLAGS_W + POSITION_W + PEAK_W + AMP_W;
    logic fields_ready, unused_fields_valid, divide_ready, quotient_valid, take, write;
    logic [QUO_W-1:0] quotient;
    logic [RATIO_W+QUO_W-1:0] numerator;
    logic [POSITION_W-1:0] width;
    logic [3:0] unused_fields_level;
    logic fields_last;
    logic [FLAGS_W-1:0] fields_flags;
    logic [POSITION_W-1:0] fields_centre;
    logic [PEAK_W-1:0] fields_peak;
    logic [AMP_W-1:0] fields_amplitude;

    assign numerator = (RATIO_W + QUO_W)'(a_span_q) << (RATIO_FRAC + 1);
    assign a_ready   = fields_ready && divide_ready;

    openecho_divide #(
        .DEN_W (RATIO_W),
        .QUO_W (QUO_W),
        .STAGES((QUO_W + LOOPS - 1) / LOOPS)
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
    localparam int GUARD = 3;
    localparam int SCALE_W = POSITION_W + GUARD + 1;
    logic solving_q, solved;
    logic subtract, unused_carry;
    logic [2:0] step_q;
    logic [POSITION_W-1:0] width_q;
    logic [SCALE_W-1:0] term_q, scaled_q, shifted, scaled;
    logic signed [POSITION_W:0] echo_time;
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
        m_centre <= VALUE_W'(fields_centre);
        m_peak <= VALUE_W'(fields_peak);
        m_amplitude <= VALUE_W'(fields_amplitude);
        m_width <= VALUE_W'(width_q);
        m_time <= fields_last ? '0 : VALUE_W'(echo_time);
      end
    end
  end else begin : g_float
    localparam int FRACTION_W = 56;
    localparam logic [FRACTION_W-1:0] K_FRACTION = 56'hb2da_4e98_08a5_2c;  // of K = 1.69864..., cut
    localparam logic [EXP_W-1:0] BIAS = {1'b0, {(EXP_W - 1) {1'b1}}};
    localparam logic [POSITION_W-1:0] K = {
      1'b0, BIAS, K_FRACTION[FRACTION_W-1-:FRAC] + FRAC'(K_FRACTION[FRACTION_W-1-FRAC])
    };

    // CENTRE to TIME are steps of the serial unit, each from the issue of its operation to its result, which stays at
    // the unit's output until the next operation takes it in. (Icarus 11 takes no enum inside a generate block.)
    localparam logic [2:0] IDLE = 3'd0;
    localparam logic [2:0] TAKE = 3'd1;  // a trailer, or what is dropped
    localparam logic [2:0] CENTRE = 3'd2;
    localparam logic [2:0] SPAN = 3'd3;  // left and right are read for the last time: takes the component
    localparam logic [2:0] WIDTH = 3'd4;
    localparam logic [2:0] QUARTER = 3'd5;
    localparam logic [2:0] TIME = 3'd6;
    localparam logic [2:0] TRAILER = 3'd7;
    logic [2:0] state_q, state_d;

    logic working, issued_q, issue, solved, done, unused_serial_ready, serial_valid;
    logic converted_valid, unused_convert_ready;
    logic [POSITION_W-1:0] operand_a, operand_b, result, converted, width_q;
    logic [VALUE_W-1:0] centre_q, peak_q;
    logic [  AMP_W-1:0] amplitude_q;
    logic [FLAGS_W-1:0] flags_q;
    logic [4:0] unused_serial_flags, unused_convert_flags;

    assign working = state_q != IDLE && state_q != TAKE && state_q != TRAILER;
    assign issue = working && !issued_q && (state_q != WIDTH || converted_valid);
    assign solved = issued_q && serial_valid;
    assign s_ready = state_q == TAKE || (state_q == SPAN && issue);
    assign m_valid = state_q == TRAILER || (state_q == TIME && solved && converted_valid);
    assign done = m_valid && m_ready;

    always_comb begin
      state_d = state_q;
      case (state_q)
        IDLE: begin
          if (s_valid) state_d = TAKE;
          if (s_valid && s_kept && !s_last) state_d = CENTRE;
        end
        TAKE: begin
          state_d = IDLE;
          if (s_last) state_d = TRAILER;
        end
        CENTRE: if (solved) state_d = SPAN;
        SPAN: if (solved) state_d = WIDTH;
        WIDTH: if (solved) state_d = QUARTER;
        QUARTER: if (solved) state_d = TIME;
        default: if (done) state_d = IDLE;
      endcase
    end

    always_ff @(posedge clk) begin
      if (rst) begin
        state_q  <= IDLE;
        issued_q <= 1'b0;
      end else begin
        state_q  <= state_d;
        issued_q <= issue || (issued_q && state_d == state_q);
      end
      if (state_q == TAKE) begin
        centre_q <= VALUE_W'(s_length);
        peak_q   <= VALUE_W'(s_mean);
        width_q  <= '0;
      end
      if (state_q == CENTRE && solved) begin
        centre_q <= VALUE_W'({result[POSITION_W-1:FRAC] - (1 + EXP_W)'(1), result[FRAC-1:0]});
      end
      if (state_q == SPAN && issue) peak_q <= s_flags[FLAG_NO_PEAK] ? centre_q : VALUE_W'(s_peak);
      if (state_q == WIDTH && solved) width_q <= {1'b0, result[POSITION_W-2:0]};
      if (s_ready) begin
        amplitude_q <= s_amplitude;
        flags_q <= s_flags;
      end
    end

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
        .m_ready(issue || done),
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
        .m_ready (done || (state_q == WIDTH && issue)),
        .m_result(converted),
        .m_flags (unused_convert_flags)
    );

    assign m_last = state_q == TRAILER;
    assign m_centre = centre_q;
    assign m_peak = peak_q;
    assign m_width = VALUE_W'(width_q);
    assign m_time = m_last ? '0 : VALUE_W'($signed(result));
    assign m_amplitude = m_last ? VALUE_W'(amplitude_q) : VALUE_W'(converted);
    assign m_flags = flags_q;
  end
endmodule

// m_result = s_a / s_b where s_divide is set, or else s_a + s_b, or s_a - s_b where s_subtract is set: one operation at
// a time in the smallest area, a bit a clock. Same bits and flags as openecho_float_add and openecho_float_div, which
// are this module where they are iterative: with s_divide tied to a constant, synthesis removes what only the other
// operation needs.
//
// Latency in cycles, from s_valid to m_valid; a new operation starts each latency - 1:
// division  FRAC_W + 6, one more if |significand of s_a| < |significand of s_b|; a subnormal operand adds a cycle for
//           each leading zero, a subnormal result takes one off for each.
// addition  4 + the distance of the exponents, at most 2^ceil(log2(FRAC_W + 4)) - 1 (one more if s_a is the smaller),
//           + the places from the carry's down to the leading one: none with a carry, one if the result's exponent is
//           that of the larger operand, and one more for each bit that cancels. An exact zero takes 5.
// special   3: a NaN or an infinity comes in, or zero is divided or divides.
//
// Both operations end in one form, a leading one at the top or the smallest exponent, subnormals in their place, so
// that rounding needs no shifter. Three registers do for both, a LUT a bit each, and one adder:
// a         a dividend, then twice the remainder; or a summand, shifted right if it is the smaller, then the sum,
//           shifted left: as it always takes twice what comes out of the adder, that is an addition of zero
// b         a divisor, shifted left while it is subnormal; or a summand, shifted right if it is the smaller
// quotient  of a division
//
// Division is non-restoring, so that a takes the adder's result whatever its sign; there is no remainder if a has been
// zero at any time. Summands are neither compared nor swapped: a difference that comes out negative is negated by its
// first shift to the left, -a being ~(a - 1).
module openecho_float_serial #(
    parameter  int EXP_W  = 11,
    parameter  int FRAC_W = 52,
    localparam int WORD_W = 1 + EXP_W + FRAC_W
) (
    input  logic              clk,
    input  logic              rst,
    input  logic              s_valid,
    output logic              s_ready,
    input  logic [WORD_W-1:0] s_a,
    input  logic [WORD_W-1:0] s_b,
    input  logic              s_subtract,
    input  logic              s_divide,
    output logic              m_valid,
    input  logic              m_ready,
    output logic [WORD_W-1:0] m_result,
    output logic [       4:0] m_flags
);
  localparam int SIG_W = FRAC_W + 1;
  localparam int QUO_W = SIG_W + 2;  // guard and round below the fraction
  localparam int B_W = SIG_W + 3;  // a sum's guard, round and sticky below
  localparam int SUM_W = B_W + 1;  // its carry, or its sign, above
  localparam int A_W = SUM_W + 1;  // twice that
  localparam int BIAS = (1 << (EXP_W - 1)) - 1;
  // Differences of exponents, down by FRAC_W for a subnormal divisor, plus the bias and the quotient bits to come.
  localparam int EXPONENT_W = $clog2((3 << (EXP_W - 1)) + 2 * FRAC_W + 4) + 1;
  // A summand is all sticky bit when its leading one is in the lowest place.
  localparam int STEPS_W = $clog2(B_W);
  localparam int GAP_W = (EXP_W > STEPS_W ? EXP_W : STEPS_W) + 1;

  openecho_float_check #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_check ();

  // ---- operands -----------------------------------------------------------------------------------------------------
  logic a_sign, a_zero, a_infinite, a_nan, a_signalling;
  logic b_sign, b_zero, b_infinite, b_nan, b_signalling;
  logic [EXP_W-1:0] a_exponent, b_exponent;
  logic [SIG_W-1:0] a_significand, b_significand;

  openecho_float_unpack #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_a (
      .word(s_a),
      .sign(a_sign),
      .exponent(a_exponent),
      .significand(a_significand),
      .zero(a_zero),
      .infinite(a_infinite),
      .nan(a_nan),
      .signalling(a_signalling)
  );

  openecho_float_unpack #(
      .EXP_W (EXP_W),
      .FRAC_W(FRAC_W)
  ) u_b (
      .word(s_b),
      .sign(b_sign),
      .exponent(b_exponent),
      .significand(b_significand),
      .zero(b_zero),
      .infinite(b_infinite),
      .nan(b_nan),
      .signalling(b_signalling)
  );

  logic unlike, clash, nan, infinite, zero;
  assign unlike = a_sign ^ b_sign ^ s_subtract;  // a difference of magnitudes
  assign clash = s_divide ? (a_infinite && b_infinite) || (a_zero && b_zero) : a_infinite && b_infinite && unlike;
  assign nan = a_nan || b_nan || clash;
  assign infinite = a_infinite || (s_divide ? b_zero : b_infinite);
  assign zero = s_divide && (a_zero || b_infinite);

  logic signed [GAP_W-1:0] gap;
  logic far;
  assign gap = $signed(GAP_W'(a_exponent)) - $signed(GAP_W'(b_exponent));
  assign far = gap[GAP_W-1:STEPS_W] != {(GAP_W - STEPS_W) {gap[GAP_W-1]}};

  // ---- control ------------------------------------------------------------------------------------------------------
  // START  division: the first bit; addition: aligns, then adds
  // RUN    division: the other bits; addition: shifts the sum left
  // LAST   openecho_float_round still reads the registers
  // In two bits: a flip-flop for each state would take more LUTs.
  typedef enum logic [1:0] {
    IDLE,
    START,
    RUN,
    LAST
  } state_e;
  (* fsm_encoding = "none" *) state_e state_q;
  logic divide_q, advance, aligned, normal, lowest, ended, solved, align, step;
  logic exact_q;  // in START: nothing to compute; then: a has been zero
  logic signed_q;  // a will be, or is, a difference that may be negative

  logic a_smaller_q;
  logic [STEPS_W:0] distance_q;
  logic signed [EXPONENT_W-1:0] exponent_q;
  logic [A_W-1:0] a_q;
  logic [B_W-1:0] b_q;
  logic [QUO_W-1:0] quotient_q;

  assign advance = !m_valid || m_ready;
  assign s_ready = state_q == IDLE || (state_q == LAST && advance);
  assign aligned = distance_q == {(STEPS_W + 1) {!a_smaller_q}};
  assign normal = !divide_q || b_q[B_W-1];
  assign lowest = exponent_q[EXPONENT_W-1] || exponent_q[EXPONENT_W-2:1] == '0;  // at most 1
  assign ended = divide_q ? normal && (quotient_q[QUO_W-1] || lowest) : exact_q || (a_q[A_W-1] && !signed_q) || lowest;
  assign solved = (state_q == START && exact_q) || (state_q == RUN && ended);
  assign align = state_q == START && !divide_q && !aligned;
  assign step = (state_q == START || state_q == RUN) && !align && !solved;

  always_ff @(posedge clk) begin
    if (rst) state_q <= IDLE;
    else if (s_ready) state_q <= s_valid ? START : IDLE;
    else if (solved) state_q <= advance ? LAST : state_q;
    else if (step) state_q <= RUN;
  end

  // ---- the adder ----------------------------------------------------------------------------------------------------
  logic subtract, negate, carry_in, unused_carry;
  logic [SUM_W-1:0] sum;
  assign subtract = divide_q ? !a_q[A_W-1] : signed_q && (state_q == START || a_q[A_W-1]);
  assign negate = subtract && !divide_q && state_q == RUN;
  assign carry_in = subtract && !negate;
  assign {sum, unused_carry} = {a_q[SUM_W-1:0], carry_in} + {{1'b0, b_q} ^ {SUM_W{subtract}}, carry_in};

  // ---- registers ----------------------------------------------------------------------------------------------------
  // kind: {sign, nan, infinite, invalid, divide_by_zero}
  logic [4:0] kind_q;
  logic remainder;
  // The lowest bit is only set while summands are aligned; the sign never alone.
  assign remainder = a_q[A_W-2:1] != '0;

  always_ff @(posedge clk) begin
    if (s_ready) begin
      divide_q <= s_divide;
      kind_q <= {
        a_sign ^ (s_divide ? b_sign : b_infinite && unlike),
        nan,
        infinite,
        a_signalling || b_signalling || clash,
        s_divide && b_zero && !a_zero && !a_infinite && !a_nan
      };
      exact_q <= nan || infinite || zero;
      signed_q <= unlike;
    end else if (state_q == RUN && step) begin
      exact_q  <= exact_q || !remainder;
      signed_q <= 1'b0;
      if (signed_q && !divide_q) kind_q[4] <= (kind_q[4] ^ a_q[A_W-1]) && remainder;
    end
  end

  // Counts up, from the gap to 0 if it is negative, or else from ~gap to -1.
  always_ff @(posedge clk) begin
    if (s_ready) a_smaller_q <= gap[GAP_W-1];
    if (s_ready && far) distance_q <= {1'b1, {STEPS_W{1'b0}}};
    else if (s_ready) distance_q <= {1'b1, gap[STEPS_W-1:0] ^ {STEPS_W{!gap[GAP_W-1]}}};
    else distance_q <= distance_q + 1'b1;
  end

  // Of the top place of the sum, or of the quotient as it stands: the larger exponent, up by one for the carry, then
  // down with each shift; or the gap and, from the first step on, the constant, up with each shift of the divisor, down
  // with each bit. Rounding wants 0 for what has no leading one.
  logic up, leading;
  assign up = divide_q ? !normal : state_q == START;
  assign leading = divide_q ? quotient_q[QUO_W-1] : a_q[A_W-1];
  always_ff @(posedge clk) begin
    if (s_ready) begin
      if (s_divide) exponent_q <= EXPONENT_W'(gap);
      else exponent_q <= $signed(EXPONENT_W'(gap[GAP_W-1] ? b_exponent : a_exponent));
    end else if (step) begin
      if (divide_q && state_q == START) begin
        exponent_q <= exponent_q + (up ? EXPONENT_W'(BIAS + QUO_W + 1) : EXPONENT_W'(BIAS + QUO_W - 1));
      end else exponent_q <= exponent_q + (up ? EXPONENT_W'(1) : -EXPONENT_W'(1));
    end else if (solved && !leading) exponent_q <= '0;
  end

  always_ff @(posedge clk) begin
    if (s_ready || (align && a_smaller_q) || (step && normal)) begin
      a_q <= s_ready ? {2'b00, a_significand, 3'b000} :
             align ? {1'b0, a_q[A_W-1:2], a_q[1] || a_q[0]} : {sum ^ {SUM_W{negate}}, 1'b0};
    end
    if (step && !divide_q) b_q <= '0;
    else if (s_ready || (align && !a_smaller_q) || (step && !normal)) begin
      b_q <= s_ready ? {b_significand, 3'b000} :
             divide_q ? {b_q[B_W-2:0], 1'b0} : {1'b0, b_q[B_W-1:2], b_q[1] || b_q[0]};
    end
    if (s_ready) quotient_q <= '0;
    else if (step && normal) quotient_q <= {quotient_q[QUO_W-2:0], !sum[SUM_W-1]};
  end

  openecho_float_round #(
      .EXP_W(EXP_W),
      .FRAC_W(FRAC_W),
      .EXPONENT_W(EXPONENT_W - 1),
      .HELD(1)
  ) u_round (
      .clk,
      .rst,
      .advance,
      .s_valid(solved),
      .s_kind(kind_q),
      .s_exponent(exponent_q[EXPONENT_W-2:0]),
      .s_significand(divide_q ? {quotient_q, remainder && !exact_q} : {a_q[A_W-1:3], a_q[2] || a_q[1]}),
      .m_valid,
      .m_word(m_result),
      .m_flags
  );
endmodule

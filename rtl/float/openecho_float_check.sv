// Stops elaboration with a sentence when a floating-point format is outside what the float units can work with. Every
// unit instantiates it.

// An elaboration task stops every tool but Icarus 11, which has none and stops at time 0 instead.
`ifdef __ICARUS__
`define OPENECHO_STOP initial $fatal
`else
`define OPENECHO_STOP $fatal
`endif

module openecho_float_check #(
    parameter int EXP_W  = 11,
    parameter int FRAC_W = 52,
    parameter int INT_W  = 2,   // of a signed integer that comes in or goes out
    parameter int SCALE  = 0,   // and the power of two that it is multiplied by
    parameter int FRAC   = 0    // fractional bits of a fixed-point result
);
  localparam int MAX_EXPONENT = (1 << (EXP_W - 1)) - 1;

  if (EXP_W < 3 || EXP_W > 15) begin : g_exp_w
    `OPENECHO_STOP(1, "EXP_W is %0d; exponents of 3 to 15 bits are supported", EXP_W);
  end else if (INT_W - 1 + SCALE > MAX_EXPONENT) begin : g_range
    `OPENECHO_STOP(1, "INT_W %0d and SCALE %0d reach 2^%0d; an exponent of %0d bits ends at 2^%0d", INT_W, SCALE,
                   INT_W - 1 + SCALE, EXP_W, MAX_EXPONENT);
  end
  if (FRAC_W < 2) begin : g_frac_w
    `OPENECHO_STOP(1, "FRAC_W is %0d; fractions of at least 2 bits are supported", FRAC_W);
  end
  if (INT_W < 2) begin : g_int_w
    `OPENECHO_STOP(1, "INT_W is %0d; a signed integer has at least 2 bits", INT_W);
  end
  if (FRAC < 0) begin : g_frac
    `OPENECHO_STOP(1, "FRAC is %0d; a fixed-point number has no fewer than 0 fractional bits", FRAC);
  end
endmodule

`undef OPENECHO_STOP

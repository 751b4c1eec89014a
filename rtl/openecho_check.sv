// Stops elaboration with a sentence when a parameter is outside what the core was built and verified for. Every module
// with parameters of the core instantiates it, so that a module used alone is guarded too.

// An elaboration task stops every tool but Icarus 11, which has none and stops at time 0 instead.
`ifdef __ICARUS__
`define OPENECHO_STOP initial $fatal
`else
`define OPENECHO_STOP $fatal
`endif

module openecho_check
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = MIN_TAPS,  // of a module without taps: what any filter needs
    parameter int DIFFERENCE_W = 2  // bits of the wider integer difference, in modules that see one
);
  localparam int LARGEST = (1 << (EXP_W - 1)) - 1;  // exponent of the largest float words

  if (SAMPLE_W < 8 || SAMPLE_W > 16) begin : g_sample_w
    `OPENECHO_STOP(1, "SAMPLE_W is %0d; samples of 8 to 16 bits are supported", SAMPLE_W);
  end
  if (EXP_W == 0) begin : g_fixed
    if (FRAC < 4 || FRAC > 24) begin : g_frac
      `OPENECHO_STOP(1, "FRAC is %0d; fixed-point positions carry 4 to 24 fraction bits", FRAC);
    end
  end else if (EXP_W < 5 || EXP_W > 11) begin : g_exp_w
    `OPENECHO_STOP(1, "EXP_W is %0d; 0, for fixed point, or exponents of 5 to 11 bits are supported", EXP_W);
  end else begin : g_float
    if (FRAC < 2 || FRAC > 52) begin : g_frac
      `OPENECHO_STOP(1, "FRAC is %0d; floating-point fractions of 2 to 52 bits are supported", FRAC);
    end
    // Two of each are added, below 2^(LARGEST + 1): nothing can become infinite.
    if ($clog2(MAX_SAMPLES) + 1 > LARGEST) begin : g_positions
      `OPENECHO_STOP(1, "EXP_W %0d ends at 2^%0d; sums of positions below MAX_SAMPLES %0d do not fit", EXP_W, LARGEST,
                     MAX_SAMPLES);
    end
    if (DIFFERENCE_W - TAP_FRAC > LARGEST) begin : g_differences
      `OPENECHO_STOP(1, "EXP_W %0d ends at 2^%0d; sums of differences of %0d bits times 2^-11 do not fit", EXP_W,
                     LARGEST, DIFFERENCE_W);
    end
    if (SAMPLE_W > LARGEST) begin : g_amplitudes
      `OPENECHO_STOP(1, "EXP_W %0d ends at 2^%0d; amplitudes of SAMPLE_W %0d do not fit", EXP_W, LARGEST, SAMPLE_W);
    end
  end
  if (TAP_COUNT < MIN_TAPS || TAP_COUNT > MAX_TAPS) begin : g_tap_count
    `OPENECHO_STOP(1, "TAP_COUNT is %0d; a filter has 4 to 48 taps", TAP_COUNT);
  end
  if (MAX_SAMPLES < TAP_COUNT + 2 || MAX_SAMPLES > 65536) begin : g_max_samples
    `OPENECHO_STOP(1, "MAX_SAMPLES is %0d; waveforms may be limited to TAP_COUNT + 2 up to 65536 samples", MAX_SAMPLES);
  end
endmodule

`undef OPENECHO_STOP

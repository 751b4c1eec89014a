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
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = MIN_TAPS  // of a module without taps: what any filter needs
);
  if (SAMPLE_W < 8 || SAMPLE_W > 16) begin : g_sample_w
    `OPENECHO_STOP(1, "SAMPLE_W is %0d; samples of 8 to 16 bits are supported", SAMPLE_W);
  end
  if (FRAC < 4 || FRAC > 24) begin : g_frac
    `OPENECHO_STOP(1, "FRAC is %0d; positions carry 4 to 24 fraction bits", FRAC);
  end
  if (TAP_COUNT < MIN_TAPS || TAP_COUNT > MAX_TAPS) begin : g_tap_count
    `OPENECHO_STOP(1, "TAP_COUNT is %0d; a filter has 4 to 48 taps", TAP_COUNT);
  end
  if (MAX_SAMPLES < TAP_COUNT + 2 || MAX_SAMPLES > 65536) begin : g_max_samples
    `OPENECHO_STOP(1, "MAX_SAMPLES is %0d; waveforms may be limited to TAP_COUNT + 2 up to 65536 samples", MAX_SAMPLES);
  end
endmodule

`undef OPENECHO_STOP

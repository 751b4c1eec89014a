// Constants, derived widths and layouts that more than one module needs. Everything here is stated once.
//
// Zhou 2022, in all headers: G. Zhou et al., LiDAR Echo Gaussian Decomposition Algorithm for FPGA Implementation,
// Sensors 22 (2022) 4628, doi:10.3390/s22124628.
//
// A tap set is passed as the first half of a symmetric impulse response, so that it is symmetric by construction:
// tap k of ceil(TAP_COUNT/2) stands at bits [TAP_W*k +: TAP_W] of one flat vector (Icarus 11 has no packed arrays of
// parameters). A symmetric filter delays every frequency by the same (TAP_COUNT-1)/2 bins, which is what allows the
// core to report positions in raw bins.
package openecho_pkg;

  // ---- noise statistics -------------------------------------------------------------------------------------------
  localparam int NOISE_SAMPLES = 50;  // Zhou 2022, section 2.1: the first 50 samples hold no echo
  localparam int AMP_FRAC = 8;  // fraction bits of amplitude, noise mean and deviation: 1/256 count
  localparam int ROOT_FRAC = 4;  // fraction bits of 50 x deviation: finer than AMP_FRAC after the division by 50

  // ---- run-time settings ------------------------------------------------------------------------------------------
  localparam int RATIO_W = 8;  // n of Eq (7) and k of the noise threshold: unsigned, 4.4 bits
  localparam int RATIO_FRAC = 4;

  // ---- filter taps ------------------------------------------------------------------------------------------------
  localparam int TAP_W = 16;  // signed
  localparam int MIN_TAPS = 4;
  localparam int MAX_TAPS = 48;
  localparam int TAPS_W = TAP_W * MAX_TAPS / 2;

  // Zhou 2022, Eq (11): a Gaussian of sigma 6 cut to 20 taps, times 2^11; the taps add up to 2050.
  localparam int PAPER_TAP_COUNT = 20;
  localparam logic [TAPS_W-1:0] PAPER_TAPS = {
    {(TAPS_W - 10 * TAP_W) {1'b0}}, 16'd150, 16'd146, 16'd138, 16'd127, 16'd114, 16'd99, 16'd84, 16'd69, 16'd55, 16'd43
  };

  // Tap k of the whole impulse response; zero outside it, and where an illegal count asks for more than there are.
  function automatic int tap(input logic [TAPS_W-1:0] taps, input int count, input int k);
    logic [TAP_W-1:0] value;
    int index;
    index = k < (count + 1) / 2 ? k : count - 1 - k;
    value = '0;
    if (index >= 0 && index < MAX_TAPS / 2) value = taps[TAP_W*index+:TAP_W];
    tap = {{(32 - TAP_W) {value[TAP_W-1]}}, value};
  endfunction

  // Tap k of the impulse response differenced `order` (0, 1, 2) times.
  function automatic int differenced_tap(input logic [TAPS_W-1:0] taps, input int count, input int order, input int k);
    differenced_tap = tap(taps, count, k);
    if (order == 1) differenced_tap = tap(taps, count, k) - tap(taps, count, k - 1);
    if (order == 2) begin
      differenced_tap = tap(taps, count, k) - 2 * tap(taps, count, k - 1) + tap(taps, count, k - 2);
    end
  endfunction

  // Bits of a signed word that holds any sum of the differenced taps times unsigned samples: the largest response is
  // that to full scale under all positive taps, or under all negative ones.
  function automatic int response_width(input logic [TAPS_W-1:0] taps, input int count, input int order,
                                        input int sample_w);
    int positive, negative, k;  // Icarus 11 takes no loop variable of its own in a constant function
    positive = 0;
    negative = 0;
    for (k = 0; k < count + order; k = k + 1) begin
      if (differenced_tap(taps, count, order, k) > 0) begin
        positive = positive + differenced_tap(taps, count, order, k);
      end else begin
        negative = negative - differenced_tap(taps, count, order, k);
      end
    end
    response_width = sample_w + $clog2((positive > negative ? positive : negative) + 1) + 1;
  endfunction

  // ---- arithmetic -------------------------------------------------------------------------------------------------
  // EXP_W = 0: positions are unsigned fixed point, in bins with FRAC fraction bits. Otherwise differences, positions,
  // widths, times and amplitudes are IEEE-754 words with EXP_W exponent and FRAC fraction bits. A word is declared
  // signed: its sign bit is where a two's complement integer has it, so that a comparison with zero is the same in both.
  localparam int TAP_FRAC = 11;  // Zhou 2022, Eq (11): taps are integers times 2^-11; float words are scaled so

  function automatic int float_width(input int exp_w, input int frac);
    float_width = 1 + exp_w + frac;
  endfunction

  // Bits of the first (order 1) or second difference between modules.
  function automatic int difference_width(input logic [TAPS_W-1:0] taps, input int count, input int order,
                                          input int sample_w, input int exp_w, input int frac);
    difference_width = exp_w > 0 ? float_width(exp_w, frac) : response_width(taps, count, order, sample_w);
  endfunction

  // Bits of a position.
  function automatic int position_width(input int exp_w, input int frac, input int max_samples);
    position_width = exp_w > 0 ? float_width(exp_w, frac) : $clog2(max_samples) + frac;
  endfunction

  // Bits of any field of an echo, the signed time among them, or of its waveform's trailer.
  function automatic int value_width(input int sample_w, input int exp_w, input int frac, input int max_samples);
    value_width = position_width(exp_w, frac, max_samples) + (exp_w > 0 ? 0 : 1);
    if (value_width < sample_w + AMP_FRAC) value_width = sample_w + AMP_FRAC;
    if (value_width < $clog2(max_samples) + 1) value_width = $clog2(max_samples) + 1;
  endfunction

  // ---- zeros of the differences that make a component --------------------------------------------------------------
  localparam logic [1:0] CROSSING_LEFT = 2'd0;  // of the second difference, from + to -
  localparam logic [1:0] CROSSING_PEAK = 2'd1;  // of the first difference, from + to -
  localparam logic [1:0] CROSSING_RIGHT = 2'd2;  // of the second difference, from - to +
  localparam logic [1:0] CROSSING_NONE = 2'd3;

  // ---- flags ------------------------------------------------------------------------------------------------------
  localparam int FLAGS_W = 3;
  // of an echo
  localparam int FLAG_SATURATED = 0;  // a raw sample of the interval is at full scale
  localparam int FLAG_TRUNCATED = 1;  // one inflection lies beyond the edge of the waveform; the edge stands for it
  localparam int FLAG_NO_PEAK = 2;  // a shoulder: the filtered waveform has no maximum here; peak repeats the centre
  // of a trailer
  localparam int FLAG_TOO_SHORT = 0;  // fewer than TAP_COUNT + 2 samples: nothing to decompose
  localparam int FLAG_TOO_LONG = 1;  // more than MAX_SAMPLES: the rest was skipped
  localparam int FLAG_NO_NOISE = 2;  // fewer than NOISE_SAMPLES: mean and deviation read 0

  // ---- record -----------------------------------------------------------------------------------------------------
  // One beat of the output stream is eight words; the second name is the trailer's use of the same word.
  localparam int RECORD_WORDS = 8;
  localparam int WORD_HEADER = 0;  // bit 31: trailer; low bits: flags
  localparam int WORD_SEQUENCE = 1;  // waveforms since reset
  localparam int WORD_NUMBER = 2;  // echo number from 0 | echo count
  localparam int WORD_CENTRE = 3;  // bins | length in samples
  localparam int WORD_PEAK = 4;  // bins | noise mean, counts with AMP_FRAC fraction bits
  localparam int WORD_WIDTH = 5;  // bins | 0
  localparam int WORD_TIME = 6;  // bins, signed | 0
  localparam int WORD_AMPLITUDE = 7;  // counts | noise deviation, counts with AMP_FRAC fraction bits
  localparam int HEADER_TRAILER = 31;
  localparam int SEQUENCE_W = 32;
  localparam int NUMBER_W = 16;

  // Bits of a record's word: 32 where every field fits, else 64.
  function automatic int record_word_width(input int sample_w, input int exp_w, input int frac, input int max_samples);
    record_word_width = value_width(sample_w, exp_w, frac, max_samples) <= 32 ? 32 : 64;
  endfunction

endpackage

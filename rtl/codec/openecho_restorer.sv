// One sample from the bits of its code, and how many bits that were: the inverse of openecho_predictor and
// openecho_coder, in one clock, because the next sample's prediction and code hang on this sample.
//
// The result is combinational; `take` moves the state on to the next sample, `start` sets it for a new waveform.
module openecho_restorer
  import openecho_codec_pkg::*;
#(
    parameter int SAMPLE_W = 11
) (
    input  logic                clk,
    input  logic                start,
    input  logic                take,
    input  logic                mode,
    input  logic [SAMPLE_W-1:0] threshold,
    input  logic [SAMPLE_W-1:0] baseline_even,
    input  logic [SAMPLE_W-1:0] baseline_odd,
    input  logic [        31:0] window,         // from the first bit of the code on
    output logic [SAMPLE_W-1:0] sample,
    output logic [         5:0] length
);
  localparam int BASELINE_W = SAMPLE_W + BASELINE_FRAC;

  // ---- what the prediction says -------------------------------------------------------------------------------------
  logic first_q, use_2;
  logic [SAMPLE_W-1:0] last_q, step_q, line, spread_0_q, spread_2_q, spread;
  logic [BASELINE_W-1:0] here_q, other_q;
  logic [SAMPLE_W:0] guess;  // in half counts; in counts in threshold mode
  logic [4:0] k;

  assign use_2 = mode && spread_2_q < spread_0_q;
  assign spread = use_2 ? spread_2_q : spread_0_q;
  assign line = last_q + step_q;
  assign guess = !mode ? {1'b0, here_q[BASELINE_W-1:BASELINE_FRAC]}
                 : use_2 ? {line, 1'b0} : here_q[BASELINE_W-1:BASELINE_FRAC-1];

  always_comb begin
    k = '0;
    for (int i = 0; i < SAMPLE_W; i++) begin
      if (!mode && threshold[i]) k = 5'(i + 1);
      if (mode && i > 0 && spread[i] && spread > 2) k = 5'(i);
    end
  end

  // ---- what the code says -------------------------------------------------------------------------------------------
  logic plain, escape;
  logic [4:0] zeros, skipped;
  logic [15:0] rest, unused_rest;  // no sample, and no part of one, is longer
  logic [SAMPLE_W-1:0] low, value, raw;
  logic [SAMPLE_W:0] folded, half_counts;
  logic [CREDIT_W-1:0] credit_q;
  logic signed [6:0] gain;

  assign plain = credit_q[CREDIT_W-1:ESCAPE_W] == 0;
  always_comb begin
    zeros = 5'(ESCAPE);
    for (int i = ESCAPE - 1; i >= 0; i--) if (window[31-i]) zeros = 5'(i);
  end
  assign escape              = mode ? zeros == 5'(ESCAPE) : window[31];
  assign skipped             = plain ? '0 : !mode ? 5'd1 : escape ? 5'(ESCAPE) : zeros + 5'd1;
  assign {rest, unused_rest} = window << skipped;
  assign raw                 = rest[15-:SAMPLE_W];
  assign low                 = SAMPLE_W'(rest >> (5'd16 - k));
  assign value               = (mode ? SAMPLE_W'(SAMPLE_W'(zeros) << k) : '0) | low;

  // Samples stand on even half counts: whether the sign was folded into the value is known from its lowest bit.
  assign folded              = {1'b0, value} ^ {(SAMPLE_W + 1) {mode && (guess[0] ^ value[0])}};
  assign half_counts         = guess + folded;
  assign sample              = plain || escape ? raw : mode ? half_counts[SAMPLE_W:1] : half_counts[SAMPLE_W-1:0];
  assign length              = 6'(skipped) + (plain || escape ? 6'(SAMPLE_W) : 6'(k));
  assign gain                = 7'(SAMPLE_W) - 7'(length);

  // ---- what the sample changes --------------------------------------------------------------------------------------
  logic [SAMPLE_W:0] error_0, renewed_0, renewed_2;
  logic [SAMPLE_W-1:0] step, error_2, folded_0, folded_2;
  logic [1:0] unused;

  assign error_0 = {sample, 1'b0} - here_q[BASELINE_W-1:BASELINE_FRAC-1];
  assign step = sample - last_q;
  assign error_2 = step - step_q;
  assign folded_0 = error_0[SAMPLE_W-1:0] ^ {SAMPLE_W{error_0[SAMPLE_W]}};
  assign folded_2 = {error_2[SAMPLE_W-2:0], 1'b0} ^ {SAMPLE_W{error_2[SAMPLE_W-1]}};
  assign renewed_0 = {1'b0, folded_0} + {1'b0, spread_0_q[SAMPLE_W-1:1], 1'b1};
  assign renewed_2 = {1'b0, folded_2} + {1'b0, spread_2_q[SAMPLE_W-1:1], 1'b1};
  assign unused = {renewed_0[0], renewed_2[0]};

  always_ff @(posedge clk) begin
    if (start) begin
      first_q <= 1'b1;
      here_q <= {baseline_even, 1'b1, (BASELINE_FRAC - 1)'(0)};
      other_q <= {baseline_odd, 1'b1, (BASELINE_FRAC - 1)'(0)};
      step_q <= '0;
      spread_0_q <= SAMPLE_W'(START_SPREAD);
      spread_2_q <= SAMPLE_W'(START_SPREAD);
      credit_q <= CREDIT_W'(START_CREDIT);
    end else if (take) begin
      first_q <= 1'b0;
      last_q  <= sample;
      if (!first_q) step_q <= step;
      here_q <= other_q;
      other_q <= !mode ? here_q : error_0[SAMPLE_W] ? here_q - BASELINE_W'(1) : here_q + BASELINE_W'(1);
      spread_0_q <= renewed_0[SAMPLE_W:1];
      if (!first_q) spread_2_q <= renewed_2[SAMPLE_W:1];
      if (!plain && !(credit_q[CREDIT_W-1] && !gain[6])) credit_q <= credit_q + CREDIT_W'(gain);
    end
  end
endmodule

// Which components stand out of their waveform's noise: amplitude = maximum - noise mean, exact, is to be at least
// min_amplitude and at least k * noise deviation. Integers in either arithmetic, so that EXP_W has no say in which
// components are echoes.
//
// `armed` rises 9 cycles after noise_valid, when k * deviation has been added up bit by bit of k, and falls when the
// noise figures are taken; until then they, and the settings, hold still. `load` takes the maximum into `amplitude`,
// where `subtract`, the cycle after, makes an amplitude of it; `kept` is known two cycles after `subtract`. `load` has to be
// set until `armed` rises. With `finish` it takes the noise deviation, as a trailer has it.
module openecho_threshold
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    localparam int AMP_W = SAMPLE_W + AMP_FRAC
) (
    input  logic                clk,
    input  logic                rst,
    input  logic [SAMPLE_W-1:0] min_amplitude,
    input  logic [ RATIO_W-1:0] k,
    input  logic                noise_valid,
    input  logic                noise_taken,
    input  logic [   AMP_W-1:0] noise_mean,
    input  logic [   AMP_W-1:0] noise_deviation,
    output logic                armed,
    input  logic                load,
    input  logic                subtract,
    input  logic                finish,
    input  logic [SAMPLE_W-1:0] maximum,
    output logic [   AMP_W-1:0] amplitude,
    output logic                kept
);
  localparam int LIMIT_W = AMP_W + RATIO_W;  // k * deviation, AMP_FRAC + RATIO_FRAC fraction bits
  localparam int STEP_W = $clog2(RATIO_W);

  logic started_q, digit_q, negative_q;
  logic [ STEP_W-1:0] bit_q;  // of k, the highest first
  logic [LIMIT_W-1:0] limit_q;

  always_ff @(posedge clk) begin
    digit_q <= k[bit_q];
    if (rst || !noise_valid || noise_taken) begin
      started_q <= 1'b0;
      armed <= 1'b0;
      bit_q <= '1;
      limit_q <= '0;
    end else begin
      started_q <= 1'b1;
      bit_q <= bit_q - 1'b1;
      if (started_q && !armed) begin
        armed   <= bit_q == '1;
        limit_q <= (limit_q << 1) + (digit_q ? LIMIT_W'(amplitude) : '0);
      end
    end
    if (load) amplitude <= {maximum, AMP_FRAC'(0)};
    if (subtract) {negative_q, amplitude} <= {1'b0, amplitude} - {1'b0, noise_mean};
    if (load && !armed || subtract && finish) amplitude <= noise_deviation;
    kept <= !negative_q && amplitude[AMP_W-1:AMP_FRAC] >= min_amplitude
            && {(RATIO_W - RATIO_FRAC)'(0), amplitude, RATIO_FRAC'(0)} >= limit_q;
  end
endmodule

// openecho_threshold: `armed` rises in the ARM_CYCLES-th cycle behind the first of noise_valid, never before, and falls
// when the figures are taken. From the cycle after `subtract` on, `amplitude` is that of the maximum loaded before, or
// with `finish` the deviation; a cycle later `kept` says whether it is at least min_amplitude and at least k * deviation.
// Both hold until the next `load`.
//
// Proved by induction, values included; the product is that of the operator *, and few bits wide, for the solver.
// Assumed: figures and settings hold still from noise_valid until they are taken; `load` is set until `armed` rises, and
// `subtract` comes only in the cycle after a `load` with `armed`. Free: figures, maxima, resets.
module threshold_formal
  import openecho_pkg::*;
#(
    parameter  int SAMPLE_W   = 4,
    parameter  int ARM_CYCLES = 9,
    localparam int AMP_W      = SAMPLE_W + AMP_FRAC
) (
    input logic                clk,
    input logic                rst,
    input logic [SAMPLE_W-1:0] min_amplitude,
    input logic [ RATIO_W-1:0] k,
    input logic                noise_valid,
    input logic                noise_taken,
    input logic [   AMP_W-1:0] noise_mean,
    input logic [   AMP_W-1:0] noise_deviation,
    input logic                load,
    input logic                subtract,
    input logic                finish,
    input logic [SAMPLE_W-1:0] maximum
);
  localparam int LIMIT_W = AMP_W + RATIO_W;

  logic started, armed, kept;
  logic [AMP_W-1:0] amplitude;

  openecho_threshold #(
      .SAMPLE_W(SAMPLE_W)
  ) dut (
      .clk,
      .rst,
      .min_amplitude,
      .k,
      .noise_valid,
      .noise_taken,
      .noise_mean,
      .noise_deviation,
      .armed,
      .load,
      .subtract,
      .finish,
      .maximum,
      .amplitude,
      .kept
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH  (2 * AMP_W + SAMPLE_W + RATIO_W),
      .ASSUMED(1'b1)
  ) u_noise (
      .clk,
      .rst,
      .valid  (noise_valid),
      .ready  (noise_taken),
      .payload({noise_mean, noise_deviation, min_amplitude, k})
  );

  logic [3:0] age_q;  // cycles for which the figures have been there
  logic loaded_q, latest_q, weighed_q, finish_q;  // a maximum, its amplitude, its verdict is there for these figures
  logic [SAMPLE_W-1:0] maximum_q;
  always_ff @(posedge clk) begin
    if (rst || !noise_valid || noise_taken) age_q <= '0;
    else if (32'(age_q) < ARM_CYCLES) age_q <= age_q + 1'b1;
    {loaded_q, latest_q, weighed_q} <= '0;
    if (!rst && noise_valid && !noise_taken && armed) begin
      loaded_q  <= load;
      latest_q  <= subtract || (latest_q && !load);
      weighed_q <= latest_q && !load;
    end
    if (load) maximum_q <= maximum;
    if (subtract) finish_q <= finish;
  end

  logic signed [AMP_W+1:0] over_mean;
  logic expected;
  assign over_mean = (AMP_W + 2)'({maximum_q, AMP_FRAC'(0)}) - (AMP_W + 2)'(noise_mean);
  assign expected = over_mean >= 0 && over_mean >= (AMP_W + 2)'({min_amplitude, AMP_FRAC'(0)})
      && (LIMIT_W + 2)'(over_mean) << RATIO_FRAC >= (LIMIT_W + 2)'(k) * (LIMIT_W + 2)'(noise_deviation);

  always_comb begin
    loads_until_armed : assume (armed || load);
    subtracts_a_maximum : assume (!subtract || (loaded_q && !load));
    if (started) begin
      armed_in_time : assert (armed == (32'(age_q) == ARM_CYCLES));
      keeps_what_stands_out : assert (!weighed_q || finish_q || kept == expected);
      amplitude_is_over_the_mean : assert (!latest_q || finish_q || over_mean < 0 || amplitude == AMP_W'(over_mean));
      deviation_of_an_end : assert (!latest_q || !finish_q || amplitude == noise_deviation);
      // For the induction: the bits of k that have been added up.
      age_in_range : assert (32'(age_q) <= ARM_CYCLES);
      starts_at_once : assert (dut.started_q == (age_q != '0));
      bits_in_turn : assert (armed || dut.bit_q == 3'(RATIO_W - 1) - 3'(age_q));
      bit_in_turn : assert (armed || age_q == '0 || dut.digit_q == k[RATIO_W-32'(age_q)]);
      limit_so_far :
      assert (age_q == '0 ? dut.limit_q == '0
              : dut.limit_q == (LIMIT_W'(k) >> (RATIO_W + 1 - 32'(age_q))) * LIMIT_W'(noise_deviation));
      adds_the_deviation : assert (armed || age_q == '0 || amplitude == noise_deviation);
      one_after_the_other : assert (!loaded_q || !latest_q);
      maximum_is_loaded : assert (!loaded_q || amplitude == {maximum_q, AMP_FRAC'(0)});
      sign_is_known : assert (!latest_q || finish_q || dut.negative_q == (over_mean < 0));
    end
    cover_kept : cover (started && weighed_q && !finish_q && kept && k != '0 && noise_deviation != '0);
    cover_below_the_noise : cover (started && weighed_q && !finish_q && !kept && over_mean > 0 && min_amplitude == '0);
    cover_below_the_least : cover (started && weighed_q && !finish_q && !kept && over_mean > 0 && k == '0);
    cover_below_the_mean : cover (started && latest_q && !finish_q && over_mean < 0);
    cover_next_figures : cover (started && noise_valid && age_q == '0 && dut.negative_q);
  end
endmodule

// The power-up contract: reset is high in the first cycle. Later it is as the solver likes. `started` is low in that
// cycle alone, in which registers are anything and nothing is claimed.
module reset_formal (
    input  logic clk,
    input  logic rst,
    output logic started
);
  logic started_q = 1'b0;

  always_ff @(posedge clk) started_q <= 1'b1;

  always_comb begin
    at_first : assume (started_q || rst);
  end

  assign started = started_q;
endmodule

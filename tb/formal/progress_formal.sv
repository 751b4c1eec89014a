// Progress in bounded time: `waiting` is never high for more than LIMIT cycles in a row. `to_go` is a bound, from what
// is in the module, of the cycles that it has yet to wait: without it the proof would have to look LIMIT cycles back.
module progress_formal #(
    parameter int LIMIT = 1
) (
    input logic clk,
    input logic rst,
    input logic waiting,
    input int   to_go
);
  logic [$clog2(LIMIT + 2)-1:0] waited_q = '0;

  always_ff @(posedge clk) waited_q <= rst || !waiting ? '0 : waited_q + 1'b1;

  always_comb begin
    in_time : assert (32'(waited_q) + (waiting ? to_go : 0) <= LIMIT);
    cover_waits : cover (waited_q != '0);
  end
endmodule

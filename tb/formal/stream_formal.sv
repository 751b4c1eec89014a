// The contract of a stream: what is offered stays, unchanged, until it is taken. `payload` is all fields of a beat,
// with `last`.
//
// ASSUMED 0 proves it of an output of the module under proof, 1 demands it of the solver where that drives an input.
// Here as in all harnesses a step of the solver is a clock cycle, and a property stands in always_comb: it is judged in
// the cycle that it speaks of.
module stream_formal #(
    parameter int WIDTH   = 1,
    parameter bit ASSUMED = 1'b0
) (
    input logic             clk,
    input logic             rst,
    input logic             valid,
    input logic             ready,
    input logic [WIDTH-1:0] payload
);
  logic stalled_q = 1'b0;
  logic [WIDTH-1:0] payload_q;

  always_ff @(posedge clk) begin
    stalled_q <= !rst && valid && !ready;
    payload_q <= payload;
  end

  if (ASSUMED) begin : g_assumed
    always_comb begin
      if (stalled_q) begin
        held : assume (valid);
        unchanged : assume (payload == payload_q);
      end
    end
  end else begin : g_proved
    always_comb begin
      if (stalled_q) begin
        held : assert (valid);
        unchanged : assert (payload == payload_q);
      end
      cover_stall : cover (stalled_q);
    end
  end
endmodule

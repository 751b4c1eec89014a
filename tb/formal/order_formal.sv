// Nothing is lost, duplicated, invented or overtaken: the n-th beat in is the n-th beat out, with the same payload.
//
// The solver marks one beat that goes in, any one it likes (`mark`, free). How many beats were inside before it is
// known then, and so which beat out has to be this one; what holds for any one beat holds for all. `count` is bounded
// by CAPACITY, what the module has room for: the counter never wraps. A module that is induced over adds where the
// marked beat is while it is inside, from `marked`, `ahead` and `content`.
//
// `out` is the transfer out, `out_valid` its offer: an offer with nothing inside is an invention.
module order_formal #(
    parameter int WIDTH = 1,
    parameter int CAPACITY = 1,
    localparam int COUNT_W = $clog2(CAPACITY + 2)
) (
    input  logic             clk,
    input  logic             rst,
    input  logic             mark,
    input  logic             in,
    input  logic [WIDTH-1:0] in_payload,
    input  logic             out_valid,
    input  logic             out,
    input  logic [WIDTH-1:0] out_payload,
    output int               count,        // beats in the module
    output logic             marked,       // one of them is the marked one,
    output int               ahead,        // behind so many others,
    output logic [WIDTH-1:0] content       // and this is in it
);
  logic [COUNT_W-1:0] count_q = '0, ahead_q;
  logic marked_q = 1'b0;
  logic [WIDTH-1:0] content_q;

  always_ff @(posedge clk) begin
    if (rst) begin
      count_q  <= '0;
      marked_q <= 1'b0;
    end else begin
      count_q <= count_q + COUNT_W'(in) - COUNT_W'(out);
      if (!marked_q && mark && in) begin
        marked_q  <= 1'b1;
        ahead_q   <= count_q - COUNT_W'(out);
        content_q <= in_payload;
      end else if (marked_q && out) begin
        marked_q <= ahead_q != '0;
        ahead_q  <= ahead_q - 1'b1;
      end
    end
  end

  always_comb begin
    bounded : assert (count_q <= COUNT_W'(CAPACITY));
    nothing_invented : assert (!out_valid || count_q != '0);
    marked_is_inside : assert (!marked_q || ahead_q < count_q);
    in_its_turn_unchanged : assert (!(out_valid && marked_q && ahead_q == '0) || out_payload == content_q);
    cover_several : cover (32'(count_q) == (CAPACITY < 2 ? CAPACITY : 2));
    cover_marked_leaves : cover (out && marked_q && ahead_q == '0);
  end

  assign count   = 32'(count_q);
  assign marked  = marked_q;
  assign ahead   = 32'(ahead_q);
  assign content = content_q;
endmodule

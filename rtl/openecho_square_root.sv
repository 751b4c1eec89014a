// Digits of floor(sqrt(radicand)), highest first: in each cycle with `advance` two bits of the radicand go in, also the
// highest first, and the digit that they decide comes out a cycle later. `clear` prepares for a new radicand.
//
// Non-restoring: a digit of 0 leaves the remainder negative, and the next step adds where it would subtract. So a digit
// costs one adder and no multiplexer. Exact; what remains after the last digit is not needed.
module openecho_square_root #(
    parameter int ROOT_W = 20
) (
    input  logic       clk,
    input  logic       clear,
    input  logic       advance,
    input  logic [1:0] pair,
    output logic       digit
);
  logic [ROOT_W-2:0] root_q;
  logic [ROOT_W-1:0] remainder_q;  // without its sign, which is that of the last digit
  logic [ROOT_W+1:0] remainder;

  // 4 remainder + pair - {root, 01} after a 1, + {root, 11} after a 0, which is - {~root, 01}. Written as a difference:
  // Yosys swaps the operands of a sum as it likes, and where the carry chain gets the one behind the XOR, that takes
  // LUTs of its own.
  assign remainder = {remainder_q, pair} - {{1'b0, root_q} ^ {ROOT_W{!root_q[0]}}, 2'b01};
  assign digit = root_q[0];

  always_ff @(posedge clk) begin
    if (clear) begin
      root_q <= '0;
      remainder_q <= '1;  // -1, as after a 0
    end else if (advance) begin
      root_q <= {root_q[ROOT_W-3:0], !remainder[ROOT_W+1]};
      remainder_q <= remainder[ROOT_W-1:0];
    end
  end
endmodule

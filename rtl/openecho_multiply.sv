// Sums of products: total = -1 + sum a b, of the pairs from the one with `first` to the one with `last`; each b comes a
// cycle before its a. There is a pair in each cycle, and b = 0 leaves the sum as it is. From the cycle after `done` on,
// `total` holds a sum, until the next is about to come. Exact, modulo 2^TOTAL_W. It starts from -1 so that the
// complement of `total` is the size of a sum that is not positive.
//
// DSP 1: the multiplier, its registers and the accumulator are those of a DSP block. ROWS = 2.
//
// DSP 0: Booth's digits of b, two bits each, are -2, -1, 0, 1 or 2. A row adds so many times a to a quarter of the sum
// of the row before, which costs one LUT6 a bit. Two bits of the product are final with each row and go into the total
// there, which carries into the next row's a cycle later. So a path has one carry chain, at most that of the last row's
// share of the total, TOTAL_W - 2 ROWS + 2 bits. ROWS = floor(B_W / 2) + 1.
//
// Latency from `last` to `done`: ROWS + 1 cycles.
module openecho_multiply #(
    parameter int A_W = 19,
    parameter int B_W = 11,
    parameter int TOTAL_W = 32,
    parameter bit DSP = 1'b1
) (
    input  logic                      clk,
    input  logic                      rst,
    input  logic                      first,  // with a
    input  logic                      last,
    input  logic signed [    A_W-1:0] a,
    input  logic        [    B_W-1:0] b,
    output logic                      done,
    output logic        [TOTAL_W-1:0] total
);
  localparam int ROWS = DSP ? 2 : B_W / 2 + 1;

  logic [ROWS-1:0] first_q;
  logic [  ROWS:0] last_q;
  assign done = last_q[ROWS];

  always_ff @(posedge clk) begin
    first_q <= rst ? '0 : {first_q[ROWS-2:0], first};
    last_q  <= rst ? '0 : {last_q[ROWS-1:0], last};
  end

  if (DSP) begin : g_dsp
    logic signed [A_W-1:0] a_q;
    logic [B_W-1:0] b_q, b_q2;
    logic signed [A_W+B_W-1:0] product_q;
    logic signed [TOTAL_W-1:0] start, sum_q;
    logic [TOTAL_W-1:0] total_q;
    assign start = first_q[1] ? '1 : sum_q;
    assign total = total_q;
    always_ff @(posedge clk) begin
      a_q <= a;
      b_q <= b;
      b_q2 <= b_q;
      product_q <= a_q * $signed({1'b0, b_q2});
      sum_q <= TOTAL_W'(product_q) + start;
      if (last_q[2]) total_q <= sum_q;
    end
  end else begin : g_soft
    for (genvar r = 0; r < ROWS; r++) begin : g_row
      // What this row works on: a, and the sum of the rows before. A cycle ahead: the bits of b from here on, and below
      // them the last one before.
      localparam int LEFT_W = 2 * (ROWS - r) + 1;
      logic signed [A_W-1:0] a_in;
      logic [LEFT_W-1:0] left_in;
      logic signed [A_W:0] sum_in;
      logic carry_in;
      if (r == 0) begin : g_first
        assign a_in = a;
        assign left_in = LEFT_W'({b, 1'b0});
        assign sum_in = '0;
        assign carry_in = 1'b0;
      end else begin : g_next
        assign a_in = g_row[r-1].a_q;
        assign left_in = g_row[r-1].left_q;
        assign sum_in = g_row[r-1].sum_q >>> 2;
        assign carry_in = g_row[r-1].carry_q;
      end

      // Plus is minus the complement minus one. Differences, for the reason that openecho_square_root states.
      logic one_q, two_q, plus_q, unused_borrow;
      logic [A_W:0] multiple, sum;
      assign multiple = ({a_in[A_W-1], a_in} & {(A_W + 1) {one_q}}) | ({a_in, 1'b0} & {(A_W + 1) {two_q}});
      assign {sum, unused_borrow} = {sum_in, 1'b0} - {multiple ^ {(A_W + 1) {plus_q}}, plus_q};

      logic signed [A_W-1:0] a_q;
      logic [LEFT_W-3:0] left_q;
      logic signed [A_W:0] sum_q;
      always_ff @(posedge clk) begin
        left_q <= left_in[LEFT_W-1:2];
        one_q <= left_in[1] != left_in[0];
        two_q <= left_in[1] == left_in[0] && left_in[2] != left_in[1];
        plus_q <= !left_in[2];
        a_q <= a_in;
        sum_q <= sum;
      end

      // The row's share of the total.
      localparam int SHARE_W = r < ROWS - 1 ? 2 : TOTAL_W - 2 * r;
      logic carry, carry_q, unused_low;
      logic [SHARE_W-1:0] start, share, share_q, total_q;
      assign start = first_q[r] ? '1 : share_q;
      assign {carry, share, unused_low} = {1'b0, SHARE_W'(sum_q), carry_in} + {1'b0, start, carry_in};
      assign total[2*r+:SHARE_W] = total_q;
      always_ff @(posedge clk) begin
        carry_q <= carry;
        share_q <= share;
        if (last_q[r+1]) total_q <= share_q;
      end
    end

    logic unused_end;
    assign unused_end = ^{g_row[ROWS-1].a_q, g_row[ROWS-1].left_q, g_row[ROWS-1].carry_q};
  end
endmodule

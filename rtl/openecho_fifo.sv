// First in, first out, in distributed RAM: the oldest word stands at the output without being asked for.
//
// Latency 1 cycle; one word a clock in and out. `s_ready` falls when DEPTH words wait: nothing is overwritten. DEPTH is
// a power of two, so that the pointers wrap by themselves.
module openecho_fifo #(
    parameter int WIDTH = 8,
    parameter int DEPTH = 16
) (
    input  logic                   clk,
    input  logic                   rst,
    input  logic                   s_valid,
    output logic                   s_ready,
    input  logic [      WIDTH-1:0] s_data,
    output logic                   m_valid,
    input  logic                   m_ready,
    output logic [      WIDTH-1:0] m_data,
    output logic [$clog2(DEPTH):0] level     // words that wait
);
  localparam int ADDRESS_W = $clog2(DEPTH);

  logic [WIDTH-1:0] memory[DEPTH];
  logic [ADDRESS_W-1:0] write_q, read_q;
  logic push, pop;

  assign s_ready = !level[ADDRESS_W];
  assign m_data = memory[read_q];
  assign push = s_valid && s_ready;
  assign pop = m_valid && m_ready;

  always_ff @(posedge clk) begin
    if (push) memory[write_q] <= s_data;
  end

  always_ff @(posedge clk) begin
    if (rst) begin
      write_q <= '0;
      read_q  <= '0;
      level   <= '0;
      m_valid <= 1'b0;
    end else begin
      write_q <= write_q + ADDRESS_W'(push);
      read_q  <= read_q + ADDRESS_W'(pop);
      if (push != pop) level <= level + {{ADDRESS_W{pop}}, 1'b1};
      m_valid <= push || level > 1 || (m_valid && !pop);
    end
  end
endmodule

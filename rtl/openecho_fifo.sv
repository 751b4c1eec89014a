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
  logic [ADDRESS_W:0] write_q, read_q;  // one bit more than the address tells full from empty

  assign level   = write_q - read_q;
  assign s_ready = write_q != {!read_q[ADDRESS_W], read_q[ADDRESS_W-1:0]};
  assign m_valid = write_q != read_q;
  assign m_data  = memory[read_q[ADDRESS_W-1:0]];

  always_ff @(posedge clk) begin
    if (s_valid && s_ready) memory[write_q[ADDRESS_W-1:0]] <= s_data;
  end

  always_ff @(posedge clk) begin
    if (rst) begin
      write_q <= '0;
      read_q  <= '0;
    end else begin
      if (s_valid && s_ready) write_q <= write_q + 1'b1;
      if (m_valid && m_ready) read_q <= read_q + 1'b1;
    end
  end
endmodule

// openecho_fifo: never over- or underfull, `level` is the number of words inside, and the n-th word in is the n-th word
// out, unchanged. Proved by induction: for any length of time, with any stalls, gaps and resets.
//
// Induction has to be told where the marked word is, `ahead` places behind the oldest, and that the pointers agree.
module fifo_formal #(
    parameter int WIDTH = 4,
    parameter int DEPTH = 4
) (
    input logic             clk,
    input logic             rst,
    input logic             mark,
    input logic             s_valid,
    input logic [WIDTH-1:0] s_data,
    input logic             m_ready
);
  localparam int ADDRESS_W = $clog2(DEPTH);

  logic started, s_ready, m_valid, marked;
  logic [WIDTH-1:0] m_data, content;
  int count, ahead;
  logic [  ADDRESS_W:0] level;
  logic [ADDRESS_W-1:0] place;

  openecho_fifo #(
      .WIDTH(WIDTH),
      .DEPTH(DEPTH)
  ) dut (
      .clk,
      .rst,
      .s_valid,
      .s_ready,
      .s_data,
      .m_valid,
      .m_ready,
      .m_data,
      .level
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  stream_formal #(
      .WIDTH(WIDTH)
  ) u_output (
      .clk,
      .rst,
      .valid  (started && m_valid),
      .ready  (m_ready),
      .payload(m_data)
  );

  order_formal #(
      .WIDTH(WIDTH),
      .CAPACITY(DEPTH)
  ) u_words (
      .clk,
      .rst,
      .mark,
      .in(s_valid && s_ready),
      .in_payload(s_data),
      .out_valid(started && m_valid),
      .out(m_valid && m_ready),
      .out_payload(m_data),
      .count,
      .marked,
      .ahead,
      .content
  );

  assign place = ADDRESS_W'(dut.read_q) + ADDRESS_W'(ahead);

  always_comb begin
    if (started) begin
      level_is_words_inside : assert (32'(level) == count);
      offers_unless_empty : assert (m_valid == (count != 0));
      accepts_unless_full : assert (s_ready == (count != DEPTH));
      pointers_agree : assert (dut.write_q == dut.read_q + ADDRESS_W'(level));
      marked_is_in_its_place : assert (!marked || dut.memory[place] == content);
    end
    cover_full_stalls : cover (started && s_valid && !s_ready);
  end
endmodule

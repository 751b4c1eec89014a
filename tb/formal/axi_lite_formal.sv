// openecho_axi_lite: each address and each datum of a write is part of one write, in order; each write is answered once,
// with what its owner said in its cycle, and each read with what it said in the cycle of its address. Answers stay until
// they are taken; nothing is answered that nothing asked for. A manager that takes answers at once never waits longer than
// 3 cycles until both parts of a write can be taken, nor with a read while none is under way.
//
// Proved by induction. Free: everything, resets among it, and a manager that takes back what it offers.
module axi_lite_formal #(
    parameter int ADDRESS_W = 4
) (
    input logic                 clk,
    input logic                 rst,
    input logic                 mark,
    input logic [ADDRESS_W-1:0] s_axi_awaddr,
    input logic                 s_axi_awvalid,
    input logic [         31:0] s_axi_wdata,
    input logic [          3:0] s_axi_wstrb,
    input logic                 s_axi_wvalid,
    input logic                 s_axi_bready,
    input logic [ADDRESS_W-1:0] s_axi_araddr,
    input logic                 s_axi_arvalid,
    input logic                 s_axi_rready,
    input logic                 write_refused,
    input logic [         31:0] read_data,
    input logic                 read_refused
);
  localparam logic [1:0] OKAY = 2'b00, SLVERR = 2'b10;

  logic started, awready, wready, bvalid, arready, rvalid, write_valid;
  logic [1:0] bresp, rresp;
  logic [31:0] rdata, write_data;
  logic [ADDRESS_W-1:0] write_address, read_address;
  logic [3:0] write_strobe;

  openecho_axi_lite #(
      .ADDRESS_W(ADDRESS_W)
  ) dut (
      .aclk(clk),
      .aresetn(!rst),
      .s_axi_awaddr,
      .s_axi_awvalid,
      .s_axi_awready(awready),
      .s_axi_wdata,
      .s_axi_wstrb,
      .s_axi_wvalid,
      .s_axi_wready(wready),
      .s_axi_bresp(bresp),
      .s_axi_bvalid(bvalid),
      .s_axi_bready,
      .s_axi_araddr,
      .s_axi_arvalid,
      .s_axi_arready(arready),
      .s_axi_rdata(rdata),
      .s_axi_rresp(rresp),
      .s_axi_rvalid(rvalid),
      .s_axi_rready,
      .write_valid,
      .write_address,
      .write_data,
      .write_strobe,
      .write_refused,
      .read_address,
      .read_data,
      .read_refused
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  // ---- a write: address and data in, a write to its owner, an answer out ---------------------------------------------
  int addresses, data, answers, ahead[4];
  logic marked[4];
  logic [ADDRESS_W-1:0] address;
  logic [35:0] datum;
  logic [1:0] answer;

  order_formal #(
      .WIDTH(ADDRESS_W),
      .CAPACITY(1)
  ) u_addresses (
      .clk,
      .rst,
      .mark,
      .in(s_axi_awvalid && awready),
      .in_payload({s_axi_awaddr[ADDRESS_W-1:2], 2'b00}),
      .out_valid(started && write_valid),
      .out(write_valid),
      .out_payload(write_address),
      .count(addresses),
      .marked(marked[0]),
      .ahead(ahead[0]),
      .content(address)
  );

  order_formal #(
      .WIDTH(36),
      .CAPACITY(1)
  ) u_data (
      .clk,
      .rst,
      .mark,
      .in(s_axi_wvalid && wready),
      .in_payload({s_axi_wstrb, s_axi_wdata}),
      .out_valid(started && write_valid),
      .out(write_valid),
      .out_payload({write_strobe, write_data}),
      .count(data),
      .marked(marked[1]),
      .ahead(ahead[1]),
      .content(datum)
  );

  order_formal #(
      .WIDTH(2),
      .CAPACITY(1)
  ) u_answers (
      .clk,
      .rst,
      .mark,
      .in(write_valid),
      .in_payload(write_refused ? SLVERR : OKAY),
      .out_valid(started && bvalid),
      .out(bvalid && s_axi_bready),
      .out_payload(bresp),
      .count(answers),
      .marked(marked[2]),
      .ahead(ahead[2]),
      .content(answer)
  );

  stream_formal #(
      .WIDTH(2)
  ) u_b (
      .clk,
      .rst,
      .valid  (started && bvalid),
      .ready  (s_axi_bready),
      .payload(bresp)
  );

  // ---- a read: an address in, an answer out --------------------------------------------------------------------------
  int reads;
  logic [33:0] read_answer, read_content;
  assign read_answer = read_refused ? {SLVERR, 32'b0} : {OKAY, read_data};

  order_formal #(
      .WIDTH(34),
      .CAPACITY(1)
  ) u_reads (
      .clk,
      .rst,
      .mark,
      .in(s_axi_arvalid && arready),
      .in_payload(read_answer),
      .out_valid(started && rvalid),
      .out(rvalid && s_axi_rready),
      .out_payload({rresp, rdata}),
      .count(reads),
      .marked(marked[3]),
      .ahead(ahead[3]),
      .content(read_content)
  );

  stream_formal #(
      .WIDTH(34)
  ) u_r (
      .clk,
      .rst,
      .valid  (started && rvalid),
      .ready  (s_axi_rready),
      .payload({rresp, rdata})
  );

  progress_formal #(
      .LIMIT(3)
  ) u_write_progress (
      .clk,
      .rst,
      .waiting(started && dut.awake_q && s_axi_bready && s_axi_awvalid && s_axi_wvalid && !(awready && wready)),
      .to_go  (answers == 1 ? 1 : addresses == 1 && data == 1 ? 2 : 3)
  );

  logic asleep_q, refused_q;
  always_ff @(posedge clk) begin
    asleep_q  <= rst;
    refused_q <= !rst && (refused_q || (write_valid && write_refused));
  end

  always_comb begin
    if (started) begin
      reads_the_address : assert (read_address == {s_axi_araddr[ADDRESS_W-1:2], 2'b00});
      nothing_is_taken_in_reset : assert (!asleep_q || !(awready || wready || arready));
      reads_at_once : assert (!dut.awake_q || arready == (reads == 0));
      // For the induction.
      awake_behind_reset : assert (dut.awake_q == !asleep_q);
      address_is_held : assert (dut.address_held_q == (addresses == 1));
      datum_is_held : assert (dut.data_held_q == (data == 1));
      answer_is_held : assert (bvalid == (answers == 1));
      read_is_held : assert (rvalid == (reads == 1));
      nothing_beside_an_answer : assert (answers == 0 || (addresses == 0 && data == 0));
      same_address : assert (!marked[0] || write_address == address);
      same_datum : assert (!marked[1] || {write_strobe, write_data} == datum);
      same_answer : assert (!marked[2] || bresp == answer);
      same_read : assert (!marked[3] || {rresp, rdata} == read_content);
    end
    cover_data_first : cover (started && data == 1 && addresses == 0 && s_axi_awvalid);
    cover_address_first : cover (started && addresses == 1 && data == 0 && s_axi_wvalid);
    cover_second_answer : cover (started && refused_q && bvalid && bresp == OKAY);
  end
endmodule

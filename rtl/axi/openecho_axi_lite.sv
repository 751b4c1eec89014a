// AXI4-Lite subordinate: turns transfers into a write of one word, or a read of one, that its owner grants or refuses.
//
// Address and data of a write come in any order. When both are here, `write_valid` is high for one cycle; a refusal in
// that cycle answers SLVERR, as does one of a read in the cycle in which its address is taken. One write and one read
// are under way at a time: a write takes 3 cycles and a read 2, longer if their answer has to wait. Ready and valid
// come from registers alone, and ready is low in reset. The two low address bits name a byte of the word: they are not
// looked at, as strobes say what is written. AxPROT is left out: whoever reaches the registers may use them.
module openecho_axi_lite #(
    parameter int ADDRESS_W = 12
) (
    input  logic                 aclk,
    input  logic                 aresetn,
    input  logic [ADDRESS_W-1:0] s_axi_awaddr,
    input  logic                 s_axi_awvalid,
    output logic                 s_axi_awready,
    input  logic [         31:0] s_axi_wdata,
    input  logic [          3:0] s_axi_wstrb,
    input  logic                 s_axi_wvalid,
    output logic                 s_axi_wready,
    output logic [          1:0] s_axi_bresp,
    output logic                 s_axi_bvalid,
    input  logic                 s_axi_bready,
    input  logic [ADDRESS_W-1:0] s_axi_araddr,
    input  logic                 s_axi_arvalid,
    output logic                 s_axi_arready,
    output logic [         31:0] s_axi_rdata,
    output logic [          1:0] s_axi_rresp,
    output logic                 s_axi_rvalid,
    input  logic                 s_axi_rready,
    output logic                 write_valid,
    output logic [ADDRESS_W-1:0] write_address,  // of a word: the low two bits are 0
    output logic [         31:0] write_data,
    output logic [          3:0] write_strobe,
    input  logic                 write_refused,
    output logic [ADDRESS_W-1:0] read_address,   // as above
    input  logic [         31:0] read_data,
    input  logic                 read_refused
);
  localparam logic [1:0] OKAY = 2'b00;
  localparam logic [1:0] SLVERR = 2'b10;

  logic awake_q;  // low in reset and until the first edge after it
  logic address_held_q, data_held_q;
  logic unused_low_bits;

  assign unused_low_bits = ^{s_axi_awaddr[1:0], s_axi_araddr[1:0]};
  assign s_axi_awready = awake_q && !address_held_q && !s_axi_bvalid;
  assign s_axi_wready = awake_q && !data_held_q && !s_axi_bvalid;
  assign s_axi_arready = awake_q && !s_axi_rvalid;
  assign write_valid = address_held_q && data_held_q;
  assign read_address = {s_axi_araddr[ADDRESS_W-1:2], 2'b00};

  always_ff @(posedge aclk) begin
    awake_q <= aresetn;
    if (!aresetn) begin
      address_held_q <= 1'b0;
      data_held_q <= 1'b0;
      s_axi_bvalid <= 1'b0;
      s_axi_rvalid <= 1'b0;
    end else begin
      if (write_valid) begin
        address_held_q <= 1'b0;
        data_held_q <= 1'b0;
        s_axi_bvalid <= 1'b1;
      end else begin
        if (s_axi_awvalid && s_axi_awready) address_held_q <= 1'b1;
        if (s_axi_wvalid && s_axi_wready) data_held_q <= 1'b1;
        if (s_axi_bready) s_axi_bvalid <= 1'b0;
      end
      if (s_axi_arvalid && s_axi_arready) s_axi_rvalid <= 1'b1;
      else if (s_axi_rready) s_axi_rvalid <= 1'b0;
    end
    if (s_axi_awready) write_address <= {s_axi_awaddr[ADDRESS_W-1:2], 2'b00};
    if (s_axi_wready) begin
      write_data   <= s_axi_wdata;
      write_strobe <= s_axi_wstrb;
    end
    if (write_valid) s_axi_bresp <= write_refused ? SLVERR : OKAY;
    if (s_axi_arready) begin
      s_axi_rdata <= read_refused ? '0 : read_data;
      s_axi_rresp <= read_refused ? SLVERR : OKAY;
    end
  end
endmodule

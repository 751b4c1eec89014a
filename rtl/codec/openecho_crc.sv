// CRC-32 of one more sample: the remainder of the samples' bits so far, highest first, divided by z^32 + z^22 + z^2 + z + 1
// (primitive: P. Alfke, XAPP052, 1996). Combinational. The polynomial of Ethernet, with 14 terms, takes twice the LUTs; any
// burst of up to 32 bits is found with either.
module openecho_crc #(
    parameter int SAMPLE_W = 11
) (
    input  logic [        31:0] s_crc,
    input  logic [SAMPLE_W-1:0] s_sample,
    output logic [        31:0] m_crc
);
  localparam logic [31:0] POLYNOMIAL = 32'h0040_0007;

  logic [31:0] rest[SAMPLE_W+1];
  assign rest[0] = s_crc;
  assign m_crc   = rest[SAMPLE_W];
  for (genvar i = 0; i < SAMPLE_W; i++) begin : g_bit
    assign rest[i+1] = {rest[i][30:0], 1'b0} ^ (POLYNOMIAL & {32{rest[i][31] ^ s_sample[SAMPLE_W-1-i]}});
  end
endmodule

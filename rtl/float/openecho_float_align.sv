// m_value = floor(s_value / 2^s_amount), with m_sticky set where a one was shifted out. Exact up to that bit: whatever
// comes after can still round correctly.
//
// Latency 1 cycle of `advance`, one value a clock. `s_pass` travels along. Shifts by two bits of the amount at a time:
// a four-way multiplexer is a LUT a bit, so this takes half the LUTs of a shifter by single bits. Amounts that shift
// everything out are all the same and are clamped.
module openecho_float_align #(
    parameter int WIDTH = 55,
    parameter int AMOUNT_W = 11,
    parameter int PASS_W = 1
) (
    input  logic                clk,
    input  logic                rst,
    input  logic                advance,
    input  logic                s_valid,
    input  logic [   WIDTH-1:0] s_value,
    input  logic [AMOUNT_W-1:0] s_amount,
    input  logic [  PASS_W-1:0] s_pass,
    output logic                m_valid,
    output logic [   WIDTH-1:0] m_value,
    output logic                m_sticky,
    output logic [  PASS_W-1:0] m_pass
);
  localparam int LEVELS = ($clog2(WIDTH + 1) + 1) / 2;
  localparam int STEPS_W = 2 * LEVELS;

  logic [STEPS_W-1:0] steps;
  assign steps = s_amount >> STEPS_W != '0 ? '1 : STEPS_W'(s_amount);

  for (genvar i = LEVELS - 1; i >= 0; i--) begin : g_level
    localparam int UNIT = 4 ** i;
    logic [WIDTH-1:0] value_in, value;
    logic sticky_in, sticky;
    logic [1:0] digit;
    logic [3*UNIT-1:0] low;
    if (i == LEVELS - 1) begin : g_first
      assign value_in  = s_value;
      assign sticky_in = 1'b0;
    end else begin : g_next
      assign value_in  = g_level[i+1].value;
      assign sticky_in = g_level[i+1].sticky;
    end
    assign digit = steps[2*i+:2];
    assign value = value_in >> digit * UNIT;
    assign low = (3 * UNIT)'(value_in);
    assign sticky = sticky_in || (digit > 0 && low[UNIT-1:0] != '0) || (digit > 1 && low[2*UNIT-1:UNIT] != '0) ||
                    (digit > 2 && low[3*UNIT-1:2*UNIT] != '0);
  end

  always_ff @(posedge clk) begin
    if (rst) m_valid <= 1'b0;
    else if (advance) m_valid <= s_valid;
    if (advance) begin
      m_value  <= g_level[0].value;
      m_sticky <= g_level[0].sticky;
      m_pass   <= s_pass;
    end
  end
endmodule

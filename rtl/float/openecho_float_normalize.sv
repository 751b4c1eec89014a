// m_value = s_value * 2^m_count, where m_count is the number of leading zeros of s_value, but at most s_limit. A limit
// of exponent - 1 leaves a subnormal result where the format puts it. For s_value = 0, m_count means nothing.
//
// Latency LEVELS = ceil(log4(WIDTH)) cycles of `advance`, one value a clock; exact. `s_pass` travels along. Each stage
// looks at the top three groups of 4^i bits and shifts by the empty ones: one digit of the count in base 4, found and
// applied with a four-way multiplexer (a LUT a bit) and no counter of leading zeros beside it. The minimum of count and
// limit is taken digit by digit: from the first digit on where the count is below the limit, the limit is out of play.
module openecho_float_normalize #(
    parameter int WIDTH   = 57,
    parameter int LIMIT_W = 11,
    parameter int PASS_W  = 1
) (
    input  logic               clk,
    input  logic               rst,
    input  logic               advance,
    input  logic               s_valid,
    input  logic [  WIDTH-1:0] s_value,
    input  logic [LIMIT_W-1:0] s_limit,
    input  logic [ PASS_W-1:0] s_pass,
    output logic               m_valid,
    output logic [  WIDTH-1:0] m_value,
    output logic [LIMIT_W-1:0] m_count,
    output logic [ PASS_W-1:0] m_pass
);
  localparam int LEVELS = ($clog2(WIDTH) + 1) / 2;
  localparam int COUNT_W = 2 * LEVELS;

  for (genvar i = LEVELS - 1; i >= 0; i--) begin : g_stage
    localparam int UNIT = 4 ** i;
    logic valid_in, free_in;
    logic [  WIDTH-1:0] value_in;
    logic [COUNT_W-1:0] steps_in;
    logic [ PASS_W-1:0] pass_in;
    if (i == LEVELS - 1) begin : g_first
      assign valid_in = s_valid;
      assign value_in = s_value;
      assign free_in  = s_limit >> COUNT_W != '0;
      assign steps_in = COUNT_W'(s_limit);
      assign pass_in  = s_pass;
    end else begin : g_next
      assign valid_in = g_stage[i+1].valid_q;
      assign value_in = g_stage[i+1].value_q;
      assign {free_in, steps_in} = g_stage[i+1].steps_q;
      assign pass_in = g_stage[i+1].pass_q;
    end

    logic [3*UNIT-1:0] high;
    logic [1:0] zeros, limit, digit;
    assign high = (3 * UNIT)'({value_in, {(3 * UNIT) {1'b0}}} >> WIDTH);
    assign zeros = high[3*UNIT-1-:UNIT] != '0 ? 2'd0 :
                   high[2*UNIT-1-:UNIT] != '0 ? 2'd1 :
                   high[UNIT-1-:UNIT] != '0 ? 2'd2 : 2'd3;
    assign limit = free_in ? 2'd3 : steps_in[COUNT_W-1-:2];
    assign digit = zeros < limit ? zeros : limit;

    // `steps` shifts the digits of the limit out at its top and those of the count in below; above it stands `free`.
    logic valid_q;
    logic [WIDTH-1:0] value_q;
    logic [COUNT_W:0] steps_q;
    logic [PASS_W-1:0] pass_q;
    always_ff @(posedge clk) begin
      if (rst) valid_q <= 1'b0;
      else if (advance) valid_q <= valid_in;
      if (advance) begin
        value_q <= value_in << digit * UNIT;
        steps_q <= {free_in || zeros < limit, COUNT_W'(steps_in << 2) | COUNT_W'(digit)};
        pass_q  <= pass_in;
      end
    end
  end

  logic unused_free;
  logic [COUNT_W-1:0] count, unused_above;
  assign m_valid = g_stage[0].valid_q;
  assign m_value = g_stage[0].value_q;
  assign {unused_free, count} = g_stage[0].steps_q;
  assign {unused_above, m_count} = (COUNT_W + LIMIT_W)'(count);
  assign m_pass = g_stage[0].pass_q;
endmodule

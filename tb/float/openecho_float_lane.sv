// One float unit between two files: streams the vectors of NAME.in through it, writes its results to NAME.out and what
// it saw of the stream to NAME.log. Without NAME.in the lane stands still, its clock too, and costs no time.
//
// NAME.in has 17 bytes a vector, big-endian: control (bit 0: subtract, bit 1: divide), operand a, operand b. NAME.out
// has a line a result: 2 hexadecimal digits for the flags, 16 for the result, sign-extended; {less, equal, unordered}
// for a comparison. NAME.log, of the first MEASURED results: least and greatest number of cycles from a vector's transfer
// to its result's, and cycles from the first to the last result; then how often the unit broke the contract: no result
// until it could be taken, a stalled one dropped or changed.
//
// Before the first vector the unit is filled, stalled, and reset. Every other block of vectors runs with random gaps
// and stalls.
module openecho_float_lane #(
    // Without a type: Icarus 11 loses a string that is given to a vector.
    parameter NAME = "",  // verilog_lint: waive explicit-parameter-storage-type
    parameter int UNIT = 0,  // 0 add, 1 mul, 2 div, 3 compare, 4 from_int, 5 to_fixed, 6 serial
    parameter int EXP_W = 11,
    parameter int FRAC_W = 52,
    parameter int ITERATIVE = 1,
    parameter int INT_W = 19,
    parameter int SCALE = -11,
    parameter int FRAC = 16
) (
    input  logic clock,
    output logic done
);
  localparam int WORD_W = 1 + EXP_W + FRAC_W;
  localparam int BLOCK = 1024;
  localparam int MEASURED = 512;  // results that no stall has reached
  localparam int FILL_CYCLES = 100;  // enough to fill any unit
  localparam int QUIET_CYCLES = 1000;  // no unit takes as long

  logic clk, rst, s_valid, s_ready, m_valid, m_ready;
  logic [7:0] control;
  logic [63:0] a, b, result;
  logic [4:0] flags;

  assign clk = clock && !done;

  if (UNIT == 0) begin : g_add
    logic [WORD_W-1:0] m_result;
    openecho_float_add #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC_W),
        .ITERATIVE(ITERATIVE != 0)
    ) dut (
        .s_a(a[WORD_W-1:0]),
        .s_b(b[WORD_W-1:0]),
        .s_subtract(control[0]),
        .m_flags(flags),
        .*
    );
    assign result = 64'(m_result);
  end else if (UNIT == 1) begin : g_mul
    logic [WORD_W-1:0] m_result;
    openecho_float_mul #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) dut (
        .s_a(a[WORD_W-1:0]),
        .s_b(b[WORD_W-1:0]),
        .m_flags(flags),
        .*
    );
    assign result = 64'(m_result);
  end else if (UNIT == 2) begin : g_div
    logic [WORD_W-1:0] m_result;
    openecho_float_div #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC_W),
        .ITERATIVE(ITERATIVE != 0)
    ) dut (
        .s_a(a[WORD_W-1:0]),
        .s_b(b[WORD_W-1:0]),
        .m_flags(flags),
        .*
    );
    assign result = 64'(m_result);
  end else if (UNIT == 3) begin : g_compare
    logic m_less, m_equal, m_unordered;
    openecho_float_compare #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) dut (
        .s_a(a[WORD_W-1:0]),
        .s_b(b[WORD_W-1:0]),
        .m_flags(flags),
        .*
    );
    assign result = 64'({m_less, m_equal, m_unordered});
  end else if (UNIT == 4) begin : g_from_int
    logic [WORD_W-1:0] m_result;
    openecho_float_from_int #(
        .EXP_W(EXP_W),
        .FRAC_W(FRAC_W),
        .INT_W(INT_W),
        .SCALE(SCALE),
        .ITERATIVE(ITERATIVE != 0)
    ) dut (
        .s_value(a[INT_W-1:0]),
        .m_flags(flags),
        .*
    );
    assign result = 64'(m_result);
  end else if (UNIT == 5) begin : g_to_fixed
    logic signed [INT_W+FRAC-1:0] m_value;
    openecho_float_to_fixed #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W),
        .INT_W (INT_W),
        .FRAC  (FRAC)
    ) dut (
        .s_a(a[WORD_W-1:0]),
        .m_flags(flags),
        .*
    );
    assign result = 64'(m_value);
  end else begin : g_serial
    logic [WORD_W-1:0] m_result;
    openecho_float_serial #(
        .EXP_W (EXP_W),
        .FRAC_W(FRAC_W)
    ) dut (
        .s_a(a[WORD_W-1:0]),
        .s_b(b[WORD_W-1:0]),
        .s_subtract(control[0]),
        .s_divide(control[1]),
        .m_flags(flags),
        .*
    );
    assign result = 64'(m_result);
  end

  integer source, sink, report, got;
  integer cycle, sent, received, quiet, latency, least, greatest, first_received, last_measured, violations;
  integer sent_at[MEASURED];
  logic stalled, held;
  logic [31:0] random;
  logic [8*17-1:0] vector;
  logic [68:0] offered;

  initial begin
    source = $fopen($sformatf("%0s.in", NAME), "rb");
    done   = source == 0;
    if (source != 0) begin
      sink = $fopen($sformatf("%0s.out", NAME), "w");
      got  = $fread(vector, source);
    end
    rst = 1'b1;
    s_valid = 1'b0;
    m_ready = 1'b0;
    held = 1'b0;
    random = 32'h1ced_bea7;
    cycle = 0;
    sent = 0;
    received = 0;
    quiet = 0;
    least = 0;
    greatest = 0;
    first_received = 0;
    last_measured = 0;
    violations = 0;
  end

  always @(posedge clk) begin
    cycle <= cycle + 1;
    random <= {random[30:0], random[31] ^ random[21] ^ random[1] ^ random[0]};
    rst <= cycle < 2 || (cycle > FILL_CYCLES && cycle < FILL_CYCLES + 3);
    if (cycle < FILL_CYCLES + 4) begin
      {control, a, b} <= vector;
      s_valid <= cycle > 2 && cycle < FILL_CYCLES;
      if (cycle == FILL_CYCLES && !m_valid) violations <= violations + 1;
    end else begin
      stalled = (sent / BLOCK) % 2 == 1;
      if (!s_valid || s_ready) begin
        s_valid <= got == 17 && !(stalled && random[4]);
        {control, a, b} <= {17{8'hff}};
        if (got == 17 && !(stalled && random[4])) begin
          {control, a, b} <= vector;
          got = $fread(vector, source);
        end
      end
      m_ready <= !(stalled && random[9]);
      if (s_valid && s_ready) begin
        if (sent < MEASURED) sent_at[sent] <= cycle;
        sent <= sent + 1;
      end
      if (m_valid && m_ready) begin
        $fwrite(sink, "%02x%016x\n", {3'b000, flags}, result);
        if (received < MEASURED) begin
          latency = cycle - sent_at[received];
          if (received == 0 || latency < least) least <= latency;
          if (received == 0 || latency > greatest) greatest <= latency;
        end
        if (received == 0) first_received <= cycle;
        if (received == MEASURED - 1) last_measured <= cycle;
        received <= received + 1;
      end
      held <= m_valid && !m_ready;
      offered <= {flags, result};
      if (held && !(m_valid && offered === {flags, result})) violations <= violations + 1;
      quiet <= (s_valid && s_ready) || (m_valid && m_ready) ? 0 : quiet + 1;
      if (quiet == QUIET_CYCLES) begin
        report = $fopen($sformatf("%0s.log", NAME), "w");
        $fwrite(report, "%0d %0d %0d %0d\n", least, greatest, last_measured - first_received, violations);
        $fclose(report);
        $fclose(sink);
        done <= 1'b1;
      end
    end
  end
endmodule

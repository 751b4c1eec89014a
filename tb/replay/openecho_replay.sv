// The core between two files, with nothing but the simulator on its clock: back to back into a sink that is always ready.
//
// samples.bin has a big-endian 32-bit word a sample: bit 31 ends a waveform, the low bits are counts. records.bin gets
// the records, word 0 first, each little-endian. The settings come as +n= +min_interval= +min_amplitude= +k=.
//
// Prints "read SAMPLES" now and then, and "end CYCLES STALLS SAMPLES RECORDS FLAWED" when nothing has moved for
// QUIET_CYCLES: cycles to the last record, cycles in which a sample had to wait, samples that the core took, records,
// and how many of those had an undefined bit or a `last` that was not that of a trailer.
//
// Samples are read by the block: a $fread on every clock takes a tenth off the speed of the fixed-point core.
module openecho_replay
  import openecho_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS
);
  localparam int INDEX_W = $clog2(MAX_SAMPLES);
  localparam int WORD_W = record_word_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES);
  localparam int BLOCK = 4096;
  localparam int RESET_CYCLES = 3;
  localparam int QUIET_CYCLES = 4096;  // longer than any format takes for an echo

  logic clk, rst, s_valid, s_ready, s_last, m_valid, m_last;
  logic [SAMPLE_W-1:0] s_sample;
  logic [RECORD_WORDS*WORD_W-1:0] m_record;

  logic [RATIO_W-1:0] n, k;
  logic [INDEX_W-1:0] min_interval;
  logic [SAMPLE_W-1:0] min_amplitude;

  logic [31:0] block[BLOCK];
  integer source, sink, filled, at;
  longint cycles, last_cycle, quiet, stalls, samples, records, flawed;

  openecho_core #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS)
  ) u_core (
      .clk,
      .rst,
      .n,
      .min_interval,
      .min_amplitude,
      .k,
      .s_valid,
      .s_ready,
      .s_last,
      .s_sample,
      .m_valid,
      .m_ready(1'b1),
      .m_last,
      .m_record
  );

  initial begin
    source = $fopen("samples.bin", "rb");
    sink   = $fopen("records.bin", "wb");
    if (source == 0 || sink == 0) $fatal(1, "found no samples.bin, or no place for records.bin");
    if (!$value$plusargs("n=%d", n)) $fatal(1, "found no +n=");
    if (!$value$plusargs("min_interval=%d", min_interval)) $fatal(1, "found no +min_interval=");
    if (!$value$plusargs("min_amplitude=%d", min_amplitude)) $fatal(1, "found no +min_amplitude=");
    if (!$value$plusargs("k=%d", k)) $fatal(1, "found no +k=");
    s_valid = 1'b0;
    filled = 0;
    at = BLOCK;
    cycles = 0;
    last_cycle = 0;
    quiet = 0;
    stalls = 0;
    samples = 0;
    records = 0;
    flawed = 0;
    rst = 1'b1;
    #(2 * RESET_CYCLES) rst = 1'b0;
  end

  initial begin
    clk = 1'b0;
    forever #1 clk = !clk;
  end

  always @(posedge clk) begin
    if (!rst) begin
      cycles <= cycles + 1;
      if (s_valid && !s_ready) begin
        stalls <= stalls + 1;
      end else begin
        if (at == BLOCK) begin
          filled = $fread(block, source) / 4;
          at = 0;
          $display("read %0d", samples);
          $fflush;
        end
        s_valid <= at < filled;
        if (at < filled) begin
          s_last   <= block[at][31];
          s_sample <= block[at][SAMPLE_W-1:0];
          at = at + 1;
        end
      end
      if (s_valid && s_ready) samples <= samples + 1;
      if (m_valid) begin
        $fwrite(sink, "%u", m_record);
        records <= records + 1;
        last_cycle <= cycles + 1;
        if (m_last !== m_record[HEADER_TRAILER] || ^m_record === 1'bx) flawed <= flawed + 1;
      end
      quiet <= (s_valid && s_ready) || m_valid ? 0 : quiet + 1;
      if (quiet == QUIET_CYCLES) begin
        $fclose(sink);
        $display("end %0d %0d %0d %0d %0d", last_cycle, stalls, samples, records, flawed);
        $finish(0);
      end
    end
  end
endmodule

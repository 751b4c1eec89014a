// The core as an SoC sees it: AXI4-Stream samples in and records out, AXI4-Lite registers, one interrupt.
//
// s_axis has a sample a beat in its low SAMPLE_W bits, and tlast on a waveform's last; a sample with a higher bit set
// is taken as full scale and counted as an error. m_axis has a record a beat, word 0 in the low bits, and tlast on the
// trailer, so that a waveform is a packet in both directions. One sample a clock, and the core's latency: the shell
// adds no stage. aresetn is synchronous. No ready or valid output depends on an input within the clock cycle.
//
// The settings must hold still while a waveform is in the core, so a changed one is kept beside the one in use: the
// input is held before the next waveform until the last trailer is out, then all settings change at once. They hold
// for every waveform that begins after the write was answered. A soft reset waits in the same way, so that no waveform
// is lost, and then resets the core, the counters, IRQ_STATUS and ERROR_CAUSE; it keeps the settings and IRQ_MASK.
// While neither waits, nothing is held. A source that stops inside a waveform makes both wait for ever; aresetn helps.
//
// Registers are in openecho_registers_pkg. A write with strobes changes only those bytes. SLVERR answers, without an
// effect: an address without a register, a write to what is read-only, and a setting that the core does not take. Of
// other writes, bits without a meaning are not kept. An event is not lost to a clear in the same cycle.

// As in openecho_check: Icarus 11 has no elaboration task and stops at time 0.
`ifdef __ICARUS__
`define OPENECHO_STOP initial $fatal
`else
`define OPENECHO_STOP $fatal
`endif

module openecho_axi
  import openecho_pkg::*;
  import openecho_registers_pkg::*;
#(
    parameter int SAMPLE_W = 11,
    parameter int EXP_W = 0,
    parameter int FRAC = 16,
    parameter int MAX_SAMPLES = 4096,
    parameter int TAP_COUNT = PAPER_TAP_COUNT,
    parameter logic [TAPS_W-1:0] TAPS = PAPER_TAPS,
    parameter bit DSP = 1'b1,
    // Follows from the others; a parameter because openecho_axi_top, in plain Verilog, has to be told.
    parameter int WORD_W = record_word_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES)
) (
    input  logic                             aclk,
    input  logic                             aresetn,
    input  logic [                     15:0] s_axis_tdata,
    input  logic                             s_axis_tvalid,
    output logic                             s_axis_tready,
    input  logic                             s_axis_tlast,
    output logic [  RECORD_WORDS*WORD_W-1:0] m_axis_tdata,
    output logic [RECORD_WORDS*WORD_W/8-1:0] m_axis_tkeep,
    output logic                             m_axis_tvalid,
    input  logic                             m_axis_tready,
    output logic                             m_axis_tlast,
    input  logic [            ADDRESS_W-1:0] s_axi_awaddr,
    input  logic                             s_axi_awvalid,
    output logic                             s_axi_awready,
    input  logic [                     31:0] s_axi_wdata,
    input  logic [                      3:0] s_axi_wstrb,
    input  logic                             s_axi_wvalid,
    output logic                             s_axi_wready,
    output logic [                      1:0] s_axi_bresp,
    output logic                             s_axi_bvalid,
    input  logic                             s_axi_bready,
    input  logic [            ADDRESS_W-1:0] s_axi_araddr,
    input  logic                             s_axi_arvalid,
    output logic                             s_axi_arready,
    output logic [                     31:0] s_axi_rdata,
    output logic [                      1:0] s_axi_rresp,
    output logic                             s_axi_rvalid,
    input  logic                             s_axi_rready,
    output logic                             irq
);
  localparam int INDEX_W = $clog2(MAX_SAMPLES);
  // Far more waveforms than there is room for: the noise queue of openecho_noise takes 16 before the reader waits.
  localparam int FLIGHT_W = 8;

  if (WORD_W != record_word_width(SAMPLE_W, EXP_W, FRAC, MAX_SAMPLES)) begin : g_word_w
    `OPENECHO_STOP(1, "WORD_W is %0d; with these parameters a record's words have another width", WORD_W);
  end

  // ---- registers ----------------------------------------------------------------------------------------------------
  logic write_valid, writable, is_setting, illegal, read_refused;
  logic [ADDRESS_W-1:0] write_address, read_address;
  logic [31:0] write_data, read_data, mask, present, merged, ones;
  logic [3:0] write_strobe;

  logic [RATIO_W-1:0] n_written_q, n_q, k_written_q, k_q;
  logic [INDEX_W-1:0] min_interval_written_q, min_interval_q;
  logic [SAMPLE_W-1:0] min_amplitude_written_q, min_amplitude_q;
  logic [31:0] waveforms_q, echoes_q, stalls_q, errors_q;
  logic [IRQ_STATUS_W-1:0] events, clear_irq, irq_status_q, irq_mask_q;
  logic [ERROR_CAUSE_W-1:0] causes, clear_cause, error_cause_q;

  // ---- input and output of the core ---------------------------------------------------------------------------------
  logic awake_q;  // low in reset and until the first edge after it
  logic inside_q;  // between the first and the last sample of a waveform
  logic change_waits_q, reset_waits_q;
  logic clear_q;  // the cycle of a soft reset
  logic [FLIGHT_W-1:0] flight_q;  // waveforms begun whose trailer has not been taken
  logic hold, empty, core_s_ready, sample_taken, begun, record_taken, trailer_taken, beyond;
  logic [SAMPLE_W-1:0] sample;

  assign hold = !awake_q || clear_q || ((change_waits_q || reset_waits_q) && !inside_q);
  assign empty = (change_waits_q || reset_waits_q) && !inside_q && flight_q == '0;

  assign beyond = (s_axis_tdata >> SAMPLE_W) != '0;
  assign sample = beyond ? '1 : s_axis_tdata[SAMPLE_W-1:0];
  assign s_axis_tready = core_s_ready && !hold;
  assign sample_taken = s_axis_tvalid && s_axis_tready;
  assign begun = sample_taken && !inside_q;
  assign record_taken = m_axis_tvalid && m_axis_tready;
  assign trailer_taken = record_taken && m_axis_tlast;
  assign m_axis_tkeep = '1;

  always_ff @(posedge aclk) begin
    awake_q <= aresetn;
    if (!aresetn) begin
      inside_q <= 1'b0;
      flight_q <= '0;
      clear_q  <= 1'b0;
    end else begin
      if (sample_taken) inside_q <= !s_axis_tlast;
      flight_q <= flight_q + FLIGHT_W'(begun) - FLIGHT_W'(trailer_taken);
      clear_q  <= empty && reset_waits_q;
    end
  end

  openecho_core #(
      .SAMPLE_W(SAMPLE_W),
      .EXP_W(EXP_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS),
      .DSP(DSP)
  ) u_core (
      .clk(aclk),
      .rst(!aresetn || clear_q),
      .n(n_q),
      .min_interval(min_interval_q),
      .min_amplitude(min_amplitude_q),
      .k(k_q),
      .s_valid(s_axis_tvalid && !hold),
      .s_ready(core_s_ready),
      .s_last(s_axis_tlast),
      .s_sample(sample),
      .m_valid(m_axis_tvalid),
      .m_ready(m_axis_tready),
      .m_last(m_axis_tlast),
      .m_record(m_axis_tdata)
  );

  // ---- writes -------------------------------------------------------------------------------------------------------
  openecho_axi_lite #(
      .ADDRESS_W(ADDRESS_W)
  ) u_lite (
      .aclk,
      .aresetn,
      .s_axi_awaddr,
      .s_axi_awvalid,
      .s_axi_awready,
      .s_axi_wdata,
      .s_axi_wstrb,
      .s_axi_wvalid,
      .s_axi_wready,
      .s_axi_bresp,
      .s_axi_bvalid,
      .s_axi_bready,
      .s_axi_araddr,
      .s_axi_arvalid,
      .s_axi_arready,
      .s_axi_rdata,
      .s_axi_rresp,
      .s_axi_rvalid,
      .s_axi_rready,
      .write_valid,
      .write_address,
      .write_data,
      .write_strobe,
      .write_refused(!writable || illegal),
      .read_address,
      .read_data,
      .read_refused
  );

  assign is_setting = write_address == ADDRESS_N || write_address == ADDRESS_MIN_INTERVAL
      || write_address == ADDRESS_MIN_AMPLITUDE || write_address == ADDRESS_K;
  assign mask = {{8{write_strobe[3]}}, {8{write_strobe[2]}}, {8{write_strobe[1]}}, {8{write_strobe[0]}}};
  assign ones = write_data & mask;
  assign merged = ones | (present & ~mask);

  // Whether there is something to write, what it was, and whether what it becomes is refused.
  always_comb begin
    writable = 1'b1;
    present  = '0;
    case (write_address)
      ADDRESS_N: present = 32'(n_written_q);
      ADDRESS_MIN_INTERVAL: present = 32'(min_interval_written_q);
      ADDRESS_MIN_AMPLITUDE: present = 32'(min_amplitude_written_q);
      ADDRESS_K: present = 32'(k_written_q);
      ADDRESS_IRQ_MASK: present = 32'(irq_mask_q);
      ADDRESS_CONTROL, ADDRESS_IRQ_STATUS, ADDRESS_ERROR_CAUSE: ;
      default: writable = 1'b0;
    endcase
  end

  always_comb begin
    case (write_address)
      ADDRESS_N: illegal = (merged >> RATIO_W) != '0 || (merged >> RATIO_FRAC) == '0;
      ADDRESS_MIN_INTERVAL: illegal = (merged >> INDEX_W) != '0;
      ADDRESS_MIN_AMPLITUDE: illegal = (merged >> SAMPLE_W) != '0;
      ADDRESS_K: illegal = (merged >> RATIO_W) != '0;
      default: illegal = 1'b0;
    endcase
  end

  always_ff @(posedge aclk) begin
    if (!aresetn) begin
      n_written_q <= RATIO_W'(RESET_N);
      min_interval_written_q <= INDEX_W'(RESET_MIN_INTERVAL);
      min_amplitude_written_q <= SAMPLE_W'(RESET_MIN_AMPLITUDE);
      k_written_q <= RATIO_W'(RESET_K);
      n_q <= RATIO_W'(RESET_N);
      min_interval_q <= INDEX_W'(RESET_MIN_INTERVAL);
      min_amplitude_q <= SAMPLE_W'(RESET_MIN_AMPLITUDE);
      k_q <= RATIO_W'(RESET_K);
      irq_mask_q <= '0;
      change_waits_q <= 1'b0;
      reset_waits_q <= 1'b0;
    end else begin
      if (empty) begin
        n_q <= n_written_q;
        min_interval_q <= min_interval_written_q;
        min_amplitude_q <= min_amplitude_written_q;
        k_q <= k_written_q;
        change_waits_q <= 1'b0;
        reset_waits_q <= 1'b0;
      end
      if (write_valid && !illegal) begin
        case (write_address)
          ADDRESS_CONTROL: if (ones[CONTROL_SOFT_RESET]) reset_waits_q <= 1'b1;
          ADDRESS_N: n_written_q <= merged[RATIO_W-1:0];
          ADDRESS_MIN_INTERVAL: min_interval_written_q <= merged[INDEX_W-1:0];
          ADDRESS_MIN_AMPLITUDE: min_amplitude_written_q <= merged[SAMPLE_W-1:0];
          ADDRESS_K: k_written_q <= merged[RATIO_W-1:0];
          ADDRESS_IRQ_MASK: irq_mask_q <= merged[IRQ_MASK_W-1:0];
          default: ;
        endcase
        if (merged != present && is_setting) change_waits_q <= 1'b1;
      end
    end
  end

  // ---- counters, causes and the interrupt ---------------------------------------------------------------------------
  function automatic logic [31:0] counted(input logic [31:0] count, input logic [2:0] more);
    logic [32:0] total;
    total   = 33'(count) + 33'(more);
    counted = total[32] ? '1 : total[31:0];
  endfunction

  assign causes[ERROR_CAUSE_TOO_SHORT] = trailer_taken && m_axis_tdata[WORD_HEADER*WORD_W+FLAG_TOO_SHORT];
  assign causes[ERROR_CAUSE_TOO_LONG] = trailer_taken && m_axis_tdata[WORD_HEADER*WORD_W+FLAG_TOO_LONG];
  assign causes[ERROR_CAUSE_SAMPLE] = sample_taken && beyond;
  assign causes[ERROR_CAUSE_SETTING] = write_valid && illegal;
  assign events[IRQ_STATUS_WAVEFORM] = trailer_taken;
  assign events[IRQ_STATUS_ERROR] = causes != '0;
  assign clear_irq = write_valid && write_address == ADDRESS_IRQ_STATUS ? ones[IRQ_STATUS_W-1:0] : '0;
  assign clear_cause = write_valid && write_address == ADDRESS_ERROR_CAUSE ? ones[ERROR_CAUSE_W-1:0] : '0;

  always_ff @(posedge aclk) begin
    if (!aresetn) begin
      waveforms_q <= '0;
      echoes_q <= '0;
      stalls_q <= '0;
      errors_q <= '0;
      irq_status_q <= '0;
      error_cause_q <= '0;
      irq <= 1'b0;
    end else begin
      waveforms_q <= counted(clear_q ? '0 : waveforms_q, 3'(trailer_taken));
      echoes_q <= counted(clear_q ? '0 : echoes_q, 3'(record_taken && !m_axis_tlast));
      stalls_q <= counted(clear_q ? '0 : stalls_q, 3'(s_axis_tvalid && !s_axis_tready));
      errors_q <= counted(clear_q ? '0 : errors_q, 3'(causes[0]) + 3'(causes[1]) + 3'(causes[2]) + 3'(causes[3]));
      irq_status_q <= events | (clear_q ? '0 : irq_status_q & ~clear_irq);
      error_cause_q <= causes | (clear_q ? '0 : error_cause_q & ~clear_cause);
      irq <= (irq_status_q & irq_mask_q) != '0;
    end
  end

  // ---- reads --------------------------------------------------------------------------------------------------------
  always_comb begin
    read_refused = 1'b0;
    read_data = '0;
    case (read_address)
      ADDRESS_ID: read_data = RESET_ID;
      ADDRESS_VERSION: read_data = RESET_VERSION;
      ADDRESS_BUILD0: begin
        read_data[BUILD0_SAMPLE_W+:8] = 8'(SAMPLE_W);
        read_data[BUILD0_EXP_W+:8] = 8'(EXP_W);
        read_data[BUILD0_FRAC+:8] = 8'(FRAC);
        read_data[BUILD0_WORD_W+:8] = 8'(WORD_W);
      end
      ADDRESS_BUILD1: read_data = MAX_SAMPLES;
      ADDRESS_BUILD2: read_data = TAP_COUNT;
      ADDRESS_CONTROL: read_data[CONTROL_SOFT_RESET] = reset_waits_q || clear_q;
      ADDRESS_STATUS: begin
        read_data[STATUS_BUSY] = inside_q || flight_q != '0;
        read_data[STATUS_CHANGE_WAITS] = change_waits_q;
        read_data[STATUS_RESET_WAITS] = reset_waits_q || clear_q;
      end
      ADDRESS_N: read_data = 32'(n_written_q);
      ADDRESS_MIN_INTERVAL: read_data = 32'(min_interval_written_q);
      ADDRESS_MIN_AMPLITUDE: read_data = 32'(min_amplitude_written_q);
      ADDRESS_K: read_data = 32'(k_written_q);
      ADDRESS_WAVEFORMS: read_data = waveforms_q;
      ADDRESS_ECHOES: read_data = echoes_q;
      ADDRESS_STALLS: read_data = stalls_q;
      ADDRESS_ERRORS: read_data = errors_q;
      ADDRESS_IRQ_STATUS: read_data = 32'(irq_status_q);
      ADDRESS_IRQ_MASK: read_data = 32'(irq_mask_q);
      ADDRESS_ERROR_CAUSE: read_data = 32'(error_cause_q);
      default: read_refused = 1'b1;
    endcase
  end
endmodule

`undef OPENECHO_STOP

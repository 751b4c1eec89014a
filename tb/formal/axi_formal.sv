// openecho_axi, what it adds to the core: settings in use change only while no waveform is in the core, and a waveform
// that begins after a change has been written begins with it; a soft reset comes only while none is in the core; nothing
// is held while neither waits; no setting is ever one that the core does not take; an event sets its bit of the
// interrupt even as it is cleared, and the bit stays until it is cleared.
//
// Proved by induction. The row cuts the core loose, which has its own proof. Assumed of it: no record without a waveform
// inside, and no more than IN_CORE waveforms inside. Free: all else, resets among it, and what is written.
module axi_formal
  import openecho_pkg::*;
  import openecho_registers_pkg::*;
#(
    parameter int SAMPLE_W = 8,
    parameter int FRAC = 4,
    parameter int MAX_SAMPLES = 8,
    parameter int TAP_COUNT = 4,
    parameter logic [TAPS_W-1:0] TAPS = {{(TAPS_W - 2 * TAP_W) {1'b0}}, 16'd2, 16'd1},
    localparam int INDEX_W = $clog2(MAX_SAMPLES),
    localparam int WORD_W = record_word_width(SAMPLE_W, 0, FRAC, MAX_SAMPLES)
) (
    input logic                 clk,
    input logic                 rst,
    input logic [         15:0] s_axis_tdata,
    input logic                 s_axis_tvalid,
    input logic                 s_axis_tlast,
    input logic                 m_axis_tready,
    input logic [ADDRESS_W-1:0] s_axi_awaddr,
    input logic                 s_axi_awvalid,
    input logic [         31:0] s_axi_wdata,
    input logic [          3:0] s_axi_wstrb,
    input logic                 s_axi_wvalid,
    input logic                 s_axi_bready,
    input logic [ADDRESS_W-1:0] s_axi_araddr,
    input logic                 s_axi_arvalid,
    input logic                 s_axi_rready
);
  localparam int IN_CORE = 100;

  logic started, s_axis_tready, m_axis_tvalid, m_axis_tlast, irq;
  logic [  RECORD_WORDS*WORD_W-1:0] m_axis_tdata;
  logic [RECORD_WORDS*WORD_W/8-1:0] unused_tkeep;
  logic unused_awready, unused_wready, unused_bvalid, unused_arready, unused_rvalid;
  logic [1:0] unused_bresp, unused_rresp;
  logic [31:0] unused_rdata;

  openecho_axi #(
      .SAMPLE_W(SAMPLE_W),
      .FRAC(FRAC),
      .MAX_SAMPLES(MAX_SAMPLES),
      .TAP_COUNT(TAP_COUNT),
      .TAPS(TAPS)
  ) dut (
      .aclk(clk),
      .aresetn(!rst),
      .s_axis_tdata,
      .s_axis_tvalid,
      .s_axis_tready,
      .s_axis_tlast,
      .m_axis_tdata,
      .m_axis_tkeep(unused_tkeep),
      .m_axis_tvalid,
      .m_axis_tready,
      .m_axis_tlast,
      .s_axi_awaddr,
      .s_axi_awvalid,
      .s_axi_awready(unused_awready),
      .s_axi_wdata,
      .s_axi_wstrb,
      .s_axi_wvalid,
      .s_axi_wready(unused_wready),
      .s_axi_bresp(unused_bresp),
      .s_axi_bvalid(unused_bvalid),
      .s_axi_bready,
      .s_axi_araddr,
      .s_axi_arvalid,
      .s_axi_arready(unused_arready),
      .s_axi_rdata(unused_rdata),
      .s_axi_rresp(unused_rresp),
      .s_axi_rvalid(unused_rvalid),
      .s_axi_rready,
      .irq
  );

  reset_formal u_reset (
      .clk,
      .rst,
      .started
  );

  localparam int SETTINGS_W = 2 * RATIO_W + INDEX_W + SAMPLE_W;
  logic [SETTINGS_W-1:0] used, written, used_q, written_q;
  assign used = {dut.n_q, dut.k_q, dut.min_interval_q, dut.min_amplitude_q};
  assign written = {dut.n_written_q, dut.k_written_q, dut.min_interval_written_q, dut.min_amplitude_written_q};

  // Waveforms inside, counted here, and what was a cycle ago.
  logic taken, inside_q, was_reset_q, was_empty_q, changed_q;
  logic [7:0] flight_q;
  logic [IRQ_STATUS_W-1:0] sticky_q;
  assign taken = s_axis_tvalid && s_axis_tready;
  always_ff @(posedge clk) begin
    if (rst) begin
      inside_q  <= 1'b0;
      flight_q  <= '0;
      changed_q <= 1'b0;
    end else begin
      if (taken) inside_q <= !s_axis_tlast;
      flight_q  <= flight_q + 8'(taken && !inside_q) - 8'(m_axis_tvalid && m_axis_tready && m_axis_tlast);
      changed_q <= changed_q || (used != written && flight_q > 1);
    end
    was_reset_q <= rst;
    was_empty_q <= !inside_q && flight_q == '0;
    used_q <= used;
    written_q <= written;
    sticky_q <= dut.events | (dut.clear_q ? '0 : dut.irq_status_q & ~dut.clear_irq);
  end

  logic undisturbed;
  assign undisturbed = !dut.change_waits_q && !dut.reset_waits_q && !dut.clear_q && dut.awake_q;

  always_comb begin
    no_record_without_a_waveform : assume (!m_axis_tvalid || flight_q != '0);
    core_is_full : assume (32'(flight_q) < IN_CORE || !dut.core_s_ready);
    if (started) begin
      settings_change_in_an_empty_core : assert (was_reset_q || used == used_q || was_empty_q);
      settings_become_what_was_written : assert (was_reset_q || used == used_q || used == written_q);
      begins_with_what_was_written : assert (!(taken && !inside_q) || used == written);
      soft_reset_of_an_empty_core : assert (!dut.clear_q || (!inside_q && flight_q == '0 && !taken));
      nothing_held_without_a_reason : assert (!undisturbed || s_axis_tready == dut.core_s_ready);
      n_is_at_least_1 : assert (dut.n_written_q[RATIO_W-1:RATIO_FRAC] != '0 && dut.n_q[RATIO_W-1:RATIO_FRAC] != '0);
      events_are_kept : assert (was_reset_q || dut.irq_status_q == sticky_q);
      // For the induction.
      same_inside : assert (dut.inside_q == inside_q);
      same_flight : assert (dut.flight_q == flight_q);
      flight_in_range : assert (32'(flight_q) <= IN_CORE);
      change_waits : assert (used == written || dut.change_waits_q);
    end
    cover_change_waits : cover (started && changed_q && used == written && taken);
    cover_soft_reset : cover (started && dut.clear_q);
    cover_interrupt : cover (started && irq);
  end
endmodule

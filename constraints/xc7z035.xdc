# Constraints of openecho_core, or of openecho_axi_top, as top of an XC7Z035 (xc7z035ffg676-2): clock and ports.
#
# The two name their ports differently, so each pattern is looked for quietly and every list holds those of both. A Zynq
# block design does not read this file: there the processing system makes the clock, and no port of the core is a pin.
# Nor is there a place for `if` or `foreach`: an XDC file takes constraints, `set`, `expr` and `list` only (UG903).

# ---- clock -----------------------------------------------------------------------------------------------------------
# 200 MHz. Edit per board: this line, and nothing else, where another clock is wanted; scripts/vivado reads it too.
set period 5.000
create_clock -name core_clock -period $period [get_ports -quiet {clk aclk}]

# Out of context only: the clock buffer outside, so that the clock's skew is that of a global clock (UG905). Edit per
# board: take it out where clk is a pin of the design, whose own buffer then counts.
set_property HD.CLK_SRC BUFGCTRL_X0Y0 [get_ports -quiet {clk aclk}]

# ---- ports -----------------------------------------------------------------------------------------------------------
# Out of context the other half of each path is another block's, of the same clock: 30 % of the period is its share. One
# figure serves setup and hold: without -min the same delay is taken as the shortest, as the register that drives a port
# is behind the clock buffer too. Edit per board: where a port is a pin, the figures of what is soldered to it.
set outside [expr {0.3 * $period}]

# Reset among them. It is no false path: it is synchronous, and all registers have to leave it on the same edge. The
# settings n, min_interval, min_amplitude and k hold still while a waveform is in the core, but nothing forces them to.
set_input_delay -clock core_clock $outside [get_ports -quiet { \
    rst n[*] min_interval[*] min_amplitude[*] k[*] s_valid s_last s_sample[*] m_ready \
    aresetn s_axis_tdata[*] s_axis_tvalid s_axis_tlast m_axis_tready \
    s_axi_awaddr[*] s_axi_awvalid s_axi_wdata[*] s_axi_wstrb[*] s_axi_wvalid s_axi_bready \
    s_axi_araddr[*] s_axi_arvalid s_axi_rready}]
set_output_delay -clock core_clock $outside [get_ports -quiet { \
    s_ready m_valid m_last m_record[*] \
    s_axis_tready m_axis_tdata[*] m_axis_tkeep[*] m_axis_tvalid m_axis_tlast \
    s_axi_awready s_axi_wready s_axi_bresp[*] s_axi_bvalid s_axi_arready s_axi_rdata[*] s_axi_rresp[*] s_axi_rvalid \
    irq}]

# ---- pins ------------------------------------------------------------------------------------------------------------
# None: they are the board's. Edit per board, a line of each kind for every port that is a pin:
#   set_property PACKAGE_PIN <ball> [get_ports clk]
#   set_property IOSTANDARD LVCMOS18 [get_ports clk]

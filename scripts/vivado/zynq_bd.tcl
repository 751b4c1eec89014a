# The design that an XC7Z035 board starts from: processing system, DMA both ways, and the packaged core between them.
#
#   vivado -mode batch -source scripts/vivado/zynq_bd.tcl -notrace      (scripts/vivado.py does it)
#
#   memory -> HP0 -> dma MM2S, 16 bits a sample -> core -> 256 bits a record -> width, to 64 bits -> dma S2MM -> HP0
#   processor -> GP0 -> control -> registers of dma and core;     interrupts of core and dma -> processor
#
# The DMA is in simple mode (register direct, no scatter-gather): one MM2S transfer is a waveform, two bytes a sample,
# and its end is the waveform's `last`. One S2MM transfer takes the waveform's records, 32 bytes each, to its trailer:
# start it first, with room for as many echoes as a waveform can have. Buffers are aligned to 8 bytes.
#
# needs:  build/vivado/ip from package_ip.tcl
# writes: build/vivado/zynq: a project with the block design openecho_zynq and its wrapper as top, ready to be built
# exits:  0; 1 if Vivado refuses the design; 2 if it can't start

source [file join [file dirname [info script]] common.tcl]

# Connect a pin, given as cell/pin, to those it drives.
proc openecho::wire {driver args} {
  foreach sink $args {
    connect_bd_net [get_bd_pins $driver] [get_bd_pins $sink]
  }
}

# Connect an interface to another, both given as cell/interface.
proc openecho::attach {from to} {
  connect_bd_intf_net [get_bd_intf_pins $from] [get_bd_intf_pins $to]
}

proc openecho::create_cell {ip cell {configuration {}}} {
  create_bd_cell -type ip -vlnv $ip $cell
  if {[llength $configuration] > 0} {
    set_property -dict $configuration [get_bd_cells $cell]
  }
}

proc openecho::create_cells {core} {
  # Edit per board: the memory and the pins of the processor (MIO) are the defaults of the IP, not those of any board. A
  # board file brings them:
  #   set_property board_part <vendor:board:part0:version> [current_project], before this, and then
  #   apply_bd_automation -rule xilinx.com:bd_rule:processing_system7 \
  #       -config {make_external "FIXED_IO, DDR" apply_board_preset "1"} [get_bd_cells ps]
  # Without one: PCW_UIPARAM_DDR_PARTNO and its timing, PCW_CRYSTAL_PERIPHERAL_FREQMHZ, and PCW_<peripheral>_IO for
  # UART, SD, Ethernet and flash. The clock of core and DMA is FCLK_CLK0, as fast as the constraints say.
  create_cell xilinx.com:ip:processing_system7:5.5 ps [list \
      CONFIG.PCW_FPGA0_PERIPHERAL_FREQMHZ [expr {1000.0 / [clock_period]}] \
      CONFIG.PCW_EN_CLK0_PORT 1 \
      CONFIG.PCW_USE_M_AXI_GP0 1 \
      CONFIG.PCW_USE_S_AXI_HP0 1 \
      CONFIG.PCW_S_AXI_HP0_DATA_WIDTH 64 \
      CONFIG.PCW_USE_FABRIC_INTERRUPT 1 \
      CONFIG.PCW_IRQ_F2P_INTR 1]
  create_cell xilinx.com:ip:proc_sys_reset:5.0 reset
  create_cell $core core
  # 26 bits of length: 64 MB a transfer, where the default of 14 ends before 512 records.
  create_cell xilinx.com:ip:axi_dma:7.1 dma [list \
      CONFIG.c_include_sg 0 \
      CONFIG.c_sg_length_width 26 \
      CONFIG.c_m_axi_mm2s_data_width 64 \
      CONFIG.c_m_axis_mm2s_tdata_width 16 \
      CONFIG.c_m_axi_s2mm_data_width 64 \
      CONFIG.c_s_axis_s2mm_tdata_width 64]
  # The side of the core takes its width from the core: 64-bit words of a record make it 512 bits.
  create_cell xilinx.com:ip:axis_dwidth_converter:1.1 width [list CONFIG.M_TDATA_NUM_BYTES 8]
  create_cell xilinx.com:ip:smartconnect:1.0 control [list CONFIG.NUM_SI 1 CONFIG.NUM_MI 2]
  create_cell xilinx.com:ip:smartconnect:1.0 memory [list CONFIG.NUM_SI 2 CONFIG.NUM_MI 1]
  create_cell xilinx.com:ip:xlconcat:2.1 interrupts [list CONFIG.NUM_PORTS 3]
}

proc openecho::connect_cells {} {
  foreach {port vlnv} {
    DDR xilinx.com:interface:ddrx_rtl:1.0
    FIXED_IO xilinx.com:display_processing_system7:fixedio_rtl:1.0
  } {
    create_bd_intf_port -mode Master -vlnv $vlnv $port
    connect_bd_intf_net [get_bd_intf_ports $port] [get_bd_intf_pins ps/$port]
  }

  wire ps/FCLK_CLK0 ps/M_AXI_GP0_ACLK ps/S_AXI_HP0_ACLK reset/slowest_sync_clk core/aclk width/aclk control/aclk \
      memory/aclk dma/s_axi_lite_aclk dma/m_axi_mm2s_aclk dma/m_axi_s2mm_aclk
  wire ps/FCLK_RESET0_N reset/ext_reset_in
  wire reset/interconnect_aresetn control/aresetn memory/aresetn
  wire reset/peripheral_aresetn core/aresetn width/aresetn dma/axi_resetn

  attach ps/M_AXI_GP0 control/S00_AXI
  attach control/M00_AXI dma/S_AXI_LITE
  attach control/M01_AXI core/s_axi
  attach dma/M_AXI_MM2S memory/S00_AXI
  attach dma/M_AXI_S2MM memory/S01_AXI
  attach memory/M00_AXI ps/S_AXI_HP0

  attach dma/M_AXIS_MM2S core/s_axis
  attach core/m_axis width/S_AXIS
  attach width/M_AXIS dma/S_AXIS_S2MM

  # Edit per board: the order of In0, In1 and In2 is that of the interrupts 61, 62 and 63 of the processor (UG585).
  wire core/irq interrupts/In0
  wire dma/mm2s_introut interrupts/In1
  wire dma/s2mm_introut interrupts/In2
  wire interrupts/dout ps/IRQ_F2P
}

proc openecho::assign_addresses {} {
  foreach {offset segment} {0x40400000 dma/S_AXI_LITE/Reg 0x43C00000 core/s_axi/*} {
    assign_bd_address -offset $offset -range 0x00010000 -target_address_space [get_bd_addr_spaces ps/Data] \
        [get_bd_addr_segs $segment]
  }
  # All of the memory that the processing system is set up for.
  foreach space {dma/Data_MM2S dma/Data_S2MM} {
    assign_bd_address -target_address_space [get_bd_addr_spaces $space] [get_bd_addr_segs ps/S_AXI_HP0/HP0_DDR_LOWOCM]
  }
}

namespace eval openecho {
  require_file [file join $ip component.xml] "it from --step package"
  create_project -force -part $part zynq [file join $output zynq]
  set_property ip_repo_paths [list $ip] [current_project]
  update_ip_catalog

  if {[llength [get_ipdefs -all [vlnv]]] != 1} {
    fail 2 "$ip: found no [vlnv] in it, expected it from --step package: run that again"
  }
  create_bd_design openecho_zynq
  create_cells [vlnv]
  connect_cells
  assign_addresses
  validate_bd_design
  save_bd_design

  make_wrapper -files [get_files openecho_zynq.bd] -top -import
  set_property top openecho_zynq_wrapper [current_fileset]
  update_compile_order -fileset sources_1
  close_project
  puts "block design: [file join $output zynq zynq.xpr]"
}
exit 0

# Synthesise openecho_core out of context, without a project: no pins, no I/O buffers, the clock from outside.
#
#   vivado -mode batch -source scripts/vivado/synth.tcl -notrace      (scripts/vivado.py does it)
#
# needs:  build/vivado/sources.tcl from scripts/vivado.py, constraints/xc7z035.xdc
# writes: build/vivado/synth.dcp, synth.summary, synth_utilization.rpt, synth_timing.rpt
# exits:  0; 1 if setup is missed by what synthesis estimates of the nets; 2 if it can't start

source [file join [file dirname [info script]] common.tcl]

namespace eval openecho {
  read_verilog -sv $sources
  read_xdc [list [require_file $constraints "the constraints"]]

  set generics [list]
  foreach {parameter value} $parameters {
    lappend generics -generic $parameter=$value
  }
  synth_design -mode out_of_context -top $top -part $part {*}$generics

  report_utilization -file [file join $output synth_utilization.rpt]
  report_timing_summary -delay_type min_max -report_unconstrained -file [file join $output synth_timing.rpt]
  # No hold slack: nothing is placed yet.
  set summary [dict merge [utilisation] [dict create wns_ns [worst_slack max]]]
  write_checkpoint -force [file join $output synth.dcp]
  write_summary synth $summary
  fail_on_timing $summary
}
exit 0

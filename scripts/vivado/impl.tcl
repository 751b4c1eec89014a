# Place and route what synth.tcl has made, still out of context: the figures of the core by itself on the part.
#
#   vivado -mode batch -source scripts/vivado/impl.tcl -notrace      (scripts/vivado.py does it)
#
# needs:  build/vivado/synth.dcp, which carries the constraints, and synth.summary
# writes: build/vivado/impl.dcp, impl.summary, impl_{utilization,timing,route,drc}.rpt
# exits:  0; 1 if setup or hold is missed, a net is not routed or a design rule is broken; 2 if it can't start

source [file join [file dirname [info script]] common.tcl]

namespace eval openecho {
  require_same_parameters synth
  read_checkpoint [require_file [file join $output synth.dcp] "it from --step synth"]
  link_design -mode out_of_context -top $top -part $part

  opt_design
  place_design
  phys_opt_design
  route_design

  report_utilization -file [file join $output impl_utilization.rpt]
  report_timing_summary -delay_type min_max -report_unconstrained -file [file join $output impl_timing.rpt]
  report_route_status -file [file join $output impl_route.rpt]
  report_drc -name impl -file [file join $output impl_drc.rpt]

  # A net that leads to a port has the status UNPLACED out of context, as the port has no place: it is not counted.
  set unrouted 0
  foreach status {UNROUTED PARTIAL CONFLICTS ANTENNAS} {
    incr unrouted [llength [report_route_status -return_nets -route_type $status]]
  }
  set broken [llength [get_drc_violations -quiet -name impl -filter {SEVERITY == Error || SEVERITY == Fatal}]]

  set summary [dict merge [utilisation] [dict create \
      wns_ns [worst_slack max] whs_ns [worst_slack min] unrouted $unrouted drc_errors $broken]]
  write_checkpoint -force [file join $output impl.dcp]
  write_summary impl $summary

  if {$unrouted > 0} {
    fail 1 "routing: found $unrouted nets that are not routed, expected none ([file join $output impl_route.rpt])"
  }
  if {$broken > 0} {
    fail 1 "design rules: found $broken broken, expected none ([file join $output impl_drc.rpt])"
  }
  fail_on_timing $summary
}
exit 0

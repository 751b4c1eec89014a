# Stand-ins for the commands of Vivado that scripts/vivado uses, to run those scripts under a bare tclsh.
#
#   STAND_IN='version 2018.3' STAND_IN_CALLS=calls.txt tclsh stand_ins.tcl -mode batch -source scripts/vivado/synth.tcl
#
# A stand-in refuses what Vivado would refuse, as far as that is known without it: an option that the command does not
# have (UG835, 2020.2), a file, part, port, pin, interface, property or step before that is not there. It records each
# call. It does not know what the design does: slacks, nets and rule violations are those that STAND_IN names.

namespace eval stand_in {
  variable given [dict merge {
    version 2020.1 slack_max 0.125 slack_min 0.031 paths 1 unrouted 0 conflicts 0 violations 0 integrity 1 rows 1
  } [expr {[info exists ::env(STAND_IN)] ? $::env(STAND_IN) : ""}]]
  variable calls [expr {[info exists ::env(STAND_IN_CALLS)] ? [open $::env(STAND_IN_CALLS) a] : ""}]
  variable done [dict create]
  variable sources [list]
  variable constraints [list]
  variable ports [dict create]
  variable clocks [list]
  variable parts {xc7z035ffg676-2}
  variable repository [list]
  variable catalogue [dict create]
  variable cells [dict create]
  variable driver [dict create]
  variable links [dict create]
  variable external [list]
  variable assigned [dict create]
  variable core [dict create]
  variable top ""
}

proc stand_in::refuse {message} {
  return -code error -errorcode STAND_IN "ERROR: $message"
}

# One line a call: the command and its arguments, apart by tabs.
proc stand_in::record {args} {
  variable calls
  if {$calls ne ""} {
    puts $calls [join [string map [list \n " " \t " "] $args] \t]
    flush $calls
  }
}

# ---- what commands there are, and with which options ---------------------------------------------------------------

# Command, options without a value, options with one, fewest and most other arguments. All have -quiet and -verbose too.
set stand_in::commands {
  version {-short} {} 0 0
  get_parts {-regexp -nocase} {-filter} 0 1
  read_verilog {-sv} {-library} 1 1
  read_xdc {-quiet_diff_pairs -unmanaged -no_add} {-cells -ref -mode} 1 1
  read_checkpoint {-incremental -auto_incremental} {-cell -directive -reuse_objects -fix_objects -dcp_cell_list} 0 1
  write_checkpoint {-force -logic_function_stripped -encrypt -incremental_synth} {-cell -key} 1 1
  synth_design
    {-rtl -no_lc -rtl_skip_mlo -rtl_skip_ip -rtl_skip_constraints -keep_equivalent_registers -retiming -no_srlextract
     -assert -no_timing_driven -sfcu -debug_log}
    {-name -part -constrset -top -include_dirs -generic -verilog_define -flatten_hierarchy -gated_clock_conversion
     -directive -bufg -shreg_min_size -mode -fsm_extraction -srl_style -resource_sharing -cascade_dsp
     -control_set_opt_threshold -incremental -max_bram -max_uram -max_dsp -max_bram_cascade_height
     -max_uram_cascade_height} 0 0
  link_design {} {-name -part -constrset -top -mode -pr_config -reconfig_partitions -partitions} 0 0
  opt_design
    {-retarget -propconst -sweep -bram_power_opt -remap -resynth_area -resynth_seq_area -muxf_remap -bufg_opt
     -merge_equivalent_drivers -carry_remap -debug_log}
    {-directive -hier_fanout_limit -control_set_merge} 0 0
  place_design {-no_timing_driven -timing_summary -unplace -post_place_opt -no_psip -no_bufg_opt} {-directive} 0 0
  phys_opt_design {-fanout_opt -placement_opt -rewire -critical_cell_opt -retime -hold_fix} {-directive} 0 0
  route_design
    {-unroute -release_memory -physical_nets -tns_cleanup -no_timing_driven -preserve -delay -auto_delay
     -timing_summary -finalize -ultrathreads}
    {-nets -pins -directive -max_delay -min_delay} 0 0
  report_utilization
    {-append -evaluate_pblock -exclude_child_pblocks -exclude_non_assigned -return_string -slr -packthru
     -no_primitives -omit_locs -hierarchical -hierarchical_percentages}
    {-file -pblocks -cells -name -spreadsheet_file -spreadsheet_table -spreadsheet_depth -hierarchical_depth} 0 0
  report_timing_summary
    {-check_timing_verbose -no_detailed_paths -setup -hold -unique_pins -no_reused_label -input_pins
     -no_pr_attribute -routable_nets -report_unconstrained -no_header -append -return_string -warn_on_violation
     -datasheet}
    {-delay_type -max_paths -nworst -path_type -slack_lesser_than -significant_digits -file -name -cells -rpx} 0 0
  report_route_status
    {-return_nets -return_string -append -list_all_nets -show_all -dump_routes -has_routing -ignore_cache}
    {-file -of_objects -route_type -boolean_check -to_load} 0 0
  report_drc {-upgrade_cw -append -return_string -no_waivers} {-name -checks -ruledecks -file -format -rpx -cells} 0 0
  get_drc_violations {-regexp -nocase} {-name -filter} 0 1
  get_timing_paths
    {-setup -hold -unique_pins -no_report_unconstrained -user_ignored -routable_nets -regexp -nocase}
    {-from -rise_from -fall_from -to -rise_to -fall_to -through -rise_through -fall_through -delay_type -max_paths
     -nworst -slack_lesser_than -slack_greater_than -group -sort_by -filter -cell} 0 0
  get_property {-min -max} {} 2 2
  set_property {} {-dict} 1 3
  get_ports {-regexp -nocase -no_traverse} {-filter -of_objects -match_style -prop_thru_buffers} 0 1
  get_clocks {-regexp -nocase -include_generated_clocks} {-filter -of_objects -match_style} 0 1
  create_clock {-add} {-period -name -waveform} 0 1
  set_input_delay
    {-clock_fall -rise -fall -max -min -add_delay -network_latency_included -source_latency_included}
    {-clock -reference_pin} 2 2
  set_output_delay
    {-clock_fall -rise -fall -max -min -add_delay -network_latency_included -source_latency_included}
    {-clock -reference_pin} 2 2
  set_false_path
    {-setup -hold -rise -fall -reset_path}
    {-from -rise_from -fall_from -to -rise_to -fall_to -through -rise_through -fall_through} 0 0
  create_project {-force -in_memory -ip -rtl_kernel} {-part} 0 2
  close_project {-delete} {} 0 0
  current_project {} {} 0 1
  current_fileset {-constrset -simset -blockset} {} 0 1
  add_files {-norecurse -copy_to_project -force -scan_for_includes} {-fileset -of_objects -copy_to} 0 1
  get_files
    {-regexp -nocase -all -references}
    {-filter -compile_order -used_in -of_objects} 0 1
  update_compile_order {-force_gui} {-fileset} 0 0
  update_ip_catalog {-rebuild} {-add_ip -delete_ip -repo_path -update_module_ref} 0 0
  get_ipdefs {-regexp -nocase -all} {-filter -of_objects} 0 1
  make_wrapper {-top -testbench -inst_template -import -force} {-fileset -files} 0 1
  create_bd_design {} {-dir -cell -boundary} 1 1
  create_bd_cell {-force} {-vlnv -type -reference -revision} 1 1
  create_bd_intf_port {} {-vlnv -mode} 1 1
  get_bd_cells {-regexp -hierarchical} {-filter -of_objects} 0 1
  get_bd_pins {-regexp -hierarchical} {-filter -of_objects} 0 1
  get_bd_intf_pins {-regexp -hierarchical} {-filter -of_objects} 0 1
  get_bd_intf_ports {-regexp} {-filter -of_objects} 0 1
  get_bd_addr_spaces {-regexp -hierarchical} {-filter -of_objects} 0 1
  get_bd_addr_segs {-regexp -hierarchical -excluded -addressed -unaddressed -addressables} {-filter -of_objects} 0 1
  connect_bd_net {} {-net -boundary_type} 1 99
  connect_bd_intf_net {} {-intf_net -boundary_type} 2 3
  assign_bd_address
    {-boundary -master_boundary -external -force}
    {-target_address_space -dict -import_from_file -export_to_file -offset -range} 0 1
  validate_bd_design {-force -design} {} 0 0
  save_bd_design {} {} 0 1
  ipx::package_project
    {-import_files -force -generated_files -force_update_compile_order -no_sub_cores}
    {-root_dir -vendor -library -name -version -taxonomy -set_current -module} 0 1
  ipx::current_core {} {} 0 1
  ipx::infer_bus_interface {} {} 2 3
  ipx::get_bus_interfaces {-regexp -nocase} {-filter -of_objects} 0 1
  ipx::get_user_parameters {-regexp -nocase} {-filter -of_objects} 0 1
  ipx::get_hdl_parameters {-regexp -nocase} {-filter -of_objects} 0 1
  ipx::associate_bus_interfaces {-clear -remove} {-busif -clock -reset} 0 1
  ipx::create_xgui_files {} {-logo_file} 0 1
  ipx::update_checksums {} {} 0 1
  ipx::check_integrity {-kernel -xrt} {} 0 1
  ipx::save_core {} {} 0 1
}

# Options and other arguments of a call, or an error as Vivado's for what the command does not take. Both are recorded.
proc stand_in::parse {command arguments} {
  variable commands
  set at [lsearch -exact $commands $command]
  lassign [lrange $commands [expr {$at + 1}] [expr {$at + 4}]] flags valued fewest most
  set options [dict create]
  set rest [list]
  while {[llength $arguments] > 0} {
    set arguments [lassign $arguments word]
    if {$word in $flags || $word in {-quiet -verbose}} {
      dict set options $word 1
    } elseif {$word in $valued} {
      if {[llength $arguments] == 0} {
        refuse "$command: missing value for option '$word'"
      }
      set arguments [lassign $arguments value]
      dict lappend options $word $value
    } elseif {[regexp {^-[a-z]} $word]} {
      refuse "$command: unknown option '$word'"
    } else {
      lappend rest $word
    }
  }
  if {[llength $rest] < $fewest || [llength $rest] > $most} {
    refuse "$command: [llength $rest] arguments, expected $fewest to $most"
  }
  return [list $options $rest]
}

# Make a stand-in: its body sees `options`, name to the list of values, and `rest`, the other arguments.
proc stand_in::define {command body} {
  variable commands
  if {[lsearch -exact $commands $command] < 0} {
    error "no options for $command"
  }
  if {[string match ipx::* $command]} {
    namespace eval ::ipx {}
  }
  proc ::$command {args} [format {
    set command %s
    ::stand_in::record $command {*}$args
    lassign [::stand_in::parse $command $args] options rest
    return [::stand_in::body_%s $options $rest]
  } [list $command] [string map {:: _} $command]]
  proc ::stand_in::body_[string map {:: _} $command] {options rest} $body
}

# The one value of an option.
proc stand_in::option {options name {default ""}} {
  return [expr {[dict exists $options $name] ? [lindex [dict get $options $name] end] : $default}]
}

proc stand_in::after {step} {
  variable done
  if {![dict exists $done $step]} {
    refuse "no $step before this"
  }
}

proc stand_in::finish {step} {
  variable done
  dict set done $step 1
}

proc stand_in::existing {paths} {
  foreach path $paths {
    if {![file isfile $path]} {
      refuse "\[Common 17-55\] file '$path' does not exist"
    }
  }
  return $paths
}

proc stand_in::write {path text} {
  set file [open $path w]
  puts -nonewline $file $text
  close $file
}

proc stand_in::contents {path} {
  set file [open $path]
  set text [read $file]
  close $file
  return $text
}

# Objects of a kind whose name matches one of some patterns; brackets are no wildcards. Nothing found is an error here,
# where Vivado only warns, unless -quiet says that it may be.
proc stand_in::matching {kind names options patterns} {
  set found [list]
  foreach pattern $patterns {
    set literal [string map {[ \\[ ] \\]} $pattern]
    set matches [lsearch -all -inline -glob $names $literal]
    if {[llength $matches] == 0} {
      record no_match $kind $pattern
      if {![dict exists $options -quiet]} {
        refuse "no $kind matches '$pattern', there are: $names"
      }
    }
    foreach match $matches {
      lappend found $kind:$match
    }
  }
  return $found
}

# Names of objects, all of one kind.
proc stand_in::named {kind objects} {
  set names [list]
  foreach object $objects {
    if {![string match $kind:* $object]} {
      refuse "$object is no $kind"
    }
    lappend names [string range $object [string length $kind:] end]
  }
  return $names
}

# ---- Verilog: what of a module is needed here ----------------------------------------------------------------------

# Header of a module, from its name to the end of its ports, without comments and attributes; empty if it is not there.
proc stand_in::header {top} {
  variable sources
  foreach path $sources {
    set text [contents $path]
    regsub -all {//[^\n]*} $text "" text
    regsub -all {\(\*.*?\*\)} $text "" text
    if {[regexp "\\mmodule\\s+$top\\M.*?\\);" $text found]} {
      return $found
    }
  }
  refuse "module '$top' not found in the sources"
}

# Port to direction and range, which is empty for a single bit.
proc stand_in::ports_of {top} {
  set found [dict create]
  set pattern {\m(input|output|inout)\s+(?:(?:wire|reg|logic)\s+)?(?:signed\s+)?(\[[^\]]*\])?\s*(\w+)}
  foreach {all direction range name} [regexp -all -inline $pattern [header $top]] {
    dict set found $name [list $direction $range]
  }
  return $found
}

proc stand_in::parameters_of {top} {
  set found [list]
  foreach {all name} [regexp -all -inline {\mparameter\s+[^=,;()]*?(\w+)\s*=} [header $top]] {
    lappend found $name
  }
  return $found
}

# ---- general -------------------------------------------------------------------------------------------------------

stand_in::define version {
  variable given
  if {[dict exists $options -short]} {
    return [dict get $given version]
  }
  return "Vivado v[dict get $given version] (64-bit)"
}

stand_in::define get_parts {
  variable parts
  return [lsearch -all -inline -glob $parts [lindex $rest 0]]
}

stand_in::define get_property {
  variable given
  lassign $rest name object
  if {$name ne "SLACK" || ![regexp {^path:(max|min)$} $object -> type]} {
    refuse "property '$name' of '$object' is not known"
  }
  return [dict get $given slack_$type]
}

stand_in::define set_property {
  if {[dict exists $options -dict]} {
    set properties [option $options -dict]
    set objects [lindex $rest 0]
    if {[llength $rest] != 1} {
      refuse "set_property: -dict takes objects alone"
    }
  } else {
    lassign $rest name value objects
    set properties [list $name $value]
  }
  if {[llength $objects] == 0} {
    refuse "set_property: no objects"
  }
  foreach object $objects {
    regexp {^(\w+):(.*)$} $object -> kind name
    foreach {property value} $properties {
      set_one $kind $name $property $value
    }
  }
}

proc stand_in::set_one {kind name property value} {
  variable repository
  variable core
  variable top
  set known {
    port {HD.CLK_SRC PACKAGE_PIN IOSTANDARD}
    project {ip_repo_paths}
    fileset {top}
    core {vendor library name version core_revision display_name description}
    user_parameter {value}
    hdl_parameter {value}
  }
  if {$kind eq "cell"} {
    return [configure $name $property $value]
  }
  if {$property ni [dict get $known $kind]} {
    refuse "a $kind has no property '$property'"
  }
  if {$property eq "ip_repo_paths"} {
    set repository $value
  } elseif {$kind eq "fileset"} {
    if {$value eq "openecho_zynq_wrapper"} {
      after make_wrapper
    } else {
      header $value
    }
    set top $value
  } elseif {$kind eq "core"} {
    if {$property eq "version" && ![regexp {^\d+\.\d+$} $value]} {
      refuse "version '$value', expected major.minor"
    }
    dict set core $property $value
  } elseif {$kind in {user_parameter hdl_parameter}} {
    if {![regexp {^(\d+|0x[0-9a-f]+)$} $value]} {
      refuse "value '$value' of $name, expected a number or a bit string"
    }
    dict set core ${kind}s $name $value
  }
}

# ---- without a project ---------------------------------------------------------------------------------------------

stand_in::define read_verilog {
  variable sources
  lappend sources {*}[existing [lindex $rest 0]]
  finish read_verilog
}

stand_in::define read_xdc {
  variable constraints
  lappend constraints {*}[existing [lindex $rest 0]]
}

stand_in::define synth_design {
  variable parts
  variable ports
  variable constraints
  after read_verilog
  set top [option $options -top]
  if {[option $options -part] ni $parts} {
    refuse "part '[option $options -part]' is not known"
  }
  if {[option $options -mode default] ni {default out_of_context}} {
    refuse "mode '[option $options -mode]'"
  }
  set parameters [parameters_of $top]
  foreach generic [dict get [dict merge {-generic {}} $options] -generic] {
    if {![regexp {^(\w+)=(\d+|\d+'h[0-9a-f]+)$} $generic -> name] || $name ni $parameters} {
      refuse "generic '$generic', $top has $parameters"
    }
  }
  set ports [ports_of $top]
  foreach path $constraints {
    constrain $path
  }
  finish design
}

# Read an XDC file, in which nothing but constraints, queries, set, expr and list is a command (UG903).
proc stand_in::constrain {path} {
  set reader [interp create]
  foreach command [interp eval $reader {info commands}] {
    if {$command ni {set expr list}} {
      interp hide $reader $command
    }
  }
  foreach command {
    create_clock set_input_delay set_output_delay set_false_path set_property get_property get_ports get_clocks
  } {
    interp alias $reader $command {} $command
  }
  interp eval $reader [contents $path]
  interp delete $reader
}

stand_in::define get_ports {
  variable ports
  set names [list]
  dict for {name port} $ports {
    lappend names [expr {[lindex $port 1] eq "" ? $name : "$name\[0\]"}]
  }
  return [matching port $names $options [lindex $rest 0]]
}

stand_in::define get_clocks {
  variable clocks
  return [matching clock $clocks $options [lindex $rest 0]]
}

stand_in::define create_clock {
  variable clocks
  if {![string is double -strict [option $options -period]]} {
    refuse "create_clock: period '[option $options -period]'"
  }
  if {[llength [named port [lindex $rest 0]]] != 1} {
    refuse "create_clock: [llength [lindex $rest 0]] ports, expected one"
  }
  lappend clocks [option $options -name]
}

# A delay of an input or output: relative to a clock that there is, on ports of that direction.
proc stand_in::delay {options rest direction} {
  variable clocks
  variable ports
  lassign $rest delay objects
  if {![string is double -strict $delay]} {
    refuse "delay '$delay'"
  }
  if {[option $options -clock] ni $clocks} {
    refuse "clock '[option $options -clock]', there are: $clocks"
  }
  if {[llength $objects] == 0} {
    refuse "no objects"
  }
  foreach name [named port $objects] {
    regsub {\[0\]$} $name "" name
    if {[lindex [dict get $ports $name] 0] ne $direction} {
      refuse "port $name is no $direction"
    }
    record constrained $direction $name
  }
}

stand_in::define set_input_delay {
  delay $options $rest input
}

stand_in::define set_output_delay {
  delay $options $rest output
}

stand_in::define set_false_path {
}

stand_in::define read_checkpoint {
  variable clocks
  set clocks [contents [existing $rest]]
  finish read_checkpoint
}

stand_in::define link_design {
  variable parts
  after read_checkpoint
  if {[option $options -part] ni $parts} {
    refuse "part '[option $options -part]' is not known"
  }
  finish design
}

foreach {step before} {
  opt_design design place_design opt_design phys_opt_design place_design route_design place_design
} {
  stand_in::define $step "
    after $before
    finish $step
  "
}

stand_in::define write_checkpoint {
  variable clocks
  after design
  set path [lindex $rest 0]
  if {[file exists $path] && ![dict exists $options -force]} {
    refuse "$path exists"
  }
  write $path $clocks
}

stand_in::define report_utilization {
  variable given
  after design
  set report "1. Slice Logic
--------------

+----------------------------+------+-------+-----------+-------+
|          Site Type         | Used | Fixed | Available | Util% |
+----------------------------+------+-------+-----------+-------+
| Slice LUTs*                | 1901 |     0 |    171900 |  1.11 |
|   LUT as Logic             | 1646 |     0 |    171900 |  0.96 |
|   LUT as Memory            |  255 |     0 |     70400 |  0.36 |
|     LUT as Distributed RAM |  200 |     0 |           |       |
|     LUT as Shift Register  |   55 |     0 |           |       |
| Slice Registers            | 2228 |     0 |    343800 |  0.65 |
+----------------------------+------+-------+-----------+-------+

| Block RAM Tile |  1.5 |     0 |       500 |  0.30 |
| DSPs           |    1 |     0 |       900 |  0.11 |
"
  if {[package vcompare [dict get $given version] 2021] >= 0} {
    # A column more: prohibited sites.
    set report [string map {"|     0 |" "|     0 |          0 |"} $report]
  }
  if {![dict get $given rows]} {
    set report "nothing"
  }
  return [report $options $report]
}

# Give a report back, or write it to a file whose folder has to be there.
proc stand_in::report {options text} {
  if {[dict exists $options -return_string]} {
    return $text
  }
  write [option $options -file] $text
}

stand_in::define report_timing_summary {
  after design
  report $options timing
}

stand_in::define report_drc {
  after design
  finish drc_[option $options -name]
  report $options rules
}

stand_in::define get_drc_violations {
  variable given
  after drc_[option $options -name]
  set severity {SEVERITY == (Fatal|Error|Warning|Advisory|\{Critical Warning\})}
  if {![regexp "^${severity}( \\|\\| ${severity})*\$" [option $options -filter {SEVERITY == Error}]]} {
    refuse "filter '[option $options -filter]'"
  }
  return [lrepeat_from_none [dict get $given violations] violation]
}

# Tcl 8.5's lrepeat takes no zero.
proc stand_in::lrepeat_from_none {count word} {
  return [expr {$count > 0 ? [lrepeat $count $word] : ""}]
}

stand_in::define report_route_status {
  variable given
  after route_design
  if {![dict exists $options -return_nets]} {
    return [report $options routes]
  }
  set types {
    UNPLACED UNPLACED_ALL UNROUTED PARTIAL GAPS CONFLICTS ANTENNAS NODRIVER MULTI_DRIVER LOCKED_NODES HAS_ROUTING
    INTRASITE NOLOADS HIERPORT ROUTED
  }
  set type [option $options -route_type]
  if {$type ni $types} {
    refuse "route type '$type'"
  }
  # Nets to the ports of a module out of context, of which there are always some.
  set counts [dict create UNROUTED [dict get $given unrouted] CONFLICTS [dict get $given conflicts] UNPLACED 300]
  return [lrepeat_from_none [dict get [dict merge [dict create $type 0] $counts] $type] net]
}

# Without a clock no path is timed.
stand_in::define get_timing_paths {
  variable given
  variable clocks
  after design
  set type [option $options -delay_type max]
  if {$type ni {max min}} {
    refuse "delay type '$type'"
  }
  return [lrepeat_from_none [expr {$clocks eq "" ? 0 : [dict get $given paths]}] path:$type]
}

# ---- projects ------------------------------------------------------------------------------------------------------

stand_in::define create_project {
  variable parts
  if {[option $options -part] ni $parts} {
    refuse "part '[option $options -part]' is not known"
  }
  file mkdir [lindex $rest 1]
  finish create_project
}

stand_in::define close_project {
  after create_project
}

stand_in::define current_project {
  after create_project
  return project:current
}

stand_in::define current_fileset {
  after create_project
  return fileset:sources_1
}

stand_in::define add_files {
  variable sources
  after create_project
  lappend sources {*}[existing [lindex $rest 0]]
}

stand_in::define update_compile_order {
  after create_project
}

stand_in::define update_ip_catalog {
  variable repository
  variable catalogue
  foreach folder $repository {
    foreach path [glob -nocomplain -directory $folder component.xml */component.xml] {
      set packaged [contents $path]
      dict set catalogue [dict get $packaged vlnv] $packaged
    }
  }
}

stand_in::define get_ipdefs {
  variable catalogue
  return [lsearch -all -inline -glob [dict keys $catalogue] [lindex $rest 0]]
}

# ---- packaging -----------------------------------------------------------------------------------------------------

# Signals that Vivado needs in a port's name to see the interface: those that the slave drives come last.
set stand_in::signals {
  axis {{tvalid tdata tlast} {tready}}
  axi {
    {awaddr awvalid wdata wstrb wvalid bready araddr arvalid rready}
    {awready wready bresp bvalid arready rdata rresp rvalid}
  }
}

# Interfaces that the names of ports make up: name to mode and kind.
proc stand_in::inferred {ports} {
  variable signals
  set found [dict create]
  foreach {name mode kind} {s_axis Slave axis m_axis Master axis s_axi Slave axi} {
    lassign [dict get $signals $kind] forward backward
    set directions [expr {$mode eq "Slave" ? "input output" : "output input"}]
    set complete 1
    foreach group [list $forward $backward] direction $directions {
      foreach signal $group {
        set port ${name}_$signal
        if {![dict exists $ports $port] || [lindex [dict get $ports $port] 0] ne $direction} {
          set complete 0
        }
      }
    }
    if {$complete} {
      dict set found $name [list $mode $kind]
    }
  }
  foreach {name kind} {aclk clock aresetn reset} {
    if {[dict exists $ports $name]} {
      dict set found $name [list Slave $kind]
    }
  }
  return $found
}

stand_in::define ipx::package_project {
  variable core
  variable sources
  variable top
  after create_project
  if {![dict exists $options -import_files]} {
    refuse "the sources stay outside of the package"
  }
  set ports [ports_of $top]
  set root [option $options -root_dir]
  if {[file exists [file join $root component.xml]]} {
    refuse "$root has a core in it"
  }
  file mkdir [file join $root src]
  foreach path $sources {
    file copy -force $path [file join $root src]
  }
  set core [dict create root $root vendor [option $options -vendor] library [option $options -library] \
      name $top version 1.0 ports $ports interfaces [inferred $ports] clocked "" reset "" \
      parameters [parameters_of $top]]
  finish package_project
}

stand_in::define ipx::current_core {
  after package_project
  return core:current
}

stand_in::define ipx::infer_bus_interface {
  variable core
  lassign $rest port vlnv object
  named core $object
  if {![dict exists $core ports $port] || $vlnv ne "xilinx.com:signal:interrupt_rtl:1.0"} {
    refuse "no interface $vlnv in port $port"
  }
  dict set core interfaces $port [list Master interrupt]
  return bus:$port
}

stand_in::define ipx::get_bus_interfaces {
  variable core
  named core [option $options -of_objects]
  return [matching bus [dict keys [dict get $core interfaces]] $options [lindex $rest 0]]
}

foreach group {user hdl} {
  stand_in::define ipx::get_${group}_parameters [format {
    variable core
    named core [option $options -of_objects]
    return [matching %s_parameter [dict get $core parameters] $options [lindex $rest 0]]
  } $group]
}

stand_in::define ipx::associate_bus_interfaces {
  variable core
  named core [lindex $rest 0]
  foreach name {-busif -clock -reset} {
    if {[dict exists $options $name] && ![dict exists $core interfaces [option $options $name]]} {
      refuse "no interface '[option $options $name]'"
    }
  }
  if {[dict exists $options -busif]} {
    dict lappend core clocked [option $options -busif]
  }
  if {[dict exists $options -reset]} {
    dict set core reset [option $options -reset]
  }
}

foreach command {ipx::create_xgui_files ipx::update_checksums} {
  stand_in::define $command {
    named core [lindex $rest 0]
  }
}

stand_in::define ipx::check_integrity {
  variable given
  named core [lindex $rest 0]
  return [dict get $given integrity]
}

stand_in::define ipx::save_core {
  variable core
  named core [lindex $rest 0]
  set vlnv [dict get $core vendor]:[dict get $core library]:[dict get $core name]:[dict get $core version]
  write [file join [dict get $core root] component.xml] [dict merge $core [dict create vlnv $vlnv]]
}

# ---- block designs -------------------------------------------------------------------------------------------------

# What of each IP is used here or has to be connected. Settings, with their defaults. Pins: name, direction, kind, and
# the setting that says how many of them there are, or that there are any. Interfaces the same, with their mode. From
# PG021 (DMA), PG082 (processing system), PG085 (width converter), PG164 (reset), PG247 (SmartConnect).
set stand_in::ips {
  xilinx.com:ip:processing_system7:5.5 {
    settings {
      PCW_FPGA0_PERIPHERAL_FREQMHZ 50 PCW_EN_CLK0_PORT 1 PCW_USE_M_AXI_GP0 1 PCW_USE_S_AXI_HP0 0
      PCW_S_AXI_HP0_DATA_WIDTH 64 PCW_USE_FABRIC_INTERRUPT 0 PCW_IRQ_F2P_INTR 0
    }
    pins {
      FCLK_CLK0 output clock PCW_EN_CLK0_PORT
      FCLK_RESET0_N output reset ""
      M_AXI_GP0_ACLK input clock PCW_USE_M_AXI_GP0
      S_AXI_HP0_ACLK input clock PCW_USE_S_AXI_HP0
      IRQ_F2P input interrupt {PCW_USE_FABRIC_INTERRUPT PCW_IRQ_F2P_INTR}
    }
    interfaces {
      M_AXI_GP0 Master axi PCW_USE_M_AXI_GP0
      S_AXI_HP0 Slave axi PCW_USE_S_AXI_HP0
      DDR Master ddr ""
      FIXED_IO Master fixed_io ""
    }
    spaces {Data M_AXI_GP0}
    segments {S_AXI_HP0/HP0_DDR_LOWOCM S_AXI_HP0}
  }
  xilinx.com:ip:proc_sys_reset:5.0 {
    settings {}
    pins {
      slowest_sync_clk input clock ""
      ext_reset_in input reset ""
      aux_reset_in input optional ""
      mb_debug_sys_rst input optional ""
      dcm_locked input optional ""
      mb_reset output reset ""
      bus_struct_reset output reset ""
      peripheral_reset output reset ""
      interconnect_aresetn output reset ""
      peripheral_aresetn output reset ""
    }
    interfaces {}
    spaces {}
    segments {}
  }
  xilinx.com:ip:axi_dma:7.1 {
    settings {
      c_include_sg 1 c_sg_length_width 14 c_m_axi_mm2s_data_width 32 c_m_axis_mm2s_tdata_width 32
      c_m_axi_s2mm_data_width 32 c_s_axis_s2mm_tdata_width 32
    }
    pins {
      s_axi_lite_aclk input clock ""
      m_axi_sg_aclk input clock c_include_sg
      m_axi_mm2s_aclk input clock ""
      m_axi_s2mm_aclk input clock ""
      axi_resetn input reset ""
      mm2s_introut output interrupt ""
      s2mm_introut output interrupt ""
    }
    interfaces {
      S_AXI_LITE Slave axi ""
      M_AXI_SG Master axi c_include_sg
      M_AXI_MM2S Master axi ""
      M_AXI_S2MM Master axi ""
      M_AXIS_MM2S Master axis ""
      S_AXIS_S2MM Slave axis ""
    }
    spaces {Data_MM2S M_AXI_MM2S Data_S2MM M_AXI_S2MM}
    segments {S_AXI_LITE/Reg S_AXI_LITE}
  }
  xilinx.com:ip:axis_dwidth_converter:1.1 {
    settings {S_TDATA_NUM_BYTES 1 M_TDATA_NUM_BYTES 1}
    pins {aclk input clock "" aresetn input reset ""}
    interfaces {S_AXIS Slave axis "" M_AXIS Master axis ""}
    spaces {}
    segments {}
  }
  xilinx.com:ip:smartconnect:1.0 {
    settings {NUM_SI 1 NUM_MI 1}
    pins {aclk input clock "" aresetn input reset ""}
    interfaces {S%02d_AXI Slave axi NUM_SI M%02d_AXI Master axi NUM_MI}
    spaces {}
    segments {}
  }
  xilinx.com:ip:xlconcat:2.1 {
    settings {NUM_PORTS 2}
    pins {In%d input interrupt NUM_PORTS dout output interrupt ""}
    interfaces {}
    spaces {}
    segments {}
  }
}

# The packaged core in the form of that table.
proc stand_in::packaged_ip {packaged} {
  set pins [list]
  set interfaces [list]
  dict for {name interface} [dict get $packaged interfaces] {
    lassign $interface mode kind
    if {$kind in {axis axi}} {
      lappend interfaces $name $mode $kind ""
    } else {
      lappend pins $name [expr {$mode eq "Slave" ? "input" : "output"}] $kind ""
    }
  }
  return [dict create settings [dict get $packaged user_parameters] pins $pins interfaces $interfaces spaces {} \
      segments {s_axi/reg0 s_axi}]
}

stand_in::define create_bd_design {
  after create_project
  finish create_bd_design
}

stand_in::define create_bd_cell {
  variable ips
  variable cells
  variable catalogue
  after create_bd_design
  set vlnv [option $options -vlnv]
  set name [lindex $rest 0]
  if {[dict exists $cells $name]} {
    refuse "cell $name is there already"
  }
  if {[dict exists $catalogue $vlnv]} {
    set ip [packaged_ip [dict get $catalogue $vlnv]]
  } elseif {[dict exists $ips $vlnv]} {
    set ip [dict get $ips $vlnv]
  } else {
    refuse "IP '$vlnv' is not known, there are: [dict keys $ips] [dict keys $catalogue]"
  }
  dict set cells $name [dict create ip $ip set [dict get $ip settings]]
  return cell:$name
}

proc stand_in::configure {cell property value} {
  variable cells
  if {![regexp {^CONFIG\.(.*)$} $property -> setting] || ![dict exists $cells $cell set $setting]} {
    refuse "cell $cell has no property '$property'"
  }
  dict set cells $cell set $setting $value
}

# Pins or interfaces that a cell has, as it is set: name to direction or mode, and kind.
proc stand_in::parts_of {cell group} {
  variable cells
  set found [dict create]
  foreach {name direction kind settings} [dict get $cells $cell ip $group] {
    set count 1
    foreach setting $settings {
      set count [expr {$count * [dict get $cells $cell set $setting]}]
    }
    for {set index 0} {$index < $count} {incr index} {
      dict set found [expr {[string match *%* $name] ? [format $name $index] : $name}] [list $direction $kind]
    }
  }
  return $found
}

# The same of all cells, by cell/name.
proc stand_in::all_parts {group} {
  variable cells
  set found [dict create]
  foreach cell [dict keys $cells] {
    dict for {name part} [parts_of $cell $group] {
      dict set found $cell/$name $part
    }
  }
  return $found
}

stand_in::define get_bd_cells {
  variable cells
  return [matching cell [dict keys $cells] $options [lindex $rest 0]]
}

stand_in::define get_bd_pins {
  return [matching pin [dict keys [all_parts pins]] $options [lindex $rest 0]]
}

stand_in::define get_bd_intf_pins {
  return [matching interface [dict keys [all_parts interfaces]] $options [lindex $rest 0]]
}

stand_in::define create_bd_intf_port {
  variable external
  set kinds {
    xilinx.com:interface:ddrx_rtl:1.0 ddr
    xilinx.com:display_processing_system7:fixedio_rtl:1.0 fixed_io
  }
  if {[option $options -mode] ni {Master Slave} || ![dict exists $kinds [option $options -vlnv]]} {
    refuse "interface port $rest: [option $options -mode] [option $options -vlnv]"
  }
  lappend external [lindex $rest 0] [list [option $options -mode] [dict get $kinds [option $options -vlnv]]]
}

stand_in::define get_bd_intf_ports {
  variable external
  return [matching external [dict keys $external] $options [lindex $rest 0]]
}

# One output drives any number of inputs, and an input has one driver.
stand_in::define connect_bd_net {
  variable driver
  set all [all_parts pins]
  set from ""
  set to [list]
  foreach name [named pin $rest] {
    lassign [dict get $all $name] direction kind
    if {$direction eq "input"} {
      lappend to $name
    } elseif {$from eq ""} {
      set from $name
    } else {
      refuse "two drivers: $from and $name"
    }
  }
  if {$from eq ""} {
    refuse "no driver for $to"
  }
  foreach name $to {
    if {[dict exists $driver $name] && [dict get $driver $name] ne $from} {
      refuse "$name is driven by [dict get $driver $name] already"
    }
    set kinds [list [lindex [dict get $all $from] 1] [lindex [dict get $all $name] 1]]
    if {[lindex $kinds 0] ne [lindex $kinds 1]} {
      refuse "$from is a [lindex $kinds 0], $name a [lindex $kinds 1]"
    }
    dict set driver $name $from
  }
}

# Master to slave of one kind; a port outside has the mode of the pin that it stands for.
stand_in::define connect_bd_intf_net {
  variable links
  variable external
  set all [all_parts interfaces]
  set ends [list]
  foreach object [lrange $rest 0 1] {
    regexp {^(\w+):(.*)$} $object -> group name
    set end [dict get [expr {$group eq "external" ? $external : $all}] $name]
    lappend ends $group $name {*}$end
    if {[dict exists $links $name]} {
      refuse "$name is connected already"
    }
  }
  lassign $ends group_a a mode_a kind_a group_b b mode_b kind_b
  if {$kind_a ne $kind_b} {
    refuse "$a is $kind_a, $b is $kind_b"
  }
  set outside [expr {$group_a eq "external" || $group_b eq "external"}]
  if {($mode_a eq $mode_b) != $outside} {
    refuse "$a is a $mode_a, $b is a $mode_b"
  }
  dict set links $a $b
  dict set links $b $a
}

# Address spaces or segments of all cells: cell/name to the interface that it belongs to.
proc stand_in::addresses {group} {
  variable cells
  set found [dict create]
  foreach cell [dict keys $cells] {
    foreach {name interface} [dict get $cells $cell ip $group] {
      dict set found $cell/$name $cell/$interface
    }
  }
  return $found
}

stand_in::define get_bd_addr_spaces {
  return [matching space [dict keys [addresses spaces]] $options [lindex $rest 0]]
}

stand_in::define get_bd_addr_segs {
  return [matching segment [dict keys [addresses segments]] $options [lindex $rest 0]]
}

# Segments that a space leads to, through a SmartConnect.
proc stand_in::reachable {space} {
  variable links
  set start [dict get [addresses spaces] $space]
  if {![dict exists $links $start]} {
    refuse "$start is not connected"
  }
  set through [lindex [split [dict get $links $start] /] 0]
  set found [list]
  dict for {segment interface} [addresses segments] {
    if {[dict exists $links $interface] && [string match $through/M??_AXI [dict get $links $interface]]} {
      lappend found $segment
    }
  }
  return $found
}

stand_in::define assign_bd_address {
  variable assigned
  set space [named space [option $options -target_address_space]]
  set segment [named segment [lindex $rest 0]]
  if {[llength $space] != 1 || [llength $segment] != 1 || $segment ni [reachable $space]} {
    refuse "$space does not lead to '$segment'"
  }
  set base [option $options -offset 0]
  set size [option $options -range 0x40000000]
  if {[string match */Data $space] && ($base < 0x40000000 || $base + $size > 0x80000000)} {
    refuse "$segment at $base is outside of GP0"
  }
  dict for {other place} $assigned {
    lassign $place at from long
    if {$at eq $space && $base < $from + $long && $from < $base + $size} {
      refuse "$segment overlaps $other"
    }
  }
  dict set assigned $space>$segment [list $space $base $size]
}

# Refuse a design with something left open, or with data that the width of a stream does not fit.
stand_in::define validate_bd_design {
  variable cells
  variable driver
  variable links
  variable assigned
  variable catalogue
  dict for {name pin} [all_parts pins] {
    lassign $pin direction kind
    if {$direction eq "input" && $kind ne "optional" && ![dict exists $driver $name]} {
      refuse "$name is not connected"
    }
  }
  foreach name [dict keys [all_parts interfaces]] {
    if {![dict exists $links $name]} {
      refuse "$name is not connected"
    }
  }
  foreach space [dict keys [addresses spaces]] {
    foreach segment [reachable $space] {
      if {![dict exists $assigned $space>$segment]} {
        refuse "$segment has no address in $space"
      }
    }
  }
  dict for {vlnv packaged} $catalogue {
    foreach bus {s_axis m_axis s_axi} {
      if {$bus ni [dict get $packaged clocked]} {
        refuse "$vlnv: $bus has no clock"
      }
    }
    if {[dict get $packaged reset] ne "aresetn"} {
      refuse "$vlnv: the clock has no reset"
    }
    set range [lindex [dict get $packaged ports s_axis_tdata] 1]
    set width [dict get $cells dma set c_m_axis_mm2s_tdata_width]
    if {[regexp {^\[\s*(\d+)\s*:\s*0\s*\]$} $range -> high] && $high + 1 != $width} {
      refuse "s_axis_tdata is $range, the DMA gives $width bits"
    }
  }
  set dma [dict get $cells dma set]
  if {8 * [dict get $cells width set M_TDATA_NUM_BYTES] != [dict get $dma c_s_axis_s2mm_tdata_width]} {
    refuse "width/M_AXIS and dma/S_AXIS_S2MM differ in width"
  }
  foreach {stream memory} {
    c_m_axis_mm2s_tdata_width c_m_axi_mm2s_data_width c_s_axis_s2mm_tdata_width c_m_axi_s2mm_data_width
  } {
    if {[dict get $dma $stream] > [dict get $dma $memory]} {
      refuse "dma: $stream is more than $memory"
    }
  }
  finish validate_bd_design
}

stand_in::define save_bd_design {
  after validate_bd_design
  finish save_bd_design
}

stand_in::define get_files {
  after create_bd_design
  return file:[lindex $rest 0]
}

stand_in::define make_wrapper {
  after save_bd_design
  named file [option $options -files]
  if {[dict exists $options -top] && [dict exists $options -import]} {
    finish make_wrapper
  }
}

# ---- main: the command line of Vivado ------------------------------------------------------------------------------

# Vivado 2020.1 has Tcl 8.5: a script must do without what came with 8.6.
foreach command {lmap try throw tailcall coroutine yield yieldto zlib} {
  rename $command {}
}

proc stand_in::main {arguments} {
  set script ""
  set mode gui
  while {[llength $arguments] > 0} {
    set arguments [lassign $arguments word]
    if {$word in {-notrace -nolog -nojournal}} {
      continue
    }
    if {$word ni {-mode -source -log -journal -tempDir}} {
      refuse "vivado: unknown option '$word'"
    }
    set arguments [lassign $arguments value]
    if {$word eq "-source"} {
      set script $value
    } elseif {$word eq "-mode"} {
      set mode $value
    } elseif {$word eq "-log"} {
      write $value "log of [file tail $script]\n"
    }
  }
  if {$mode ne "batch"} {
    refuse "vivado: mode $mode would wait for a user"
  }
  uplevel #0 [list source $script]
}

if {[catch {stand_in::main $argv} message context]} {
  puts stderr [dict get $context -errorinfo]
  exit 1
}
exit 0

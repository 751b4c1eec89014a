# What the other scripts share, stated once: part, folders, sources, clock, and how a step fails. They source it first.
#
# needs:  build/vivado/sources.tcl of scripts/vivado.py: version, sources, axi_sources and parameters of this namespace
# writes: nothing by itself
# exits:  2 with one line if it can't start: an old Vivado, a part that is not installed, a file that is not there

namespace eval openecho {
  variable oldest 2020.1
  variable part xc7z035ffg676-2
  variable vendor openecho.org
  variable library lidar
  variable name openecho
  variable top openecho_core
  variable axi_top openecho_axi_top
  variable root [file normalize [file join [file dirname [info script]] .. ..]]
  variable output [file join $root build vivado]
  variable constraints [file join $root constraints xc7z035.xdc]
  variable ip [file join $output ip]
}

proc openecho::fail {status message} {
  puts stderr "error: $message"
  exit $status
}

proc openecho::require_vivado {} {
  variable oldest
  set found [version -short]
  if {![regexp {^\d+\.\d+} $found release] || [package vcompare $release $oldest] < 0} {
    fail 2 "Vivado: found $found, expected $oldest or newer"
  }
}

proc openecho::require_part {} {
  variable part
  if {[llength [get_parts -quiet $part]] == 0} {
    fail 2 "$part: this Vivado has no such part, expected Zynq-7000 to be installed with it"
  }
}

# A file that must be there; `expected` says where it comes from.
proc openecho::require_file {path expected} {
  if {![file isfile $path]} {
    fail 2 "$path: no such file, expected $expected"
  }
  return $path
}

# RTL and parameters as scripts/vivado.py has found them.
proc openecho::require_sources {} {
  variable output
  variable sources
  variable axi_sources
  uplevel #0 [list source [require_file [file join $output sources.tcl] "it from scripts/vivado.py"]]
  foreach path [concat $sources $axi_sources] {
    require_file $path "it from build/vivado/sources.tcl: run scripts/vivado.py again"
  }
}

# Name of the packaged core in the catalogue. Vivado numbers IP major.minor and counts revisions beside: 0.1.2 becomes
# version 0.1, and revision 2 of it.
proc openecho::vlnv {} {
  variable vendor
  variable library
  variable name
  variable version
  return $vendor:$library:$name:[file rootname $version]
}

# The AXI wrapper, which only packaging and the block design need.
proc openecho::require_axi {} {
  variable axi_sources
  variable axi_top
  if {[lsearch -glob $axi_sources */$axi_top.v] < 0} {
    fail 2 "rtl/axi: found no $axi_top.v, expected the core's AXI wrapper"
  }
}

# Period of the clock in ns, as the constraints have it.
proc openecho::clock_period {} {
  variable constraints
  set file [open [require_file $constraints "the constraints"]]
  set text [read $file]
  close $file
  if {![regexp -line {^set period ([0-9.]+)} $text -> period]} {
    fail 2 "$constraints: found no line 'set period', expected the clock's period in ns"
  }
  return $period
}

# Slack of the worst path in ns: of type max for setup, min for hold. Without a timed path there is none, and no result.
proc openecho::worst_slack {type} {
  set paths [get_timing_paths -delay_type $type -max_paths 1 -nworst 1]
  set slack ""
  if {[llength $paths] > 0} {
    set slack [get_property SLACK [lindex $paths 0]]
  }
  if {![string is double -strict $slack] || [string match -nocase *inf* $slack]} {
    fail 1 "timing: found no timed $type path, expected constraints that reach all of them"
  }
  return $slack
}

# Fail unless all slacks of a summary are at least zero.
proc openecho::fail_on_timing {summary} {
  foreach key {wns_ns whs_ns} {
    if {[dict exists $summary $key] && [dict get $summary $key] < 0} {
      fail 1 "timing: found $key [dict get $summary $key], expected 0 or more at [clock_period] ns"
    }
  }
}

# What the design takes, out of the rows of report_utilization.
proc openecho::utilisation {} {
  set report [report_utilization -return_string]
  set used [dict create]
  foreach {key row} {
    lut {Slice LUTs} lut_logic {LUT as Logic} lut_ram {LUT as Memory} ff {Slice Registers}
    bram {Block RAM Tile} dsp DSPs
  } {
    if {![regexp "\\|\\s*$row\\*?\\s*\\|\\s*(\[0-9.\]+)\\s*\\|" $report -> number]} {
      fail 1 "report_utilization: found no row $row, expected one for a 7-series part"
    }
    dict set used $key $number
  }
  return $used
}

# What scripts/vivado.py reads back, a key and a value a line: build/vivado/<step>.summary.
proc openecho::write_summary {step results} {
  variable output
  variable part
  variable parameters
  set summary [dict merge [dict create vivado [version -short] part $part period_ns [clock_period]] $results]
  foreach {name value} $parameters {
    dict set summary parameter.$name $value
  }
  set file [open [file join $output $step.summary] w]
  dict for {key value} $summary {
    puts $file "$key $value"
  }
  close $file
}

# Fail unless an earlier step was run with the parameters of this one.
proc openecho::require_same_parameters {step} {
  variable output
  variable parameters
  set path [require_file [file join $output $step.summary] "it from --step $step"]
  set file [open $path]
  set lines [split [read $file] \n]
  close $file
  foreach {name value} $parameters {
    if {"parameter.$name $value" ni $lines} {
      fail 2 "$path: made with another $name, expected $value: run --step $step again"
    }
  }
}

openecho::require_vivado
openecho::require_sources
openecho::require_part

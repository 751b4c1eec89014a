# Package openecho_axi_top as IP-XACT for Vivado's catalogue: two AXI4-Streams, AXI4-Lite and an interrupt on one clock.
#
#   vivado -mode batch -source scripts/vivado/package_ip.tcl -notrace      (scripts/vivado.py does it)
#
# needs:  build/vivado/sources.tcl from scripts/vivado.py, with the files of rtl/axi in it
# writes: build/vivado/ip, a repository for ip_repo_paths with the sources in it; build/vivado/package, a project
# exits:  0; 1 if an interface is not recognised or Vivado finds the package incomplete; 2 if it can't start

source [file join [file dirname [info script]] common.tcl]

proc openecho::identify {core} {
  variable version
  foreach property {vendor library name version} value [split [vlnv] :] {
    set_property $property $value $core
  }
  set_property core_revision [lindex [split $version .] 2] $core
  set_property display_name OpenEcho $core
  set_property description "Full-waveform lidar samples in, echoes out" $core
}

# What the packaged core is by default: the parameters that were chosen.
proc openecho::set_defaults {core} {
  variable parameters
  variable axi_top
  foreach {parameter value} $parameters {
    # A vector such as the taps is a bit string, which IP-XACT writes 0x...
    regsub {^\d+'h} $value 0x value
    foreach group {user hdl} {
      set found [ipx::get_${group}_parameters -quiet $parameter -of_objects $core]
      if {[llength $found] != 1} {
        fail 1 "rtl/axi: found no parameter $parameter of $axi_top, expected it as in openecho_core"
      }
      set_property value $value $found
    }
  }
}

# Names tell Vivado which ports make an AXI interface, a clock and a reset; an interrupt has to be named to it.
proc openecho::describe_interfaces {core} {
  if {[llength [ipx::get_bus_interfaces -quiet irq -of_objects $core]] == 0} {
    ipx::infer_bus_interface irq xilinx.com:signal:interrupt_rtl:1.0 $core
  }
  foreach bus {aclk aresetn s_axis m_axis s_axi irq} {
    if {[llength [ipx::get_bus_interfaces -quiet $bus -of_objects $core]] != 1} {
      fail 1 "rtl/axi: found no interface $bus in the ports, expected one"
    }
  }
  foreach bus {s_axis m_axis s_axi} {
    ipx::associate_bus_interfaces -busif $bus -clock aclk $core
  }
  ipx::associate_bus_interfaces -clock aclk -reset aresetn $core
}

namespace eval openecho {
  require_axi
  file delete -force $ip
  create_project -force -part $part package [file join $output package]
  add_files -norecurse [concat $sources $axi_sources]
  set_property top $axi_top [current_fileset]
  update_compile_order -fileset sources_1

  ipx::package_project -root_dir $ip -vendor $vendor -library $library -taxonomy /UserIP -import_files
  set core [ipx::current_core]
  identify $core
  set_defaults $core
  describe_interfaces $core

  ipx::create_xgui_files $core
  ipx::update_checksums $core
  if {[ipx::check_integrity $core] eq "0"} {
    fail 1 "$ip: Vivado finds the package incomplete, expected it to be sound: its messages are above"
  }
  ipx::save_core $core
  close_project
  puts "packaged: [require_file [file join $ip component.xml] "it from ipx::save_core"]"
}
exit 0

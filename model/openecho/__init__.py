"""OpenEcho: echoes out of full-waveform lidar, and the bit-exact model of the core that finds them."""

__version__ = "0.1.0"

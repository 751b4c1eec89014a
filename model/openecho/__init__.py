"""OpenEcho: echoes out of full-waveform lidar, and the bit-exact model of the core that finds them."""

from openecho.decompose import decompose

__all__ = ["decompose"]
__version__ = "0.1.0"

"""Scenes: what a full-waveform lidar would record of a described world, with truth."""

"""From simulated waveforms to terrain, with its truth: the V–L paper's experiment, and ground filters side by side."""

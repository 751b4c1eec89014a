"""Checks the float units, streamed from the HDL side."""

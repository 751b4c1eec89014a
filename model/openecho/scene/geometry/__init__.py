"""Geometry: where beams go and what they meet."""

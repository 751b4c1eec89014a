"""From echoes to terrain: points, what of them is ground, the surface through it, and heights above it."""

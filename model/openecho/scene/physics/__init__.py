"""Physics: pulse, air, targets, receiver; pure functions in SI, each with the source of its equation."""

"""Runs whole files through the core at the speed of the simulator, and compares all records with the golden model."""

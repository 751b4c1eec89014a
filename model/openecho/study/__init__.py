"""What the core's numbers are worth: against floating point, against the Cramér–Rao bound, and as a picture."""

"""The verification environment, written once for every module."""

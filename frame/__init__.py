"""Vibration of structures with fuzzy parameters."""

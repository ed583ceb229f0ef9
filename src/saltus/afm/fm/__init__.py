"""Frequency modulation: shifts, amplitude loops, self-excitation."""

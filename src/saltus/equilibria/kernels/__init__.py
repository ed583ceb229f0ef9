"""Compiled fields and spectra."""

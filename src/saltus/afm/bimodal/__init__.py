"""Bimodal microscopy: set points of two modes and their readings, to the sample's values and back, in maps."""

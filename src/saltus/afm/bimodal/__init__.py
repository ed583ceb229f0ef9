"""Bimodal microscopy: set points of two or three modes and their readings, to the sample's values and back, in maps."""

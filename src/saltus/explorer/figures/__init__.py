"""Figures of the page that need more than curves: the text at the pointer, multipliers on the unit circle."""

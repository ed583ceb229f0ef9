"""Checks of a curve of orbits by another way: simulations from segments' starts, and Liouville's theorem."""

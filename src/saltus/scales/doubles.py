"""Numbers of doubles themselves."""

import math

import numpy as np

__all__ = ["EPS", "ILL_CONDITIONED", "SMALLEST"]

# Spacing of doubles at 1: the relative rounding of one operation.
EPS = float(np.finfo(float).eps)

# The least double of full precision: what is below has no relative error that could be kept.
SMALLEST = float(np.finfo(float).tiny)

# An error in a function's states and its own rounding are apart by more than this only where half of the digits of
# its zero are lost: next to a double zero.
ILL_CONDITIONED = math.sqrt(EPS)

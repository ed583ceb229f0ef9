"""Extremes, integrals and outputs along an orbit."""

# Relative rounding of a coefficient that follows from numbers in formulas by some thousand operations.
WRITTEN = 1e-12

# Change of a gradient from place to place, over its largest entry, that is rounding: the function is affine.
AFFINE = 1e-12

# Difference of two slopes, over the largest along the orbit, up to which they are one.
SLOPES_ALIKE = 1e-6

# Difference of two extremes, over the range, up to which they are equal: a hundred times the finest tolerance.
EXTREMES_TIED = 1e-10

# Change of a quantity at a place, over its range, from which on it jumps there.
JUMPED = 1e-8

# Share of the range by which a sampled extreme may miss the true one: a look before the judgement.
EXTREME_SAMPLED = 0.05

# The same among the finer samples of a survey.
EXTREME_SURVEYED = 0.02

# Error of a quantity, over how much it varies with the states' sizes: the finest tolerance.
QUANTITY_ERROR = 1e-12

# Rate at a place, over the rates nearby, up to which a quantity turns there: rounding.
TURNS_THERE = 1e-14

# Height, over the largest, up to which what vanishes at a corner is on it.
ON_CORNER = 1e-9

# Amplitude, over the mean size of what oscillates, below which it is rounding of 0.
AMPLITUDE_ROUNDED = 1e-10

# Rounding of a number that a text has with nine digits: half of the last one, over a leading digit of 1.
PRINTED = 5e-9

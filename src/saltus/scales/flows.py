"""Errors of flows and quadratures, and the tolerances that are asked of them."""

from saltus.scales.doubles import EPS

# Rounding of an angle in a step, over the angle with all its turns: a sum of some ten terms, and its sine.
TURNED = 64.0 * EPS

# Relative tolerance to which an orbit is computed where a looser one cannot tell: the default, at which nothing
# is asked again. Steps of order 8 leave rounding a tenth of it.
FINEST = 1e-12

# Error that an orbit's flow leaves in a unit of growth, in its tolerance: so many steps of one tolerance each add up.
STEPS_TOGETHER = 10.0

# Error of a flow's sensitivities, which vary faster, over that of its states: meshes are made for that ratio.
SENSITIVITIES = 10.0

# Error of a step of sensitivities, in relative tolerances of the flow, up to which a mesh is kept: five of their own
# tolerance, which is a hundred of the states'.
SENSITIVITIES_KEPT = 500.0

# Error of a step, in tolerances, from which on a mesh tells nothing of where Newton's method is to go: it passes over
# what the state's own error does not show, as a small state that grows by many orders.
UNFIT = 1e4

# Change of an argument, in the scale of its function, over a step: 16 places of Gauss and Legendre give the integral of
# the exponential over this width with the rounding of doubles.
RESOLVED = 8.0

# Largest over least distance from a pole within a step: such places give the integral of the reciprocal to 1e-10.
RESOLVED_RATIO = 8.0

# Error of a quadrature over that which the tolerance leaves in what is integrated: it adds nothing to that one.
FINER = 0.1

# Share of an integral that lies in steps as short as rounding allows, above which it has no value: halving them goes
# on to change it. A logarithm's pole leaves 1e-13, that of an inverse root 1e-7.
DIVERGED = 1e-3

# Least absolute tolerance of a state, over the relative one and the size of the smallest state: closer to 0 the control
# of steps would ask for digits that a sum of terms of that size has not.
ABOVE_ROUNDING = 0.01

# Least relative tolerance of the flow for coefficients of normal forms, unless one vanishes: third differences over
# arcs of some 1e-3 keep few digits, and a finer flow gives no more.
ROUGHEST = 1e-8

# Curvature of the tangent spaces, over a cycle's size, that a piece at the saddle may magnify: what is left is as small
# as the Newton step of a converged cycle.
MAGNIFIED_CURVATURE = 1e-9

# Distance from 0 of an exponent, in half widths of its confidence interval, from which on it is not 0: chance
# passes one such width of 20 batches in one motion of 40, two in one of 4000.
BY_CHANCE = 2.0

# Change of the rate at which a deviation settles beside a bifurcation by terms of the next order, over the square of
# the rate: of order 1. At the doublings of the logistic map, Henon's, Ricker's and a cubic one it is 2 at the most.
NEXT_ORDER = 5.0

# Deviations after two counts of returns, one over the other, from which on neither is nearer to a period: the one after
# a multiple of the period is smaller by the doublings between.
NO_NEARER = 0.5

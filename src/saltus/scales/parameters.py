"""Parameters that rest, or have one value."""

# Change of a parameter per unit of arclength, or component of a tangent over the largest, up to which it is rounding
# and the parameter rests.
PARAMETER_RESTS = 1e-9

# The same up to which it may rest, if other signs agree.
PARAMETER_PERHAPS_RESTS = 1e-7

# The same from which on a branch's own parameter counts among those that move a quantity.
PARAMETER_MOVES = 1e-12

# The same below which a curve whose states grow may do so without bound.
PARAMETER_RESTS_IN_GROWTH = 1e-5

# Size of a state, over that at the start, from which on a curve may grow without bound.
GROWN = 1e3

# Change of a parameter, in its unit, that is rounding of solutions of one value.
PARAMETER_ROUNDED = 1e-11

# Change of a parameter, in its unit, that is rounding of the number itself.
PARAMETER_DIGITS = 1e-15

# Difference of a parameter, in its unit, up to which two solutions are at one value: a converged Newton step.
ONE_VALUE = 1e-9

# Change of a freed parameter, in its unit, up to which it has kept its value.
PARAMETER_KEPT = 1e-8

# Gap, or change of a freed parameter in its unit, up to which orbits are a family at fixed parameters.
FAMILY_STAYS = 1e-7

# Share of a parameter's interval by which a start may miss a bound.
BOUND_MISSED = 1e-9

# Distance in the parameter, over its interval, up to which a fold is the shadow of a change of signature.
FOLD_SHADOW = 1e-9

# Distance of both parameters, over their intervals, up to which a bifurcation is a change's shadow.
LOCUS_SHADOW = 1e-8

# Parameter, over its interval, up to which it reads 0.
AT_NO_VALUE = 1e-14

# Value of a parameter, in its unit, up to which it may be rounding of 0.
PERHAPS_ZERO = 1e-6

# Change of the parameter, over its interval, that is rounding while the period grows.
PARAMETER_STILL = 1e-12

# Difference of a stretch's end from a value, over the value or the range, that is rounding.
END_ROUNDED = 1e-12

# Change of the parameter, over its interval and the period's relative growth, up to which it rests while the period
# grows.
RESTS_WHILE_LONGER = 1e-3

# Change of the parameter, over its range on the branch, up to which it rests while the period of an orbit in pieces
# grows.
RESTS_IN_PIECES = 3e-6

# Way of the parameter over points beyond a change, over the longest, up to which it rests.
RESTS_BEYOND = 0.1

# Logarithm of the ratio of two growths, over that of slopes, below which the period levels off.
LEVELS_OFF = 0.25

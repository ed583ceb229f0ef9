"""Places along a branch, and zeros of its monitor functions."""

# Distance, over the range along a curve, up to which two places of it are one: special points are located to some 1e-9.
LOCATED = 1e-7

# Distance in arclength up to which two points of a curve are the same: special points are located to some 1e-9, next to
# singular ones to 1e-7.
SAME_POINT = 1e-6

# Arclength of a step up to which several events or critical values may lie in it: no shorter step parts them.
CROWDED = 1e-5

# Distance in arclength below which a special point is a point of the branch: a converged Newton step.
POINT_OF_BRANCH = 1e-9

# Least distance, in arclength, from a special point of a point that has none of its rank.
ASIDE_OF_POINT = 1e-4

# Arclength from a branch point within which the parameter turns because of it.
TURNS_AT_POINT = 1e-5

# Arclength from a branch point within which the parameter rests if it turns there.
VERTEX = 0.05

# Distance in arclength between a branch point and the zero of its determinant.
BRANCH_POINT_NEAR = 1e-3

# Arclength between a fold and a branch point that are one where the period halves.
FOLD_AT_HALVING = 1e-4

# Distance, over the parameter's interval, between a branch point and the period doubling of the shorter orbit.
DOUBLING_AT_HALVING = 1e-4

# Arclength from a double value within which another one is its shadow.
DOUBLE_SHADOW = 1e-4

# Test function, over its usual size, up to which a start is critical.
START_CRITICAL = 1e-10

# Monitor function, over its values at the step's ends, that counts as 0.
MONITOR_ZERO = 1e-11

# The same at a located event, up to which its sign is rounding.
MONITOR_SIGN = 1e-6

# The same at a located zero, beyond which the function jumps there.
MONITOR_JUMPS = 1e-3

# Share of a step between two places up to which they tell the same of the branch.
PLACES_ALIKE = 1e-6

# Test function within a step, over its size, up to which its sign is rounding.
TESTED_SIGN = 1e-9

# Distance of two zeros, in steps, up to which they are one of equal values.
ZEROS_ALIKE = 1e-5

# The same up to which they are those of a value that touches a border.
ZEROS_TOUCH = 0.25

# What a cubic misses of a test function in the middle of a part of a step, up to which values are taken to be followed,
# not mistaken for others.
VALUES_FOLLOWED = 0.01

# The same up to which a function that changes its sign in a part of a step does so once.
CROSSES_ONCE = 0.25

# The same over the slope, up to which a function passes 0 once where it is steeper than a miss.
PASSES_ONCE = 0.25

# Way of a value in a step, over its scale, up to which it is taken to move steadily.
MOVES_STEADILY = 0.3

# Factor on the curvature of a test function when two zeros within a step are suspected: it may grow within.
TWO_ZEROS = 2.0


# Change of the unknowns, over their sizes, within which a quantity's gradient is kept.
GRADIENT_KEPT = 1e-8

# Share of a solution's size by which it may be farther from its guess than both neighbours are apart.
GUESS_MISSES = 1e-6

# The same of the nearest of all solutions found, as beside a grazing, where orbits grow like a root.
GUESS_MISSES_BESIDE = 1e-3

# Distance of an orbit from where interpolation has it, over that of neighbours, two on each side, at most.
SHEET_REACH = 1.5

# The same over the orbit's size, that may be rounding.
SHEET_ROUNDED = 1e-6

# Distance from a special point at which a sheet is cut off, over the sheet's length.
SHEET_END = 1e-5

# Test function where it touches 0, over its values at the step's ends: a place found to 1e-6 of a step leaves 1e-12.
TOUCHES_ZERO = 1e-10

# What a polynomial misses of a root of a touching function, over its size: of |s^2 + d^2| that misses d over the step.
ROOT_SMOOTH = 1e-3

# Distance of a corrected point from the interpolated one, over the step, up to which it lies on the same branch.
TOUCHING_SHARE = 0.05

# Angle between directions, at radii of a factor 4, up to which they belong to one curve through a point.
CURVES_ALIKE = 0.25

# Second derivatives of a bifurcation equation, over the third ones, and roots of their form, over it, up to which they
# tell no directions: a located point of higher order is known to some 1e-5.
FORM_DEGENERATE = 1e-4

"""Orbits, directions and solutions that are one."""

# Two rounds of an orbit that was computed at the finest tolerance are one up to this share of a state's range: the
# error of its points, a few tolerances at each of some 100 steps, magnified by 1/(1 - multiplier) of up to 10^4.
ROUNDS_ALIKE = 1e-6

# The same over the size of a state, whose range may be nothing: rounding of the return.
ROUNDED_ROUNDS = 1e-12

# An orbit that is solved to rounding goes round a shorter one twice where its halves differ by that share of states'
# sizes. Next to the halving they differ by the root of the distance, a few 10^-7 at the least of 10^-13.
HALVES_ALIKE = 1e-8

# The same between the halves at a located turn of the branch, where the place is known to half the digits.
HALVES_AT_TURN = 1e-3

# The same where the shorter orbit is sought for, and then decides by its own multiplier -1.
HALVES_PERHAPS = 1e-2

# Difference of two returns, over the states' sizes, up to which a motion recurs: what Newton's method leads to the
# orbit from.
RECURS = 1e-3

# Largest distance of a motion from the orbit on which it settles, in the states' sizes.
SETTLES_ON = 0.1

# Difference of two growths of a state over rounds, over their mean, up to which it drifts evenly.
GROWTHS_EVEN = 1e-6

# The same where returns are seen between samples.
GROWTHS_SAMPLED = 1e-2

# Distance of a growth from whole turns, in turns, up to which the state is an angle.
WHOLE_TURNS = 1e-3

# Relative difference of extremes or ranges up to which two orbits of a branch are one.
EXTREMES_ALIKE = 1e-6

# Difference of extremes, over the states' sizes, up to which orbits on both sides of a point may be neighbours.
EXTREMES_BEYOND = 0.05

# Share of an orbit's distance from a point, at a quarter of the parameter's way to it, below which it comes there: a
# half where orbits grow like a root, 0.63 like a cubic one, 1 where they jump.
NEARER = 0.75

# The same of an arc and the last cycle before it, in sizes of the cycle.
EXTREMES_OF_ARC = 0.2

# Difference of a cosine from 1 up to which two branches have one direction: the angle is its root, half of the digits.
DIRECTIONS_ALIKE = 1e-9

# The same of two solutions at an amplitude, up to which they are on one branch: branches bend within it.
SOLUTIONS_ALIKE = 1e-3

# Relative difference of states, events or periods at a grazing up to which they are equal: the error of a located
# point.
CONDITIONS_ALIKE = 1e-6

# Difference of two fields, over their sizes, up to which they are one.
FIELDS_ALIKE = 1e-9

# Field of the other mode at an equilibrium on a surface, over its terms, up to which it is one of that mode too: the
# field is continuous there.
FIELDS_MEET = 1e-7

# Distance, in the states' sizes and the parameter's unit, up to which two border collisions of a map are one.
BORDERS_ALIKE = 1e-8

# Distance of the halves of a map's orbit, in the states' sizes, at which the period halves: located points are known to
# half the digits.
HALVES_OF_MAP = 1e-5

# Difference of the parameter, over the interval, up to which special points of two branches are one.
SPECIALS_AT_ONE_VALUE = 1e-6

# The same of the states, over their ranges in the diagram: next to a fold they go like the root of the parameter.
SPECIALS_IN_ONE_STATE = 1e-4

# Change, over the unknowns' sizes, by which the first point of a locus may differ from the start: more is another
# point.
START_MOVED = 1e-3

# Change of a state, over the largest size, by which a solution is another one.
SOLUTION_APART = 1e-8

# Most difference of a Hopf point from the extrapolated end of its cycles, over the distance from the last cycle.
HOPF_AGREES = 0.1

# The same farther than the nearer number of steps.
HOPF_AGREES_AFAR = 0.01

# Difference of an arc's parameter from the one extrapolated along the branch of cycles, over its size.
ARC_AGREES = 1e-6

# The same over the distance from the last cycle.
ARC_AGREES_AFAR = 0.3

# Difference of the parameter of a long cycle from that of its arc, over its size: the two part exponentially little.
LONG_CYCLE_AGREES = 1e-8

# Share of the guess's period below which an orbit has vanished; its square, of the guess's extent.
VANISHED = 1e-3

# Ranges of states and period, over the largest on the branch, up to which an orbit vanishes.
VANISHED_ON_BRANCH = 1e-4

# Distance from an equilibrium, in sizes of the cycle, up to which a cycle passes near it.
PASSES = 0.1

# The same for any further equilibrium.
PASSES_ANOTHER = 0.03

# Distance, in the same sizes, that a cycle reaches between two passages.
LEAVES = 0.3

# Speed, over the cycle's mean speed, below which a local minimum is a slow place.
PASSES_SLOWLY = 0.2

# Most difference of the period's power of the distance from a saddle-node from -1/2.
SADDLE_NODE_POWER = 0.05

# Least ratio of an unbounded period to its least value on the branch.
PERIOD_GROWN = 1.2

# Ratio by which a period must grow while all else stands still.
PERIOD_LONGER = 1.03

# Least ratio of a state's unbounded range to its least on the branch.
RANGE_SWOLLEN = 1e4

# Sine of the angle between flow and plane below which a plane does not hold an orbit's centre.
OBLIQUE = 0.3

# Distance of a solution from the line through two neighbours at its parameter, over their distance, up to which it
# is one of that branch. By the curvature of a step it is some hundredths, on the other sheet of a fold 1 or more.
ON_LINE = 0.25

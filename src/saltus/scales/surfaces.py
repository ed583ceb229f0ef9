"""States on surfaces, grazings, and segments without duration."""

# A state lies on a surface up to this value of the event function, over its variation with the states' sizes: the
# error of a grazing that was located, which is quadratic in what is left.
ON_SURFACE = 1e-6

# Two states at one instant are one up to this difference, over the states' sizes: the same error.
ONE_STATE = 1e-6

# Share of a period above which a segment is no candidate for events of one instant: a look before the judgement.
BRIEF = 1e-6

# A reset carries what is left of a landing's event function on to the state behind it, enlarged by so much at most:
# resets of walls leave the function itself as it is.
CARRIED = 4.0

# Event function or condition, over its variation with the states' sizes, up to which it is 0 and the state on the
# surface: a converged Newton step.
MET = 1e-9

# The same at a segment's end that an event does not end, where the flow's error comes in.
MET_AT_END = 1e-8

# Share of an event function's variation that is rounding.
EVENT_ROUNDED = 1e-13

# Share of an event function's variation within which a segment is as a whole equally far from its surface.
EQUALLY_FAR = 1e-8

# Share of the period below which a segment is too short to show such a distance.
TOO_BRIEF = 1e-4

# Condition at an extremum of the event function, over its values nearby, below which it is 0 there.
CONDITION_VANISHES = 1e-4

# Sum of two opposite conditions that is 0: beyond what a condition that includes 0 adds to be positive there.
CONDITION_INCLUDES = 1e-290

# Roundings of a duration, at most, that a sum of steps makes: the surface of an event is reached within so many.
ROUNDINGS = 8.0

# Part of an event's gradient across another one, over its length, up to which the two surfaces are one.
PARALLEL_GRADIENTS = 1e-4

# Distance from a surface, over the event's size, or duration, over the period, up to which it vanishes: quadratic in a
# located grazing's error.
TOUCHING = 1e-6

# Margin, over the size of the events, up to which a locus of grazings touches all along.
TOUCHED = 1e-10

# Rate of an event over a period, over its size, up to which it is met without speed, as at a grazing.
SPEEDLESS = 1e-6

# Distance from a grazing, over the branch's range, at which a motion is rounding: the error of its place.
AT_GRAZING = 1e-6

# Value given to a monitor function that vanishes at the start: rounding, on its admissible side.
ADMISSIBLE_SIDE = 1e-13

# Duration of a segment, over the period, up to which it has none.
NO_DURATION = 1e-9

# The same up to which two events that have parted may have exchanged their order.
PARTING = 1e-2

# Duration of an excursion, over the period, up to which it may be about to vanish.
EXCURSION_SHORT = 1e-2

# Least share of its time away by which a second motion's is shorter where an excursion vanishes: that of a fourth root.
EXCURSION_SHRINKS = 0.5

# Power of the time with which a field changes behind a segment's begin, below which it has a root there: that is 1/2.
ROOT_ORDER = 0.75

# Least velocity of an event at a step's end, over that at its start: a slower one may be a grazing's.
SLOWED = 0.05

# Rate of a surface where a motion leaves it, over the largest on the branch, next to a two-fold.
BESIDE_TWO_FOLD = 0.05

# Rounding of an event function, over the height of a hop, from which on the hop's speed and time lose their digits.
HOP_ROUNDING = 1e-4

# Change of a parameter, in its unit, by further hits, that is rounding of their heights.
ACCUMULATION_SETTLED = 1e-13

# Growth of an error behind a hit up to which further hits of an accumulation are followed before the orbit is solved
# again: the guess is then within Newton's reach.
FOLLOWED_GROWTH = 30.0

# Points at the end of a branch that tell on which side of an accumulation its orbits are: some may lie beyond it by the
# flow's error, and a branch that turned before has been on both sides.
SIDE_POINTS = 24

"""What verification allows of an answer, by methods of its own."""

# Distance of a solution from the one that Newton's method finds, over the states' sizes.
VERIFIED_STATE = 1e-8

# Distance of a critical eigenvalue from its place, over the largest modulus: a located point's error moves it.
VERIFIED_VALUE = 1e-6

# The same of an event function, over its variation with the states' sizes.
VERIFIED_SURFACE = 1e-7

# Modulus of the largest state up to which all are at 0.
ALL_AT_ZERO = 1e-12

# Accuracy of an eigenvalue, over the largest rate of the Jacobian nearby: some tens of roundings.
EIGENVALUE_DIGITS = 1e-14

# Least singular value of a Jacobian, over the largest, up to which Newton's method is not asked.
NEWTON_REFUSED = 1e-13

# Distance of a segment from a surface, over the event's unit, up to which it is the method's error.
VERIFIED_SEGMENT = 1e-8

# Share of a duration next to a segment's ends in which an event is that of the end.
VERIFIED_ENDS = 1e-7

# Distance of a segment's end from the next start, over the states' sizes.
VERIFIED_GAP = 1e-9

# Error of a duration, over the period.
VERIFIED_TIME = 1e-8

# Rate of an event function, in its unit and the period, below which its time is not determined.
VERIFIED_SPEED = 1e-5

# Modulus from which on a multiplier is that of an event met without speed.
VERIFIED_INFINITE = 1e9

# Distance of a grazing orbit from its surface, over the surface's unit.
VERIFIED_TOUCH = 1e-6

# Error of an extreme, over the quantity's size.
VERIFIED_EXTREME = 1e-7

# Way of the states in a period, over their sizes, up to which an orbit is an equilibrium.
VERIFIED_REST = 1e-7

# Relative accuracy of the imaginary pair of a cycle that has shrunk to an equilibrium.
VERIFIED_SHRUNK = 1e-6

# Absolute accuracy that is asked of any multiplier.
VERIFIED_MULTIPLIER = 1e-9

# Accuracy of an eigenvalue, over the norm.
VERIFIED_EIGENVALUE = 1e-12

# Ratio of a product's norm to an eigenvalue from which on doubles lose digits.
DOUBLES_SUFFICE = 1e5

# Least allowance by which a difference is divided: it is above 0.
LEAST_ALLOWANCE = 1e-300

# Tolerance to which equations without a flow are solved.
EQUATIONS_SOLVED = 1e-12

# What a search for an optimum leaves of the gradient, over its size, where rounding ends it.
GRADIENT_LEFT = 1e-5

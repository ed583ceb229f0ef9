"""Multipliers and eigenvalues: critical, equal, in pairs, or lost."""

# Eigenvalue, over the largest, below which one decomposition of the whole matrix loses five of its digits, as its
# error is the rounding of the largest: such a value is computed apart, and has a size of its own.
SEPARATED = 1e-5

# Modulus of a multiplier from which on an event is met without speed: the inverse of the share of a period at which
# the time of an event is rounding.
INFINITE = 1e10

# Relative error of a multiplier beyond which its place tells nothing of the next one along a branch.
ROUGH = 1e-2

# Height on the Riemann sphere within which a multiplier is on neither side of the unit circle: a converged Newton step.
ON_CIRCLE = 1e-9

# Height on the Riemann sphere, or distance from the unit circle, up to which a multiplier is critical: that of a simple
# one at a located point.
MULTIPLIER_CRITICAL = 1e-6

# Distance from the unit circle that is rounding in a conservative system: values there meet in pairs, which halves
# their digits.
NEUTRAL = 1e-5

# Distance of a multiplier from its critical value that confirms a bifurcation, besides its error.
CONFIRMED = 1e-5

# Distance of a multiplier from 1 up to which a first orbit may be one of a family; its equations then decide.
PERHAPS_OF_FAMILY = 1e-2

# Distance of a multiplier or condition from the critical place up to which a start or an orbit is taken for critical.
AT_CRITICAL = 1e-3

# Height on the Riemann sphere up to which a multiplier may become critical in the next step.
PERHAPS_CRITICAL_NEXT = 0.5

# Modulus of multipliers up to which they are far from critical, as beyond its inverse.
FAR_FROM_CRITICAL = 0.15

# Modulus from which on a multiplier counts as this in test functions: a larger one has no digits.
LARGEST_TESTED = 1e10

# Distance of eigenvalues from the imaginary axis, over how far they move in a step, from which on none reaches it.
AXIS_REACHED = 4.0

# Imaginary part, over the modulus, from which on a value is one of a complex pair: less is rounding.
PAIRED = 1e-12

# The same along loci, where double values come apart by the error of the point.
PAIRED_ON_LOCUS = 1e-9

# Relative difference of two eigenvalues up to which they are equal by symmetry; of one and its conjugate, real.
EQUAL_BY_SYMMETRY = 1e-6

# Distance of two multipliers, over their moduli, up to which they are equal by symmetry: flows of a tolerance do not
# keep it.
EQUAL_TWINS = 1e-5

# Arclength between zeros that belong to equal pairs.
ZEROS_OF_TWINS = 1e-7

# Distance of a value from the critical place, over that of the critical value, up to which it is its twin.
TWIN = 10.0

# Share of the null vectors in each other below which a multiplier is a double one: its slope is no more determined.
DOUBLE = 1e-6

# Coupling of multipliers below which they count as parted: rounding of the turns that part them.
DECOUPLED = 1e-13

# Square of the cosine from which on a vector is no improvement of another one.
ALIGNED = 0.99

# Least ratio of the distances of an exchanged pairing of multipliers to those of a sure one.
EXCHANGED = 2.0

# Relative difference of the flow and its image under an orbit's map up to which it is rounding.
REVERSED = 1e-3

# Modulus of a multiplier, in tolerances of the flow and beside the trivial one, below which it is error.
MULTIPLIER_LOST = 100.0

# Change of the Jacobian's entries, in tolerances of the flow, by which errors of multipliers are estimated.
MATRIX_ERROR = 10.0

# Modulus of a multiplier beside which one near the unit circle may have no digits left.
BESIDE_LARGEST = 1e8

# Error of a logarithm up to which a product of multipliers is told.
PRODUCT_TOLD = 0.1

# Rounding of the product of multipliers' distances, over its values at a step's ends.
PRODUCT_ROUNDED = 1e-14

# Size of a normal form's coefficient, over its terms, below which it is rounding: differences lose the other digits.
COEFFICIENT_ROUNDED = 1e-10

# Real part of a centre's eigenvalues, over the imaginary one, that is rounding.
UPRIGHT = 1e-6

# Real part of a critical pair, over the largest modulus, above which there is no Hopf point.
PAIR_CRITICAL = 1e-6

# Squared frequency, over the squared size of the Jacobian, below which l1 is rounding, as at a BT.
FREQUENCY_ROUNDED = 1e-6

# Growth of an eigenvalue up to which its sign is rounding.
GROWTH_ROUNDED = 1e-9

# The same from which on its sign is known.
GROWTH_RESOLVED = 1e-7

# Growth of an eigenvalue, over the largest, from which on its sign is clear at a critical point.
GROWTH_CLEAR = 1e-6

# Growth of a value along a locus, over its rounding, to within which no step leads, unless it is short.
GROWTH_TOUCHED = 10.0

# The same up to which a value is critical at a located point as well.
GROWTH_CRITICAL = 100.0

# Function that vanishes at a double value, up to which a locus starts there.
DOUBLE_AT_START = 1e-6

# Distance from R1, R2 and R3, in the cosine, within which a torus' coefficient is undetermined.
RESONANT = 1e-4

# Error of a multiplier near the unit circle from which on its place tells nothing: that of the circle's radius.
LIKE_ONE = 1.0

# Error of the logarithm of a product up to which the product has a digit left, by which a wrong one is seen.
UNIT_OF_GROWTH = 0.1

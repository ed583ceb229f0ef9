"""Matrices that are singular, and forcing at which a solution persists."""

# Least singular value, over the largest, of a singular matrix of an orbit's equations: the error of entries that flows
# give, with three digits of room.
SINGULAR = 1e-9

# The same of equations without a flow, as of equilibria, whose entries are known to rounding.
SINGULAR_AT_ROUNDING = 1e-12

# The same of equations at a located point: the point's error moves singular values.
SINGULAR_AT_POINT = 1e-6

# The same of the equations with a parameter, below which a family of orbits goes on: a weaker dependence ends none.
SINGULAR_FAMILY = 1e-6

# The same of an orbit's matrix at one of its multipliers, whose own error is larger than that of the entries.
SINGULAR_AT_MULTIPLIER = 1e-7

# Least singular value, over the largest, of a system that is solved with: an orbit's of 1e-12 leaves a digit.
REGULAR = 1e-11

# Least diagonal entry of a triangle, over the largest, from which on it is solved with: smaller ones are rounding,
# magnified by the elimination.
REGULAR_TRIANGLE = 1e-10

# Least singular value, over the largest, of a matrix whose determinant is rounding, so that its sign tells nothing.
OPEN_DETERMINANT = 1e-10

# Singular value of an orbit's equations, over the largest, that is rounding of 0 where their defect is counted.
DEFICIENT = 1e-8

# Least singular value of a regular solution's equations at a multiple point, over what the parameter changes: smaller
# ones belong to solutions that are not isolated.
REGULAR_SOLUTION = 1e-3

# Least singular value, over the next one, above which its vectors are not known: they turn into each other.
LEAST_APART = 0.3

# Cosine of the angle between the gap and the left null vector below which the gap is turned.
GAP_TURNED = 0.8

# Change of a quantity from orbit to orbit, in scaled unknowns, up to which it explains why an orbit with its value was
# not found.
SLIGHT = 1e-2

# Size of an equation's terms, over the largest, up to which it has no size of its own: it is the rounding of others.
TERMS_FAINT = 1e-12

# Condition of eigenvectors from which on they do not span tangent spaces accurately: half of the digits are lost.
SKEW = 1e7

# Forcing of the equations, in their units, up to which an orbit is closed or a branch point persists: a converged
# Newton step.
UNFORCED = 1e-9

# The same of an orbit beside a solution, up to which it is one of a family: differences lose a digit.
UNFORCED_BESIDE = 1e-8

# Forcing by a parameter, over the equations' change by it, up to which a branch point persists: the point's error
# forces, too.
UNFORCED_BY_PARAMETER = 1e-6

# Forcing from which on the branch points of a locus do not persist: more than a located point's error.
UNFOLDED = 1e-7

"""Newton steps and residuals by which a solution is taken or refused."""

from saltus.scales.doubles import EPS

# Relative error of a solution of algebraic equations: the last Newton step.
SOLVED = 1e-13

# Newton's method has converged to an orbit where its step, over the unknowns' sizes, is ten times the finest tolerance:
# the next step, its square, is rounding.
SETTLED = 1e-11

# Largest Newton step, over the unknowns' sizes, of a converged solution of an orbit's equations: the next step, its
# square, is below rounding.
NEWTON_CONVERGED = 1e-9

# The same in compiled stretches of a branch, which measure a step by the largest of more sizes.
NEWTON_ACCEPTED = 2e-9

# Relative Newton step from which on there is no solution to converge to.
NEWTON_DIVERGED = 1e6

# Newton step of a converged solution of equations without a flow, as of equilibria and arcs by collocation: their
# rounding is far below that of an orbit's.
NEWTON_AT_ROUNDING = 1e-12

# The same where steps shrink no further: an orbit's would have converged.
STALLED_AT_ROUNDING = 1e-9

# Newton step of a located point where rounding keeps steps from shrinking further: next to a singular matrix half of
# the digits are lost.
LOCATING_STALLED = 1e-7

# Newton step up to which a solution is taken whose residual is rounding alone: the matrix magnifies that rounding, and
# no step is smaller.
STEP_AT_ROUNDING = 1e-6

# Relative Newton step up to which a further correction of an orbit in pieces is kept: a longer one is no refinement.
SHARPER = 1e-6

# Largest residual of a point of a branch, over the sizes of its states, events and terms: ten converged Newton steps.
RESIDUAL_KEPT = 1e-8

# Residual of an orbit, over the smallest state's size, up to which no further look is needed.
RESIDUAL_CLEAR = 1e-9

# Largest residual of an orbit, over the sizes of what is subtracted in it: half of the digits cancel at worst.
RESIDUAL_LEFT = 1e-6

# The same in relative tolerances of the flow, where that is more: some hundred steps leave an error each.
RESIDUAL_LOOSE = 100.0

# Residual of an orbit, over the largest state's size, that is rounding: some hundred steps leave a rounding each.
RESIDUAL_ROUNDING = 1e-13

# Share of Newton's step to a surface by which the surface is met earlier, from which on the steps need not contract.
STRAIGHT = 0.5

# Residual of an orbit in units of its equations, from which on Newton's steps need not make it smaller.
RESIDUAL_SMALL = 1e-6

# The same that no nearer guess makes smaller: ten times the finest tolerance.
RESIDUAL_LEAST = 1e-11

# Residual of equations without a flow, over their sizes, that is rounding of their sums.
ALGEBRAIC_RESIDUAL = 64.0 * EPS

# Change of a place between two others, over their distance, at which bisection ends: rounding of the place.
CENTRED = 1e-13

# Change of the parameter by the last ten times nearer ends of an arc, over its size, up to which it is located.
ARC_LOCATED = 1e-7

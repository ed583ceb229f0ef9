"""States at rest, and sizes that are rounding of 0."""

# Size or range of a state, over the largest one's, up to which it rests at 0 and has no size of its own: the rounding
# of larger ones and a Newton step may leave that much.
RESTING = 1e-9

# Motion of a state over a period or stretch, over its size, up to which it rests: the error that Newton's method
# leaves.
UNMOVED = 1e-9

# Size of an orbit at rest, over those on its branch, below which its own states tell no sizes: half of the digits are
# lost.
NEARBY = 1e-6

# Powers of ten between 1 and the size at which fields, resets or maps bend, up to which states that rest in the origin
# have the size 1: their first orbits beside it are taken a thousandth of the size away.
UNIT_DECADES = 3

# Range of a state, over the largest of all states, up to which it may be a branch's birth or rounding.
RANGE_FAINT = 1e-6

# Ranges of a cycle's states, over those on its branch, up to which it is an equilibrium: the amplitude goes like the
# root of the parameter's distance, known to 1e-12.
SHRUNK = 1e-6

# Least modulus of a state that keeps its sign, over its largest one, from which no finer absolute tolerance is asked.
NEAR_ZERO = 1e-3

# The least such share that an absolute tolerance follows: the finest relative tolerance.
NEAREST_TO_ZERO = 1e-12

# Size of an orbit up to which all of it is rounding of 0.
ORBIT_NOTHING = 1e-13

# Size of a state, over the largest, that may be rounding of 0 within an orbit's map: an elimination leaves that much.
SIZE_LOST = 1e-13

# Size of a state, over the largest that a search has seen of it, from which on it has died away: rounding of that size.
DIED_AWAY = 1e-15

# Rounding of a state, over its size, in the differences of returns: the finest tolerance.
STATE_ROUNDED = 1e-12

# Size of a state, over that of the guess, below which what is left may be rounding of the guess: half of the digits.
GUESS_ROUNDED = 1e-8

# Rate of a state, over its terms, that is rounding of 0: a few roundings of doubles.
RATE_ROUNDED = 1e-15

# Term of a rate up to which it moves nothing: the square of such a size is 0.
MOVES_NOTHING = 1e-100

# Share of its distance from an equilibrium that a motion keeps, at the most, where it comes to rest.
COMES_TO_REST = 1e-2

# Range of a state or output over a period, over its size, up to which it is constant: an orbit's error with room, as it
# is a user's choice that is refused.
CONSTANT = 1e-7

# The same along a guess, which may be far from the orbit, above which it is not constant.
VARIES = 0.1

# Change of the motion, over its size, up to which it is the same without some states.
UNCHANGED_ALONE = 1e-6

# Share of a state's modulus below which its size on a branch is not chosen: its way tells more.
SIZE_CHOSEN = 1e-2

# Modulus of a state, over its way, below which it is next to 0.
BESIDE_ZERO = 0.1

# Response of a state to a parameter, over its size, from which on the start may lie next to a fold.
STEEP = 1e3

# Change of a response by rounding of the unknowns, over the response, up to which it is not rounding itself.
RESPONSE_KNOWN = 0.5

# Growth of a motion beside a boundary equilibrium, over its start, at which it does not come back: a spiral grows by as
# much in three turns at the most for which its return has digits left.
TURN_GROWN = 1e8

# Change of such a motion in a part of its fastest time, over its size, at which it rests; half of the digits of two
# returns that are the same.
TURN_RESTS = 1e-10

# Distance from a rest, over that of a solution beside it, at which the branch is looked at next: its size is known to
# that factor, by which no step is too long.
FARTHER = 4.0

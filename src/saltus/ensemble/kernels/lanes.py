"""Functions that the generated text of lanes calls: loads and stores, roots by bits, sines without calls, tests of traps."""

from __future__ import annotations

import itertools
import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from saltus.ensemble.labels import DIVERGED, DONE, FALLING, UNDECIDED
from saltus.system.numba_tools.bits import bits_of, float_of
from saltus.system.numba_tools.machine_code import njit, shared
from saltus.system.numba_tools.pointers import entries

FAST = {"contract", "nsz", "arcp", "reassoc"}  # rounding may differ, infinities and NaN may not
# Options of what is done for one lane. It makes no array; counting references to records would take longer than the
# work itself. The code is kept with that of the generated text, whose name tells of the records too.
SCALAR = {"nogil": True, "error_model": "numpy", "_nrt": False}
_HALLEY = 2  # Halley's iterations of a landing
_BIAS = float(1023 * 2**52)  # bits of the float 1.0, read as an integer
_TWO_OVER_PI = 2.0 / math.pi
_HALF_PI = math.pi / 2.0
_HALF_PI_LOW = 6.123233995736766e-17  # what rounding has left out of it


@intrinsic
def ld(typingctx, lanes, field, lane):
    """lanes[field + lane], with an index that the compiler knows not to wrap: or a loop over lanes has no vectors.

    lanes: an array, or a pointer to its entries.
    """

    def lower(context, builder, signature, arguments):
        data = entries(context, builder, signature.args[0], arguments[0])
        row = builder.gep(data, [arguments[1]], inbounds=True)
        return builder.load(builder.gep(row, [arguments[2]], inbounds=True))

    return types.float64(lanes, types.int64, types.int64), lower


@intrinsic
def st(typingctx, lanes, field, lane, value):
    """lanes[field + lane] = value; see `ld`."""

    def lower(context, builder, signature, arguments):
        data = entries(context, builder, signature.args[0], arguments[0])
        row = builder.gep(data, [arguments[1]], inbounds=True)
        builder.store(arguments[3], builder.gep(row, [arguments[2]], inbounds=True))
        return context.get_dummy_value()

    return types.void(lanes, types.int64, types.int64, types.float64), lower


@intrinsic
def floor(typingctx, number):
    """The largest integer that is not above a number, as a float."""

    def lower(context, builder, signature, arguments):
        return builder.call(builder.module.declare_intrinsic("llvm.floor", [ir.DoubleType()]), arguments)

    return types.float64(types.float64), lower


@intrinsic
def products(typingctx, *factors):
    """a0*b0 + a1*b1 + ... of factors in turn, each product added to the sum of those before: one instruction each.

    Many lanes are at work at once, so that the length of a sum does not matter: see `saltus.system.numba_tools.lowering`.
    """
    pair = types.StarArgTuple.from_types(factors)

    def lower(context, builder, signature, arguments):
        (packed,) = arguments
        values = [builder.extract_value(packed, i) for i in range(len(factors))]
        flags = ("contract", "nsz")
        total = builder.fmul(*values[:2], flags=flags)
        for i in range(2, len(values), 2):
            total = builder.fadd(total, builder.fmul(*values[i : i + 2], flags=flags), flags=flags)
        return total

    return types.float64(pair), lower


def _powers(builder, h, degree):
    """The squares of h, of its square, and so on, as far as a polynomial of a degree needs them."""
    powers = [h]
    while 2 ** len(powers) <= degree:
        powers.append(builder.fmul(powers[-1], powers[-1]))
    return powers


def _in_pairs(builder, terms, powers):
    """A polynomial, in few steps that wait for each other (G. Estrin, 1960)."""
    for power in powers:
        pairs = [terms[i : i + 2] for i in range(0, len(terms), 2)]
        terms = [builder.fadd(p[0], builder.fmul(p[1], power)) if len(p) == 2 else p[0] for p in pairs]
    return terms[0]


@intrinsic
def polynomial(typingctx, h, *coefficients):
    """Return c0 + c1*h + c2*h**2 + ...; as one call it compiles many times faster than as its operations."""
    packed = types.StarArgTuple.from_types(coefficients)

    def lower(context, builder, signature, arguments):
        h, packed = arguments
        terms = [builder.extract_value(packed, i) for i in range(len(coefficients))]
        return _in_pairs(builder, terms, _powers(builder, h, len(terms) - 1))

    return types.float64(types.float64, packed), lower


@intrinsic
def halley(typingctx, h, *coefficients):
    """Two of Halley's iterations from h for a polynomial to vanish: where they end, the last change, the slope before it."""
    packed = types.StarArgTuple.from_types(coefficients)

    def lower(context, builder, signature, arguments):
        h, packed = arguments
        terms = [builder.extract_value(packed, i) for i in range(len(coefficients))]
        number = ir.DoubleType()
        first = [builder.fmul(number(float(k)), c) for k, c in enumerate(terms) if k >= 1]
        second = [builder.fmul(number(float(k * (k - 1))), c) for k, c in enumerate(terms) if k >= 2]
        for _ in range(_HALLEY):
            powers = _powers(builder, h, len(terms) - 1)
            y, dy, ddy = (
                _in_pairs(builder, kept, powers[: (len(kept) - 1).bit_length()]) for kept in (terms, first, second)
            )
            above = builder.fmul(builder.fmul(number(2.0), y), dy)
            below = builder.fmul(builder.fmul(number(2.0), dy), dy)
            change = builder.fdiv(above, builder.fsub(below, builder.fmul(y, ddy)))
            h = builder.fsub(h, change)
        return context.make_tuple(builder, signature.return_type, (h, change, dy))

    return types.UniTuple(types.float64, 3)(types.float64, packed), lower


@intrinsic
def rises_again(typingctx, *coefficients):
    """Whether one of Bernstein's coefficients is positive behind one that is not."""
    packed = types.StarArgTuple.from_types(coefficients)

    def lower(context, builder, signature, arguments):
        values = [builder.extract_value(arguments[0], i) for i in range(len(coefficients))]
        zero, found = ir.DoubleType()(0.0), ir.IntType(1)(0)
        for one, next_one in itertools.pairwise(values):
            rise = builder.and_(builder.fcmp_ordered("<=", one, zero), builder.fcmp_ordered(">", next_one, zero))
            found = builder.or_(found, rise)
        return found

    return types.boolean(packed), lower


@shared(cache=True, error_model="numpy", fastmath=FAST)
def root(e, q):
    """About e^(-1/q), to some per cent: the bits of a number are nearly its logarithm. e > 0."""
    return float_of(int(float(bits_of(e)) * (-1.0 / q) + _BIAS * (1.0 + 1.0 / q)))


@shared(cache=True, error_model="numpy", fastmath=FAST)
def circular_sin(x):
    """Sine by polynomials, to 4e-16 + 4e-17 |x|, without a branch."""
    turns = floor(x * _TWO_OVER_PI + 0.5)
    quarter = turns - 4.0 * floor(0.25 * turns)
    r = x - turns * _HALF_PI - turns * _HALF_PI_LOW
    is_odd = (quarter == 1.0) or (quarter == 3.0)
    s, c = _sine(r), _cosine(r)
    value = c if is_odd else s
    return -value if quarter >= 2.0 else value


@shared(cache=True, error_model="numpy", fastmath=FAST)
def circular_cos(x):
    """Cosine; see `circular_sin`."""
    turns = floor(x * _TWO_OVER_PI + 0.5)
    quarter = turns - 4.0 * floor(0.25 * turns)
    r = x - turns * _HALF_PI - turns * _HALF_PI_LOW
    is_odd = (quarter == 1.0) or (quarter == 3.0)
    s, c = _sine(r), _cosine(r)
    value = s if is_odd else c
    return -value if (quarter == 1.0) or (quarter == 2.0) else value


@shared(cache=True, error_model="numpy", fastmath=FAST)
def _sine(r):
    s = r * r
    t = -7.647163731819816e-13 * s + 1.605904383682161e-10
    t = t * s - 2.505210838544172e-08
    t = t * s + 2.755731922398589e-06
    t = t * s - 1.984126984126984e-04
    t = t * s + 8.333333333333333e-03
    t = t * s - 1.666666666666667e-01
    return r + r * s * t


@shared(cache=True, error_model="numpy", fastmath=FAST)
def _cosine(r):
    s = r * r
    t = 4.779477332387385e-14 * s - 1.147074559772973e-11
    t = t * s + 2.087675698786810e-09
    t = t * s - 2.755731922398589e-07
    t = t * s + 2.480158730158730e-05
    t = t * s - 1.388888888888889e-03
    t = t * s + 4.166666666666667e-02
    t = t * s - 0.5
    return 1.0 + s * t


@shared(cache=True, error_model="numpy", fastmath=FAST)
def short_sin(x):
    """Sine of |x| <= pi, to 1e-15, from that of its quarter."""
    s, c = _sine(0.25 * x), _cosine(0.25 * x)
    half = 2.0 * s * c
    return 2.0 * half * (1.0 - 2.0 * s * s)


@shared(cache=True, error_model="numpy", fastmath=FAST)
def short_cos(x):
    """Cosine of |x| <= pi; see `short_sin`."""
    half = 2.0 * _sine(0.25 * x) * _cosine(0.25 * x)
    return 1.0 - 2.0 * half * half


@shared(cache=True, error_model="numpy", fastmath=FAST)
def grown(x):
    """Exponential of |x| < 1.5, to 1e-15 of 1, without a branch."""
    y = 0.0625 * x
    t = 2.7557319223985893e-06 * y + 2.48015873015873e-05
    t = t * y + 0.0001984126984126984
    t = t * y + 0.001388888888888889
    t = t * y + 0.008333333333333333
    t = t * y + 0.041666666666666664
    t = t * y + 0.16666666666666666
    t = t * y + 0.5
    t = t * y + 1.0
    t = t * y + 1.0
    t = t * t
    t = t * t
    t = t * t
    return t * t


@njit(cache=True, error_model="numpy")
def loosened(itol, first, growth, least, strobes):
    """Inverse tolerance of a motion for its next period: smaller each time, at first; again `first` after `FALLING`."""
    return max(itol * growth, least) if strobes < FALLING else first


@njit(cache=True, error_model="numpy")
def fate(x, mode, limit, cages, ellipsoids, labels):
    """Label of the trap in which a state at phase 0 lies in a mode; UNDECIDED outside all.

    cages: (count, 2 + n + rows (1 + 2 n)): mode, bound, centre, then a floor, real and imaginary parts for each row.
    ellipsoids: (count, 1 + n + n n + planes (n + 1)): mode or -1, centre, shape, then a normal and an offset for each
    plane.
    labels: of the cages, then of the ellipsoids.
    """
    n = x.size
    for i in range(n):
        if not abs(x[i]) < limit:
            return DIVERGED
    for c in range(cages.shape[0]):
        if cages[c, 0] != mode:
            continue
        total = 0.0
        for row in range(2 + n, cages.shape[1], 1 + 2 * n):
            re = im = 0.0
            for i in range(n):
                y = x[i] - cages[c, 2 + i]
                re += cages[c, row + 1 + i] * y
                im += cages[c, row + 1 + n + i] * y
            total += max(math.sqrt(re * re + im * im), cages[c, row])
        if total < cages[c, 1]:
            return labels[c]
    found, least = UNDECIDED, 1.0
    for c in range(ellipsoids.shape[0]):
        if ellipsoids[c, 0] >= 0.0 and ellipsoids[c, 0] != mode:
            continue
        size = 0.0
        for row in range(1 + n, 1 + n + n * n, n):
            total = 0.0
            for i in range(n):
                total += ellipsoids[c, row + i] * (x[i] - ellipsoids[c, 1 + i])
            size += total * total
            if size >= least:
                break
        if size >= least:
            continue
        for plane in range(1 + n + n * n, ellipsoids.shape[1], n + 1):
            total = 0.0
            for i in range(n):
                total += ellipsoids[c, plane + i] * (x[i] - ellipsoids[c, 1 + i])
            if total >= ellipsoids[c, plane + n]:
                break
        else:
            found, least = labels[cages.shape[0] + c], size
    return found


@njit(cache=True, error_model="numpy")
def box_of(x, origin, size, boxes, labels):
    """Label of the box of a grid in which a state lies, by bisection among boxes in lexicographic order; or UNDECIDED."""
    low, high = 0, boxes.shape[0]
    while low < high:
        middle = (low + high) // 2
        order = 0
        for i in range(x.size):
            index = floor((x[i] - origin[i]) / size[i])
            if index != boxes[middle, i]:
                order = 1 if index > boxes[middle, i] else -1
                break
        if order == 0:
            return labels[middle]
        if order > 0:
            low = middle + 1
        else:
            high = middle
    return UNDECIDED


@njit(cache=True, error_model="numpy")
def after_visit(seen, box, visits):
    """Visits of a motion so far, and its label, once it is looked at in the box of a label, UNDECIDED outside all.

    seen: 256 times the count of looks in a row within one label's boxes, plus that label. visits: looks in a row
    that make the label certain.
    """
    if box == UNDECIDED:
        return 0, UNDECIDED
    seen = seen + 256 if seen % 256 == box else 256 + box
    return seen, box if seen >= 256 * visits else UNDECIDED


@njit(inline="always", **SCALAR)
def told(x, mode, seen, regions, boxes, settings):
    """Visits of a motion so far, as `after_visit` counts them, and its label in a state at phase 0."""
    label = fate(x, mode, settings.limit, regions.cages, regions.ellipsoids, regions.labels)
    if label != UNDECIDED or boxes.indices.shape[0] == 0:
        return seen, label
    box = box_of(x, boxes.origin, boxes.size, boxes.indices, boxes.labels)
    return after_visit(seen, box, settings.visits)


@njit(inline="always", **SCALAR)
def ended(i, label, x, mode, found):
    """Keep the label of a motion, its state and its mode; its lane is DONE."""
    found.labels[i] = label
    found.end_modes[i] = mode
    for e in range(x.size):
        found.ends[i, e] = x[e]
    return DONE

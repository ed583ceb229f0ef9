"""The sum of products of which generated Taylor series are made."""

from __future__ import annotations

from numba import types
from numba.extending import intrinsic

_LATE = 3  # products of a sum that are added last, as they come last


@intrinsic
def products(typingctx, *factors):
    """Return a0*b0 + a1*b1 + ... of factors in turn, the last products added last.

    One call for a whole sum compiles five times faster than its operations. A step is a chain of sums that wait for each
    other: those that come last, the last three products, are added to the sum of the others, which is taken in pairs.
    """
    pair = types.StarArgTuple.from_types(factors)

    def lower(context, builder, signature, arguments):
        (packed,) = arguments
        values = [builder.extract_value(packed, i) for i in range(len(factors))]
        pairs = list(zip(values[::2], values[1::2], strict=True))
        early, late = pairs[: max(len(pairs) - _LATE, 1)], pairs[max(len(pairs) - _LATE, 1) :]
        flags = ("contract", "nsz")
        sums = []
        for i in range(0, len(early), 2):
            total = builder.fmul(*early[i], flags=flags)
            if i + 1 < len(early):
                total = builder.fadd(total, builder.fmul(*early[i + 1], flags=flags), flags=flags)
            sums.append(total)
        while len(sums) > 1:
            halves = [sums[i : i + 2] for i in range(0, len(sums), 2)]
            sums = [builder.fadd(*half, flags=flags) if len(half) == 2 else half[0] for half in halves]
        (total,) = sums
        for a, b in late:
            total = builder.fadd(total, builder.fmul(a, b, flags=flags), flags=flags)
        return total

    return types.float64(pair), lower

"""Compiled means and first harmonics of an orbit's states and outputs: sums of Gauss and Legendre over its dense output.

docs/theory/orbits.md, "Means and harmonics", has the formulas.
"""

from __future__ import annotations

import math

from saltus.flow.kernels.stages import dense_value
from saltus.orbits.kernels.curve import OUTPUTS
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, outlined, pointer

# Places in a step and their weights: exact for polynomials of degree 9, where a step's states have degree 7.
_PLACES = (0.04691007703066802, 0.23076534494715845, 0.5, 0.7692346550528415, 0.9530899229693320)
_WEIGHTS = (0.11846344252809454, 0.23931433524968324, 0.28444444444444444, 0.23931433524968324, 0.11846344252809454)
_PARTS = 2  # in a radian of the angle, over each of which these places sum its cosine to rounding
_SPANS = 10  # in a segment, likewise: the angle is a cubic of clustered time


@njit(**INNER)
def _clock(s):
    """Return the share of a segment's duration that has passed at clustered time s."""
    return s * s * (3.0 - 2.0 * s)


@njit(**INNER)
def add_moments(view, curve, begun, start, turns, room, moments):
    """Add a segment's part to the integrals of states and outputs, and of their products with cosine and sine of the angle.

    begun: time at which the segment begins; start: the angle there at time 0; turns: of the angle in a period. moments:
    (n + outputs, 3), for a period of length 1.
    """
    outlined()
    functions, p, n, outputs = view.functions, view.p, view.n, view.outputs
    x, out, duration = room.x, room.out, curve.duration
    for step in range(curve.count):
        a = curve.mesh[step]
        h = curve.mesh[step + 1] - a
        turned = 2.0 * math.pi * turns * duration / view.period * (_clock(a + h) - _clock(a))
        parts = 1 + int(max(abs(turned) * _PARTS, h * _SPANS)) if abs(turned) < 1e6 else 1
        for g in range(5 * parts):
            place = (g // 5 + _PLACES[g % 5]) / parts
            dense_value(curve.coefficients, step * 7 * n, n, curve.nodes, step * n, place, x)
            if outputs > 0:
                call(functions[OUTPUTS], curve.mode, 0, x, 0, p, out, 0)
            s = a + h * place
            weight = _WEIGHTS[g % 5] * h / parts * 6.0 * s * (1.0 - s) * duration / view.period
            time = (begun + duration * _clock(s)) / view.period
            angle = start + 2.0 * math.pi * turns * time
            cosine, sine = weight * math.cos(angle), weight * math.sin(angle)
            for q in range(n + outputs):
                value, row = x[q] if q < n else out[q - n], pointer(moments, 3 * q)
                row[0] += weight * value
                row[1] += cosine * value
                row[2] += sine * value

"""Tables of Lawson's method with Gauss's nodes: collocation in the frame that turns with a linear part of the field.

References
----------
Lawson, SIAM J. Numer. Anal. 4 (1967) 372-380, doi:10.1137/0704033: the frame. Hairer, Norsett, Wanner, *Solving
Ordinary Differential Equations I*, 2nd ed., Springer 1993, Sec. II.7: collocation.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre

__all__ = ["DENSE", "NODES", "STAGES", "TAILS", "WEIGHTS", "WITHIN"]

STAGES = 8  # nodes of Gauss's rule: polynomials of degree 15 are integrated exactly

_X, _W = legendre.leggauss(STAGES)
_VALUES = legendre.legvander(_X, STAGES)  # Legendre's polynomials at the nodes, (nodes, degrees 0 to 8)
_COEFFICIENTS = (np.arange(STAGES) + 0.5)[:, None] * _W * _VALUES[:, :STAGES].T  # of a polynomial, from its values

NODES = 0.5 + 0.5 * _X  # on [0, 1]
WEIGHTS = 0.5 * _W  # of Gauss's rule on [0, 1]
TAILS = _COEFFICIENTS[-4:]  # the coefficients of degrees 4 to 7, shape (4, nodes)


def _within() -> np.ndarray:
    """Weights of the values at the nodes in the integral up to each node, shape (nodes, nodes)."""
    degrees = np.arange(1, STAGES)
    integrals = np.empty((STAGES, STAGES))
    integrals[:, 0] = 0.5 * (_X + 1.0)
    integrals[:, 1:] = 0.5 * (_VALUES[:, degrees + 1] - _VALUES[:, degrees - 1]) / (2.0 * degrees + 1.0)
    return integrals @ _COEFFICIENTS


def _dense() -> np.ndarray:
    """Coefficients of the dense output from the increments at the nodes, the last one at the end, shape (7, nodes + 1).

    The polynomial of degree 7 meets both ends, and the nodes by least squares.
    """
    columns = [NODES]
    for k in range(1, 7):
        columns.append(columns[-1] * (1.0 - NODES if k % 2 else NODES))
    bends = np.linalg.pinv(np.stack(columns[1:], axis=1))
    dense = np.zeros((7, STAGES + 1))
    dense[0, -1] = 1.0
    dense[1:, :-1] = bends
    dense[1:, -1] = -bends @ NODES
    return dense


WITHIN = _within()
DENSE = _dense()

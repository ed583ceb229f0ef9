r"""Stability as smooth inequalities: determinants in the Floquet multipliers instead of their moduli.

With multipliers :math:`\mu_i` and a radius r below 1, all stay within the radius r as long as none of

.. math:: \prod (1 - \mu_i/r), \quad \prod (1 + \mu_i/r), \quad \prod_{i<j} (1 - \mu_i \mu_j/r^2)

vanishes on the way from a stable orbit. All three are smooth where two multipliers meet, moduli are not. Next to a
saddle-node the first one, P(r), is like the square root of the distance. P(r) (2 P(1) - P(r)) has the same zero, and
there it is like the distance itself. It is divided by the margin 1 - r, to be of the size of P(r).

References
----------
Kuznetsov, Elements of Applied Bifurcation Theory, Springer 2004, ch. 10 (the three test functions, of r = 1).
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Stability", "stability"]

_FAINT = 1e-5  # modulus of a multiplier up to which it is constant, where rounding leaves it no derivative


class Stability(NamedTuple):
    """Test functions of stability, above 0 inside.

    Attributes
    ----------
    values : ndarray, shape (3,)
        Of real multipliers at the radius, at minus the radius, and of pairs.
    slopes : ndarray, shape (3, parameters)
        Their derivatives by parameters.
    by_radius : ndarray, shape (3,)
        Their derivatives by the radius.
    """

    values: NDArray[np.float64]
    slopes: NDArray[np.float64]
    by_radius: NDArray[np.float64]


def stability(multipliers: NDArray[np.complex128], slopes: NDArray[np.complex128], radius: float) -> Stability:
    """Return the test functions of stability.

    Parameters
    ----------
    multipliers : ndarray of complex, shape (n,)
        Floquet multipliers without the trivial one.
    slopes : ndarray of complex, shape (n, parameters)
        Their derivatives.
    radius : float
        The modulus up to which they may come.
    """
    slopes = np.where(np.isnan(slopes) & (np.abs(multipliers) <= _FAINT)[:, None], 0.0, slopes)
    near, at = _product(multipliers, radius), _product(multipliers, 1.0)
    far = _product(multipliers, -radius)
    pairs = list(combinations(range(len(multipliers)), 2))
    both = np.array([multipliers[i] * multipliers[j] for i, j in pairs], dtype=np.complex128)
    tori = _product(both, radius**2)
    turned = np.array([multipliers[i] * slopes[j] + multipliers[j] * slopes[i] for i, j in pairs])
    turned = turned.reshape(len(pairs), slopes.shape[1])
    margin = 1.0 - radius
    fold = near[0] * (2.0 * at[0] - near[0]) / margin
    by_fold = (near[1] @ slopes * (2.0 * at[0] - 2.0 * near[0]) + 2.0 * near[0] * (at[1] @ slopes)) / margin
    rows = np.array([by_fold, far[1] @ slopes, tori[1] @ turned])
    by_fold_radius = (near[2] * (2.0 * at[0] - 2.0 * near[0]) + fold) / margin
    by_radius = np.array([by_fold_radius, -far[2], 2.0 * radius * tori[2]])
    return Stability(np.array([fold, far[0], tori[0]]).real, rows.real, by_radius.real)


def _product(values: NDArray[np.complex128], radius: float) -> tuple[complex, NDArray[np.complex128], complex]:
    """Return the product of all 1 - value/radius, its derivatives by the values, and that by the radius."""
    factors = 1.0 - values / radius
    others = np.array([np.prod(np.delete(factors, i)) for i in range(len(values))], dtype=np.complex128)
    return complex(np.prod(factors)), -others / radius, complex(others @ values) / radius**2

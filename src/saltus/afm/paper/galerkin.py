"""Coefficients of the projection onto the modes of a clamped-free beam, Eq. (7): docs/theory/afm.md.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Eqs. (3)-(8): "the paper".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.probe.beam import mode_shape_integrals, wavenumbers
from saltus.result import frozen

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.afm.paper.sample import DMTSample
    from saltus.afm.probe.cantilever import Cantilever

__all__ = ["Coefficients", "coefficients"]


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of the equations of motion, dimensionless but for `k` and `f_1`.

    Time is in units of ``1 / omega_1``, lengths in units of the rest gap `eta`. `C` and `G` are the same for every
    mode, as is the modal mass at the tip, ``rho A int(phi_i**2) / phi_i(L)**2 = rho A L / 4``.

    Examples
    --------
    >>> from saltus.afm import table1
    >>> setup = table1()
    >>> first = coefficients(setup.cantilever, setup.sample, setup.eta, 1)
    >>> round(first.G, 8), round(first.k, 7)
    (247.16423658, 1.9434665)
    """

    K: NDArray[np.float64]  # shape (n,): stiffnesses ``(omega_i / omega_1)**2``
    B: NDArray[np.float64]  # shape (n,): weights of the base's motion ``phi_i(L) int(phi_i) / int(phi_i**2)``
    C: float  # van der Waals attraction ``-H R / (6 k eta**3)``, negative
    G: float  # contact stiffness ``(4/3) E* sqrt(R eta) / k``
    a0_bar: float  # gap at which contact begins, ``a0 / eta``
    k: float  # in N/m: modal stiffness ``m omega_1**2`` of the first mode
    f_1: float  # in Hz: first natural frequency ``omega_1 / (2 pi)``


def coefficients(cantilever: Cantilever, sample: DMTSample, eta: float, n: int) -> Coefficients:
    """Return the coefficients of the equations of motion with `n` modes.

    Parameters
    ----------
    cantilever : Cantilever
        Gives `k` and `f0`.
    sample : DMTSample
        Gives `R`, `H`, `E_star` and `a0`.
    eta : float, in m
        Gap between tip and sample at rest.
    n : int
        Number of modes.

    Returns
    -------
    Coefficients

    Raises
    ------
    InputError
        `eta` is not positive, or `n` below 1.

    Notes
    -----
    Eq. (7) prints ``eta**2`` in G; the dimensions, and the paper's results, require ``eta**(1/2)``.

    References
    ----------
    ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Eq. (7), corrected as said above.

    Examples
    --------
    >>> from saltus.afm import table1
    >>> setup = table1()
    >>> both = coefficients(setup.cantilever, setup.sample, setup.eta, 2)
    >>> both.K.round(7).tolist(), both.B.round(8).tolist()
    ([1.0, 39.2739482], [1.56598351, -0.86787179])
    """
    eta = checks.positive("eta", eta, "m")
    b = wavenumbers(n)
    phi, phi_squared = mode_shape_integrals(n)
    k = cantilever.k
    return Coefficients(
        K=frozen((b / b[0]) ** 4),
        B=frozen(phi / phi_squared),
        C=-sample.H * sample.R / (6.0 * k) / eta / eta / eta,
        G=4.0 / 3.0 * sample.E_star * math.sqrt(sample.R * eta) / k,
        a0_bar=sample.a0 / eta,
        k=k,
        f_1=cantilever.f0,
    )

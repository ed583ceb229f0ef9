"""The sample and its force on the tip: van der Waals attraction, and DMT contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.probe.slips import warn_of_slips
from saltus.errors import InputError

if TYPE_CHECKING:
    from typing import Self

    from numpy.typing import ArrayLike, NDArray

__all__ = ["DMTSample", "tip_force"]


@dataclass(frozen=True, kw_only=True)
class DMTSample:
    """A sample under a spherical tip: van der Waals attraction, and Derjaguin-Mueller-Toporov contact.

    Parameters
    ----------
    R : float, in m
        Radius of the tip.
    H : float, in J
        Hamaker constant; 0 for no attraction.
    E_star : float, in Pa
        Effective modulus of tip and sample; 0 for no contact stiffness. From moduli and Poisson ratios: `from_moduli`.
    a0 : float, in m
        Intermolecular distance: the gap at which contact begins.

    Raises
    ------
    InputError
        `R` or `a0` is not a finite number > 0, `H` or `E_star` is negative or not finite.

    Warns
    -----
    RuntimeWarning
        A value looks as one in nm, aJ or GPa.

    References
    ----------
    ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Sec. 2.1.

    Examples
    --------
    >>> DMTSample(R=20e-9, H=2.96e-19, E_star=10.4e9, a0=2e-10)
    DMTSample(R=2e-08, H=2.96e-19, E_star=10400000000.0, a0=2e-10)
    """

    R: float
    H: float
    E_star: float
    a0: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", checks.positive("R", self.R, "m"))
        object.__setattr__(self, "H", checks.non_negative("H", self.H, "J"))
        object.__setattr__(self, "E_star", checks.non_negative("E_star", self.E_star, "Pa"))
        object.__setattr__(self, "a0", checks.positive("a0", self.a0, "m"))
        warn_of_slips(R=self.R, H=self.H, E_star=self.E_star, a0=self.a0)

    @classmethod
    def from_moduli(
        cls,
        *,
        R: float,
        H: float,
        a0: float,
        young_tip: float,
        poisson_tip: float,
        young_sample: float,
        poisson_sample: float,
    ) -> Self:
        """Return a sample whose effective modulus follows from the moduli of tip and sample.

        Parameters
        ----------
        R, H, a0 : float
            As for `DMTSample`.
        young_tip, young_sample : float, in Pa
            Young's moduli.
        poisson_tip, poisson_sample : float
            Poisson's ratios, above -1 and up to 1/2.

        Returns
        -------
        DMTSample
            With ``1 / E_star = (1 - poisson_tip**2) / young_tip + (1 - poisson_sample**2) / young_sample``.

        Raises
        ------
        InputError
            A value is outside its range.

        References
        ----------
        ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, text below Eq. (1).

        Examples
        --------
        >>> silicon_on_polymer = DMTSample.from_moduli(
        ...     R=20e-9, H=1e-19, a0=2e-10, young_tip=130e9, poisson_tip=0.28, young_sample=2e9, poisson_sample=0.4
        ... )
        >>> print(f"{silicon_on_polymer.E_star / 1e9:.3f} GPa")
        2.341 GPa
        """
        tip = checks.positive("young_tip", young_tip, "Pa") / (1.0 - _poisson("poisson_tip", poisson_tip) ** 2)
        flat = checks.positive("young_sample", young_sample, "Pa") / (
            1.0 - _poisson("poisson_sample", poisson_sample) ** 2
        )
        return cls(R=R, H=H, E_star=tip / (1.0 + tip / flat), a0=a0)


def tip_force(z: ArrayLike, sample: DMTSample) -> NDArray[np.float64]:
    """Force of the sample on the tip, positive where it repels.

    Parameters
    ----------
    z : array_like, any shape, in m
        Gap between tip and sample; contact begins at ``z = sample.a0``, and z may be negative in contact.
    sample : DMTSample
        Tip radius, Hamaker constant, effective modulus and `a0`, in SI units.

    Returns
    -------
    ndarray, shape of `z`, in N

    Raises
    ------
    InputError
        `z` holds a NaN or an infinity, or what is no real number.

    References
    ----------
    ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Eq. (1).

    Examples
    --------
    >>> sample = DMTSample(R=20e-9, H=2.96e-19, E_star=10.4e9, a0=2e-10)
    >>> (tip_force([2e-9, 2e-10, -1e-10], sample) * 1e9).round(3).tolist()
    [-0.247, -24.667, -14.477]
    """
    z = checks.array("z", z)
    checks.instance("sample", sample, DMTSample)
    attraction = -sample.H * sample.R / (6.0 * np.maximum(z, sample.a0) ** 2)
    indentation = np.maximum(sample.a0 - z, 0.0)
    return np.asarray(attraction + 4.0 / 3.0 * sample.E_star * math.sqrt(sample.R) * indentation**1.5)


def _poisson(name: str, value: float) -> float:
    allowed = "above -1 and at most 1/2"
    if not -1.0 < (checked := checks.number(name, value, allowed)) <= 0.5:
        raise InputError(name, value, allowed)
    return checked

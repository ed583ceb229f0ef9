"""The cantilever: a uniform clamped-free beam, given by geometry and material, or by measured values."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.probe.beam import wavenumbers

if TYPE_CHECKING:
    from typing import Self

    from numpy.typing import NDArray

__all__ = ["Cantilever"]


@dataclass(frozen=True, kw_only=True, repr=False)
class Cantilever:
    """A uniform rectangular cantilever, clamped at one end and free at the other.

    The arguments are geometry and material. `from_measured` takes the measured stiffness, frequency and quality factor.

    Parameters
    ----------
    length, width, thickness : float, in m
        The beam bends in the direction of its thickness. None if the cantilever was measured.
    density : float, in kg/m**3
        None if the cantilever was measured.
    young : float, in Pa
        Young's modulus. None if the cantilever was measured.

    Attributes
    ----------
    k : float, in N/m
        Modal stiffness ``m omega_1**2`` of the first mode at the tip, ``m = rho A L / 4``: 1.0302 times the static
        stiffness ``3 E I / L**3`` that a force on the tip feels.
    f0 : float, in Hz
        First natural frequency.
    Q : float or None
        Quality factor of the first mode, where it was measured.

    Raises
    ------
    InputError
        A value is not a finite number > 0, or so extreme that `k` or `f0` is not.

    References
    ----------
    ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Eq. (2) and text: Euler-Bernoulli beam.

    Examples
    --------
    >>> lever = Cantilever(length=240e-6, width=64e-6, thickness=2.1e-6, density=2300.0, young=176e9)
    >>> print(f"{lever.k:.4f} N/m, {lever.f0 / 1e3:.3f} kHz")
    1.9435 N/m, 51.519 kHz
    """

    length: float | None
    width: float | None
    thickness: float | None
    density: float | None
    young: float | None
    k: float = field(init=False)
    f0: float = field(init=False)
    Q: float | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        length, width = checks.positive("length", self.length, "m"), checks.positive("width", self.width, "m")
        thickness, density = (
            checks.positive("thickness", self.thickness, "m"),
            checks.positive("density", self.density, "kg/m**3"),
        )
        young = checks.positive("young", self.young, "Pa")
        omega_1 = float(wavenumbers(1)[0]) ** 2 * thickness / length / length * math.sqrt(young / (12.0 * density))
        mass = density * width * thickness * length / 4.0
        self._set(length=length, width=width, thickness=thickness, density=density, young=young)
        self._set(
            k=checks.positive("k", mass * omega_1 * omega_1, "N/m"), f0=checks.positive("f0", omega_1 / math.tau, "Hz")
        )

    @classmethod
    def from_measured(cls, *, k: float, f0: float, Q: float) -> Self:
        """Return a cantilever with a measured first mode, and without geometry.

        Parameters
        ----------
        k : float, in N/m
            Modal (dynamic) stiffness of the first mode at the tip. Multiply a measured or reported static stiffness by
            1.0302 (a uniform rectangular beam).
        f0 : float, in Hz
            First natural frequency.
        Q : float
            Quality factor of the first mode, far from the sample: in ``q'' + D q' + q = ...`` it is ``1 / D``.

        Returns
        -------
        Cantilever

        Raises
        ------
        InputError
            A value is not a finite number > 0.

        Examples
        --------
        >>> lever = Cantilever.from_measured(k=2.0, f0=70e3, Q=200.0)
        >>> lever, lever.damping
        (Cantilever.from_measured(k=2.0, f0=70000.0, Q=200.0), 0.005)
        """
        self = object.__new__(cls)
        self._set(length=None, width=None, thickness=None, density=None, young=None)
        self._set(k=checks.positive("k", k, "N/m"), f0=checks.positive("f0", f0, "Hz"), Q=checks.positive("Q", Q))
        return self

    @property
    def omega_1(self) -> float:
        """First natural frequency, in rad/s: the unit of time is its inverse.

        Examples
        --------
        >>> round(Cantilever.from_measured(k=2.0, f0=70e3, Q=200.0).omega_1)
        439823
        """
        return math.tau * self.f0

    @property
    def mass(self) -> float:
        """Modal mass at the tip, in kg, the same for every mode: a quarter of the beam's mass.

        Examples
        --------
        >>> print(f"{Cantilever.from_measured(k=2.0, f0=70e3, Q=200.0).mass:.4g}")
        1.034e-11
        """
        return self.k / self.omega_1 / self.omega_1

    @property
    def damping(self) -> float | None:
        """Damping ``D_1 = 1 / Q`` of the first mode in units of `omega_1`; None where `Q` was not measured.

        Examples
        --------
        >>> Cantilever.from_measured(k=2.0, f0=70e3, Q=40.0).damping
        0.025
        """
        return None if self.Q is None else 1.0 / self.Q

    def frequencies(self, n: int) -> NDArray[np.float64]:
        """Return the first `n` natural frequencies.

        Parameters
        ----------
        n : int
            Of how many modes.

        Returns
        -------
        ndarray, shape (n,), in Hz
            ``f0 (b_i / b_1)**2``: for a measured cantilever, all but `f0` are those of a uniform beam.

        Raises
        ------
        InputError
            `n` is below 1.

        Examples
        --------
        >>> Cantilever.from_measured(k=2.0, f0=70e3, Q=200.0).frequencies(3).round().tolist()
        [70000.0, 438683.0, 1228324.0]
        """
        b = wavenumbers(n)
        return np.asarray(self.f0 * (b / b[0]) ** 2)

    def stiffnesses(self, n: int) -> NDArray[np.float64]:
        """Return the modal stiffnesses at the tip of the first modes.

        Parameters
        ----------
        n : int
            Of how many modes.

        Returns
        -------
        ndarray, shape (n,), in N/m
            ``k (b_i / b_1)**4``.

        Raises
        ------
        InputError
            Of none, as `n` is below 1.

        Examples
        --------
        >>> Cantilever.from_measured(k=2.0, f0=70e3, Q=200.0).stiffnesses(2).round(4).tolist()
        [2.0, 78.5479]
        """
        b = wavenumbers(n)
        return np.asarray(self.k * (b / b[0]) ** 4)

    def __repr__(self) -> str:
        if self.Q is not None:
            return f"Cantilever.from_measured(k={self.k!r}, f0={self.f0!r}, Q={self.Q!r})"
        return (
            f"Cantilever(length={self.length!r}, width={self.width!r}, thickness={self.thickness!r}, "
            f"density={self.density!r}, young={self.young!r})"
        )

    def _set(self, **values: float | None) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

"""The cantilever: a uniform clamped-free beam, given by geometry and material, or by measured values."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.probe.beam import wavenumbers
from saltus.afm.probe.slips import warn_of_slips
from saltus.errors import InputError

if TYPE_CHECKING:
    from typing import Self

    from numpy.typing import NDArray

__all__ = ["Cantilever"]

_LEAST_HZ = 1000.0  # frequency in Hz below which a number is taken for one of kHz


@dataclass(frozen=True, kw_only=True, repr=False)
class Cantilever:
    """A uniform rectangular cantilever, clamped at one end and free at the other.

    The arguments are geometry and material in SI units. `from_geometry` takes them in um, kg/m^3 and GPa.
    `from_measured` takes the measured stiffness, frequency and quality factor.

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

    Warns
    -----
    RuntimeWarning
        A value looks as one in um, GPa or g/cm^3.

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
        warn_of_slips(length=length, width=width, thickness=thickness, density=density, young=young)
        omega_1 = float(wavenumbers(1)[0]) ** 2 * thickness / length / length * math.sqrt(young / (12.0 * density))
        mass = density * width * thickness * length / 4.0
        self._set(length=length, width=width, thickness=thickness, density=density, young=young)
        self._set(
            k=checks.positive("k", mass * omega_1 * omega_1, "N/m"), f0=checks.positive("f0", omega_1 / math.tau, "Hz")
        )

    @classmethod
    def from_geometry(
        cls, *, length_um: float, width_um: float, thickness_um: float, density_kg_m3: float, young_GPa: float
    ) -> Self:
        """Return a cantilever by its geometry in um, and its material.

        Parameters
        ----------
        length_um, width_um, thickness_um : float, in um
            The beam bends in the direction of its thickness.
        density_kg_m3 : float, in kg/m^3
            Density.
        young_GPa : float, in GPa
            Young's modulus.

        Returns
        -------
        Cantilever

        Raises
        ------
        InputError
            A value is not a finite number > 0.

        Examples
        --------
        >>> lever = Cantilever.from_geometry(
        ...     length_um=240.0, width_um=64.0, thickness_um=2.1, density_kg_m3=2300.0, young_GPa=176.0
        ... )
        >>> print(f"{lever.k:.4f} N/m, {lever.f0 / 1e3:.3f} kHz")
        1.9435 N/m, 51.519 kHz
        """
        length, width = checks.positive("length_um", length_um, "um"), checks.positive("width_um", width_um, "um")
        thickness = checks.positive("thickness_um", thickness_um, "um")
        young = checks.positive("young_GPa", young_GPa, "GPa")
        warn_of_slips(length_um=length, width_um=width, thickness_um=thickness, young_GPa=young)
        density = checks.positive("density_kg_m3", density_kg_m3, "kg/m^3")
        return cls(
            length=length * 1e-6, width=width * 1e-6, thickness=thickness * 1e-6, density=density, young=young * 1e9
        )

    @classmethod
    def from_measured(
        cls,
        *,
        Q: float,
        k_N_m: float | None = None,
        f0_kHz: float | None = None,
        k: float | None = None,
        f0: float | None = None,
    ) -> Self:
        """Return a cantilever with a measured first mode, and without geometry.

        Parameters
        ----------
        Q : float
            Quality factor of the first mode, far from the sample: in ``q'' + D q' + q = ...`` it is ``1 / D``.
        k_N_m : float, in N/m
            Modal (dynamic) stiffness of the first mode at the tip. Multiply a measured or reported static stiffness by
            1.0302 (a uniform rectangular beam).
        f0_kHz : float, in kHz
            First natural frequency.
        k : float, in N/m, optional
            Older name of `k_N_m`.
        f0 : float, in Hz, optional
            In place of `f0_kHz`; below 1000 Hz only `f0_kHz` is taken.

        Returns
        -------
        Cantilever

        Raises
        ------
        InputError
            A value is not a finite number > 0. Stiffness or frequency are given not at all, or twice. `f0` is below
            1000 Hz, as one in kHz is.

        Examples
        --------
        >>> lever = Cantilever.from_measured(k_N_m=2.0, f0_kHz=70.0, Q=200.0)
        >>> lever, lever.damping
        (Cantilever.from_measured(k=2.0, f0=70000.0, Q=200.0), 0.005)
        >>> Cantilever.from_measured(k=26.0, f0=300.0, Q=400.0)
        Traceback (most recent call last):
            ...
        saltus.errors.InputError: f0 = 300.0: must be at least 1000 Hz; in kHz? then f0_kHz=300
        """
        self = object.__new__(cls)
        self._set(length=None, width=None, thickness=None, density=None, young=None)
        stiffness = _either("k_N_m", k_N_m, "N/m", "k", k, "N/m")
        frequency = _either("f0_kHz", f0_kHz, "kHz", "f0", f0, "Hz")
        if f0 is not None and frequency < _LEAST_HZ:
            raise InputError("f0", f0, f"at least {_LEAST_HZ:g} Hz", f"in kHz? then f0_kHz={frequency:g}")
        self._set(k=stiffness, f0=frequency * (1e3 if f0 is None else 1.0), Q=checks.positive("Q", Q))
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
            slow = self.f0 < _LEAST_HZ
            frequency = f"f0_kHz={self.f0 / 1e3!r}" if slow else f"f0={self.f0!r}"
            return f"Cantilever.from_measured(k={self.k!r}, {frequency}, Q={self.Q!r})"
        return (
            f"Cantilever(length={self.length!r}, width={self.width!r}, thickness={self.thickness!r}, "
            f"density={self.density!r}, young={self.young!r})"
        )

    def _set(self, **values: float | None) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)


def _either(name: str, value: object, unit: str, other: str, its_value: object, its_unit: str) -> float:
    """Return a positive number that is given under one of two names."""
    if value is None and its_value is None:
        raise InputError(other, None, f"a finite number > 0 (in {its_unit})", f"or {name}, in {unit}")
    if value is not None and its_value is not None:
        raise InputError(name, value, f"given once, without {other}")
    return checks.positive(name, value, unit) if its_value is None else checks.positive(other, its_value, its_unit)

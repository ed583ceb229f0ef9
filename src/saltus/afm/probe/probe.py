"""The probe: the cantilever's modes as oscillators at the tip, and the tip's radius."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import InitVar, dataclass
from typing import TYPE_CHECKING

from saltus import checks
from saltus.afm.probe.cantilever import Cantilever
from saltus.afm.probe.named_arguments import NamedArguments
from saltus.afm.probe.tip_mass import modes_with_mass
from saltus.afm.probe.units import Quantity, check_lever, checked
from saltus.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Self

__all__ = ["MOST_MODES", "Probe"]

MOST_MODES = 20  # modes of a cantilever, at most
_NG_IN_KG = 1e12  # nanograms in a kilogram

# Geometry and material of a beam, in SI units.
_BEAM = {
    "length": Quantity("m", 1e-7, 1e-2, "+"),
    "width": Quantity("m", 1e-8, 1e-2, "+"),
    "thickness": Quantity("m", 1e-9, 1e-3, "+"),
    "density": Quantity("kg/m^3", 100.0, 3e4, "+"),
    "young": Quantity("Pa", 1e6, 2e12, "+"),
}


@dataclass(frozen=True, kw_only=True)
class Probe(NamedArguments):
    """A cantilever with its tip: one oscillator a mode, whose displacements at the tip add up.

    Parameters
    ----------
    k_N_m : float or sequence of float
        Modal stiffnesses at the tip, in N/m, one a mode: ``m omega**2``, 1.0302 times the static one for a bare beam.
    f0_kHz : float or sequence of float
        Natural frequencies, in kHz.
    Q : float or sequence of float
        Quality factors.
    R_nm : float
        Radius of the tip, in nm.
    optical_weights : sequence of float, optional
        Slope at the end per displacement of each mode, over that of the first mode: how strongly light that is
        reflected shows it. By default those of a uniform beam.
    base_weights : sequence of float, optional
        How strongly each mode is driven where the base is shaken. By default those of a uniform beam.
    check : bool, optional
        Whether implausible values are refused.

    Attributes
    ----------
    modes : int
        How many modes there are.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible; modes with different numbers of values.

    References
    ----------
    J. Melcher, S. Hu, A. Raman, Appl. Phys. Lett. 91, 053101 (2007): equivalent point-mass models of the modes.

    Examples
    --------
    >>> Probe(k_N_m=40.0, f0_kHz=300.0, Q=300.0, R_nm=10.0).k_N_m
    (40.0,)
    >>> Probe(k_N_m=(40, 1571), f0_kHz=(300, 1880), Q=(300, 900), R_nm=10.0).modes
    2
    """

    k_N_m: float | Sequence[float]
    f0_kHz: float | Sequence[float]
    Q: float | Sequence[float]
    R_nm: float
    optical_weights: Sequence[float] | None = None
    base_weights: Sequence[float] | None = None
    check: InitVar[bool] = True

    def __post_init__(self, check: bool) -> None:
        checks.flag("check", check)
        for name in ("k_N_m", "f0_kHz", "Q"):
            first_only = name == "k_N_m"  # stiffnesses grow with the fourth power of the wavenumber
            values = tuple(
                checked(name, value, plausible=check and not (i and first_only))
                for i, value in enumerate(_several(getattr(self, name)))
            )
            object.__setattr__(self, name, values)
        n = len(_several(self.k_N_m))
        for name in ("k_N_m", "f0_kHz", "Q"):
            if not 1 <= len(_several(getattr(self, name))) <= MOST_MODES or len(_several(getattr(self, name))) != n:
                raise InputError(
                    name, getattr(self, name), f"one number a mode, as many as k_N_m has, up to {MOST_MODES}"
                )
        object.__setattr__(self, "R_nm", checked("R_nm", self.R_nm, plausible=check))
        if check:
            check_lever(_several(self.k_N_m)[0], _several(self.f0_kHz)[0])
        uniform = modes_with_mass(n)
        self._weigh("optical_weights", [mode.slope / uniform[0].slope for mode in uniform])
        self._weigh("base_weights", [mode.base_weight for mode in uniform])

    def _weigh(self, name: str, uniform: Sequence[float]) -> None:
        given = getattr(self, name)
        values = tuple(uniform) if given is None else tuple(checks.number(name, value) for value in _several(given))
        if len(values) != self.modes:
            raise InputError(name, given, f"one number for each of {self.modes} modes")
        object.__setattr__(self, name, values)

    @property
    def modes(self) -> int:
        """How many modes there are."""
        return len(_several(self.k_N_m))

    @classmethod
    def from_cantilever(
        cls,
        cantilever: Cantilever,
        *,
        R_nm: float,
        modes: int = 1,
        Q: float | Sequence[float] | None = None,
        tip_mass_ng: float = 0.0,
        tilt_deg: float = 0.0,
        check: bool = True,
    ) -> Self:
        """Return the probe that a uniform beam is.

        Parameters
        ----------
        cantilever : Cantilever
            The beam, by geometry and material or by measured values of its first mode.
        R_nm : float
            Radius of the tip, in nm.
        modes : int, optional
            How many of its modes.
        Q : float or sequence of float, optional
            Quality factor of each mode. By default that of a measured cantilever, with a drag that is uniform along the
            beam: mode i has ``Q omega_i / omega_1``.
        tip_mass_ng : float, optional
            Mass of the tip, in ng. Measured values contain it already: only a beam given by geometry takes one.
        tilt_deg : float, optional
            Angle between beam and sample. Lengths are those along the sample's normal: a stiffness is
            ``k / cos(tilt)**2``. A shaken base moves along this normal too, and is felt ``cos(tilt)**2`` as much.
        check : bool, optional
            Whether implausible values are refused.

        Returns
        -------
        Probe

        Raises
        ------
        InputError
            A value that is not allowed, or no plausible probe.

        References
        ----------
        L.-O. Heim, M. Kappl, H.-J. Butt, Langmuir 20, 2760 (2004): tilt. The modes: `saltus.afm.probe.tip_mass`.

        Examples
        --------
        >>> lever = Cantilever.from_measured(k_N_m=2.0, f0_kHz=70.0, Q=150.0)
        >>> probe = Probe.from_cantilever(lever, modes=2, R_nm=10.0)
        >>> print([round(k, 3) for k in probe.k_N_m], [round(Q, 3) for Q in probe.Q])
        [2.0, 78.548] [150.0, 940.034]
        >>> [round(weight, 6) for weight in probe.optical_weights]
        [1.0, 3.473127]
        """
        checks.instance("cantilever", cantilever, Cantilever)
        for name, quantity in _BEAM.items():
            if getattr(cantilever, name) is not None:
                checked(name, getattr(cantilever, name), plausible=check, quantity=quantity)
        n = checks.count("modes", modes, 1, MOST_MODES)
        mass = checked("tip_mass_ng", tip_mass_ng, plausible=check) / _NG_IN_KG
        cosine = math.cos(math.radians(checks.between("tilt_deg", tilt_deg, -60.0, 60.0)))
        if mass and cantilever.density is None:
            hint = "measured values contain the tip's mass"
            raise InputError("tip_mass_ng", tip_mass_ng, "0 for a measured cantilever", hint)
        beam = 4.0 * cantilever.mass
        bare, loaded = modes_with_mass(1)[0], modes_with_mass(n, mass / beam)
        ratios = [(mode.wavenumber / bare.wavenumber) ** 2 for mode in loaded]
        if Q is None:
            if cantilever.Q is None:
                raise InputError("Q", Q, "given: one number a mode", "a beam given by geometry has none")
            Q = [cantilever.Q * ratio for ratio in ratios]
        return cls(
            k_N_m=[
                beam * mode.mass * (cantilever.omega_1 * ratio / cosine) ** 2
                for mode, ratio in zip(loaded, ratios, strict=True)
            ],
            f0_kHz=[cantilever.f0 * ratio * 1e-3 for ratio in ratios],
            Q=Q,
            R_nm=R_nm,
            optical_weights=[mode.slope / loaded[0].slope for mode in loaded],
            base_weights=[mode.base_weight * cosine**2 for mode in loaded],
            check=check,
        )


def _several(value: object) -> tuple[float, ...]:
    """Return numbers as a tuple; a single one is the only one."""
    return tuple(value) if isinstance(value, Iterable) and not isinstance(value, str) else (value,)  # type: ignore[return-value]

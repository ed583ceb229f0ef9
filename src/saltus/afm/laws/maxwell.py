"""A generalised Maxwell solid under a flat punch: a spring beside n arms of a spring and a dashpot in series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from saltus import checks
from saltus.afm.laws.contact import touching
from saltus.afm.laws.law import Law
from saltus.afm.laws.regions import Crossing, Region
from saltus.afm.probe.units import checked, suffix
from saltus.errors import InputError

__all__ = ["GeneralisedMaxwell"]

_ARMS = ("k2_N_m", "c_uNs_m")


@dataclass(frozen=True, kw_only=True)
class GeneralisedMaxwell(Law):
    """Generalised Maxwell solid, or Wiechert's, under a flat punch: several times of relaxation.

    With the depth ``h = -D`` and the dashpots' states y, ``F = k1 h + sum k2 (h - y)`` and ``y' = k2 (h - y)/c`` in
    contact. Contact begins and ends where F is 0, at ``h_s = sum k2 y/(k1 + sum k2)``. Without contact the surface is
    at this depth, and ``y' = k2 (h_s - y)/c``. With one arm it is `SLS`, formula by formula.

    A cycle loses what the dashpots take. A tip that stays in contact with the amplitude A loses
    ``pi A**2 sum k2 w t/(1 + (w t)**2)`` with ``t = c/k2``.

    Parameters
    ----------
    k1_N_m : float
        Spring alone, in N/m.
    k2_N_m : sequence of float
        Springs of the arms, in N/m.
    c_uNs_m : sequence of float
        Dashpots of the arms, in uN s/m.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible; not as many springs as dashpots.

    Notes
    -----
    A model has the parameters ``k2_N_m``, ``c_uNs_m`` and the state ``y_nm`` of the first arm. Those of further arms
    end with their number, as ``k2_N_m_2``.

    References
    ----------
    N. W. Tschoegl, The Phenomenological Theory of Linear Viscoelastic Behavior (1989), Sec. 3.4; S. D. Solares,
    Beilstein J. Nanotechnol. 5, 1649 (2014): the surface recovers freely.

    Examples
    --------
    >>> law = GeneralisedMaxwell(k1_N_m=1.0, k2_N_m=(2.0, 3.0), c_uNs_m=(0.1, 5.0))
    >>> law.regions["contact"].states["y_nm_2"]
    'k2_N_m_2*(-D_nm - y_nm_2)/c_uNs_m_2'
    """

    k1_N_m: float
    k2_N_m: tuple[float, ...]
    c_uNs_m: tuple[float, ...]

    contact: ClassVar[str] = "0"

    def __post_init__(self, check: bool) -> None:
        checks.flag("check", check)
        object.__setattr__(self, "k1_N_m", checked("k1_N_m", self.k1_N_m, plausible=check))
        for name in _ARMS:
            given = getattr(self, name)
            if isinstance(given, str | set | frozenset) or not hasattr(given, "__iter__"):
                raise InputError(name, given, "a sequence with one value for each arm", "one arm: (2.0,)")
            numbers = tuple(checked(name, value, plausible=check) for value in given)
            for number in numbers:
                checks.positive(name, number)
            object.__setattr__(self, name, numbers)
        if not self.k2_N_m:
            raise InputError("k2_N_m", self.k2_N_m, "a sequence with one value for each arm, one arm or more")
        if len(self.k2_N_m) != len(self.c_uNs_m):
            allowed = f"one value for each of the {len(self.k2_N_m)} springs of k2_N_m"
            raise InputError("c_uNs_m", self.c_uNs_m, allowed)
        object.__setattr__(self, "positive", tuple(f"c_uNs_m{end}" for end in self._ends))
        object.__setattr__(self, "contact", f"-{self._recovered}")

    @property
    def _ends(self) -> list[str]:
        """What the names of each arm end with."""
        return [suffix(number) for number in range(1, len(self.k2_N_m) + 1)]

    @property
    def parameters(self) -> dict[str, float]:
        """Names and values of the parameters."""
        arms = {name + end: value for name in _ARMS for end, value in zip(self._ends, getattr(self, name), strict=True)}
        return {"k1_N_m": self.k1_N_m, **arms}

    @property
    def _recovered(self) -> str:
        """Depth of the free surface, as a formula."""
        springs = " + ".join(f"k2_N_m{end}" for end in self._ends)
        moved = " + ".join(f"k2_N_m{end}*y_nm{end}" for end in self._ends)
        return f"{moved if len(self._ends) == 1 else f'({moved})'}/(k1_N_m + {springs})"

    @property
    def regions(self) -> dict[str, Region]:
        """In recovery and in contact."""
        recovery = {
            f"y_nm{end}": f"-k1_N_m*k2_N_m{end}/(k1_N_m + k2_N_m{end})*y_nm{end}/c_uNs_m{end}"
            if len(self._ends) == 1
            else f"k2_N_m{end}*({self._recovered} - y_nm{end})/c_uNs_m{end}"
            for end in self._ends
        }
        arms = [f"k2_N_m{end}*(-D_nm - y_nm{end})" for end in self._ends]
        return {
            "far": Region(states=recovery),
            "contact": Region(
                " + ".join(["-k1_N_m*D_nm", *arms]),
                states={f"y_nm{end}": f"{arm}/c_uNs_m{end}" for end, arm in zip(self._ends, arms, strict=True)},
                separation=self.contact,
                indentation="-D_nm",
            ),
        }

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where the tip meets and leaves the surface."""
        return touching(self.contact)

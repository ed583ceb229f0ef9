"""The two regimes of tapping: repulsive motions hit the sample, attractive ones do not."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from saltus import checks
from saltus.errors import ConvergenceError, DivergenceError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from saltus.orbits import PeriodicOrbit
    from saltus.system import HybridSystem

__all__ = ["Regime", "settled_orbit", "tapping_modes"]

Regime = Literal["repulsive", "attractive"]  # with contact in every period, or without any

_RADII = (1.2, 0.9)  # amplitudes of the first mode, in gaps, from which a search starts
_ANGLES = 8  # phases of its motion for each amplitude

_PATIENCE = 1000  # periods of the drive for settling; the slowest of the paper's motions take a few hundred


def settled_orbit(
    system: HybridSystem, parameters: Mapping[str, float] | None = None, regime: str = "repulsive"
) -> PeriodicOrbit:
    """Return a stable periodic orbit of a regime.

    Motions of the first mode of about the gap's size are simulated from several phases. For the attractive regime, the
    motion from rest comes first. The first motion that settles in the regime is corrected by Newton's method. Where
    several orbits of a regime are stable, the result is one of them.

    Parameters
    ----------
    system : HybridSystem
        As `tapping_mode` returns it.
    parameters : mapping of str to float, optional
        Values that differ from the system's defaults.
    regime : {"repulsive", "attractive"}
        Whether the orbit has contact with the sample.

    Returns
    -------
    PeriodicOrbit

    Raises
    ------
    InputError
        The system is none of `tapping_mode`, the regime is unknown, or no motion settles on a periodic orbit in it.

    Examples
    --------
    Both regimes at one frequency, with the least gap:

    >>> from saltus.afm import table1, tapping_mode
    >>> system = tapping_mode(table1())
    >>> for regime in ("repulsive", "attractive"):
    ...     print(regime, round(settled_orbit(system, {"Omega": 1.15}, regime).min["z"], 4))
    repulsive -0.0858
    attractive 0.4167
    """
    from saltus.orbits import find_orbit

    n = tapping_modes(system)
    checks.chosen("orbit", regime, get_args(Regime))
    ends: Counter[str] = Counter()
    for x0 in _starts(n, regime):
        try:
            orbit = find_orbit(system, parameters, x0, settle=_PATIENCE)
        except (ConvergenceError, DivergenceError):
            ends["on no periodic orbit"] += 1
            continue
        found = "repulsive" if _touches(orbit) else "attractive"
        if found == regime:
            return orbit
        ends[f"on an orbit in the {found} regime"] += 1
    told = ", ".join(f"{count} end {where}" for where, count in ends.items())
    allowed = "a regime with a stable periodic orbit at these parameters"
    raise InputError("orbit", regime, allowed, f"of {ends.total()} motions from different starts, {told}")


def tapping_modes(system: HybridSystem) -> int:
    """Return how many modes of the cantilever a system has.

    Raises
    ------
    InputError
        The system is none that `tapping_mode` returns.

    Examples
    --------
    >>> from saltus.afm import table1, tapping_mode
    >>> tapping_modes(tapping_mode(table1(), modes=3))
    3
    """
    from saltus.system import HybridSystem

    n = len(checks.instance("system", system, HybridSystem).states) // 2
    states = (*(f"q{i + 1}" for i in range(n)), *(f"v{i + 1}" for i in range(n)))
    tapping = n > 0 and system.states == states and system.mode_names == ("flight", "contact")
    if not (tapping and {"ybar", "k", "eta", "a0"} <= set(system.parameter_names)):
        raise InputError("system", system.name or system.unnamed, "tapping mode", "afm.tapping_mode returns it")
    return n


def _starts(n: int, regime: str) -> Iterator[NDArray[np.float64]]:
    """Go through initial states; rest comes first in the attractive regime."""
    if regime == "attractive":
        yield np.zeros(2 * n)
    for radius in _RADII:
        for angle in 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES:
            x0 = np.zeros(2 * n)
            x0[[0, n]] = -radius * np.cos(angle), radius * np.sin(angle)
            yield x0


def _touches(orbit: PeriodicOrbit) -> bool:
    return any(mode == "contact" for mode, _ in orbit.signature)

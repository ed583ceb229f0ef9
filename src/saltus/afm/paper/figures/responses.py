"""Frequency responses that the figures share: their first orbits, and their continuation to other parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from saltus.afm.paper.figures.telling import about, tell
from saltus.progress import Report

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from saltus.continuation import Branch, BranchOptions, Family, StepControl
    from saltus.orbits import PeriodicOrbit

__all__ = ["gap_at_contact", "repulsive_orbit", "response", "responses"]

_START = {"Omega": 1.05}  # parameters of `_GUESS`

# An orbit of the repulsive branch at `_START`, roughly.
_GUESS = [
    ("flight", "touch", [-0.717, 0.7335], 2.95),
    ("contact", "release", [0.95, 0.85], 0.375),
    ("flight", "theta", [0.9, -0.4], 2.65),
]


def repulsive_orbit(progress: bool | Report = False) -> PeriodicOrbit:
    """Return an orbit of the repulsive branch of Fig. 3: one mode, the paper's parameters, ``Omega = 1.05``."""
    from saltus.afm.paper.table1 import table1
    from saltus.afm.paper.tapping import tapping_mode
    from saltus.orbits import solve_orbit

    tell(progress, "preparing the model")
    model = tapping_mode(table1(), modes=1)
    tell(progress, "correcting the first orbit")
    return solve_orbit(model, _START, _GUESS)


def response(
    orbit: PeriodicOrbit,
    bounds: tuple[float, float],
    steps: StepControl | None = None,
    progress: bool | Report = False,
) -> Branch:
    """Return the frequency response through an orbit, over an interval of ``Omega``."""
    from saltus.continuation import continue_orbit

    return continue_orbit(orbit, "Omega", bounds, steps=steps, progress=progress)


def responses(
    orbit: PeriodicOrbit,
    over: Mapping[str, ArrayLike],
    bounds: tuple[float, float],
    options: BranchOptions | None = None,
    progress: bool | Report = False,
) -> Family:
    """Return frequency responses over an interval of ``Omega``, one for each value of the parameters in `over`.

    Parameters
    ----------
    orbit : PeriodicOrbit
        First orbit, best far below resonance: from there it continues to any damping and drive without a fold.
    over : mapping of str to array_like, shape (response,)
        As for `continue_family`, like `bounds` and `options`.
    bounds : (float, float)
        Interval of ``Omega``, in omega_1.
    options : BranchOptions, optional
        Options of the continuation.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress`, which counts responses.
    """
    from saltus.continuation import continue_family

    return continue_family(
        orbit,
        "Omega",
        over,
        bounds,
        options=options,
        workers=1,  # a response takes a second at most, a process two to start
        progress=about(progress, "responses"),
    )


def gap_at_contact(parameters: Mapping[str, float]) -> float:
    """Return the gap at which contact begins, ``a0 / eta``.

    Examples
    --------
    >>> round(gap_at_contact({"a0": 2e-10, "eta": 60e-9}), 6)
    0.003333
    """
    return parameters["a0"] / parameters["eta"]

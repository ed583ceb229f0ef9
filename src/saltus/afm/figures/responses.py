"""Frequency responses that the figures share: where they start, and how they are carried to other parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from saltus.continuation import Branch, Family, StepControl
    from saltus.orbits import PeriodicOrbit

__all__ = ["gap_at_contact", "repulsive_orbit", "response", "responses"]

_START = {"Omega": 1.05}
_GUESS = [
    ("flight", "touch", [-0.717, 0.7335], 2.95),
    ("contact", "release", [0.95, 0.85], 0.375),
    ("flight", "theta", [0.9, -0.4], 2.65),
]
"""An orbit of the repulsive branch at `_START`, roughly."""


def repulsive_orbit(say: Callable[[str], None] = lambda _: None) -> PeriodicOrbit:
    """Return an orbit of the repulsive branch of Fig. 3: one mode, the paper's parameters, ``Omega = 1.05``."""
    from saltus.afm.paper import table1
    from saltus.afm.tapping import tapping_mode
    from saltus.orbits import solve_orbit

    say("preparing the model")
    model = tapping_mode(table1(), modes=1)
    say("correcting the first orbit")
    return solve_orbit(model, _START, _GUESS)


def response(
    orbit: PeriodicOrbit,
    bounds: tuple[float, float],
    steps: StepControl | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Branch:
    """Return the frequency response through an orbit, over an interval of ``Omega``."""
    from saltus.continuation import continue_orbit

    return continue_orbit(
        orbit,
        "Omega",
        bounds,
        steps=steps,
        progress=lambda count, value: say(f"{count} orbits, Omega = {value:.5f}"),
    )


def responses(
    orbit: PeriodicOrbit,
    over: Mapping[str, ArrayLike],
    bounds: tuple[float, float],
    steps: StepControl | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Family:
    """Return frequency responses over an interval of ``Omega``, one for each value of the parameters in `over`.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Where they start; best far below resonance, from where it is carried to any damping and drive without a fold.
    over : mapping of str to array_like, shape (response,)
        As for `continue_family`, like `bounds` and `steps`.
    bounds : (float, float)
        Interval of ``Omega``, in omega_1.
    steps : StepControl, optional
        Sizes of steps and their limits.
    say : callable, optional
        Called with a line of text when a response is done.
    """
    from saltus.continuation import continue_family

    return continue_family(
        orbit,
        "Omega",
        over,
        bounds,
        steps=steps,
        workers=1,  # a response takes a tenth of a second, a process two seconds to start
        progress=lambda done, total, what: say(f"response {done} of {total}: {what}"),
    )


def gap_at_contact(parameters: Mapping[str, float]) -> float:
    """Return the gap at which contact begins, ``a0 / eta``.

    Examples
    --------
    >>> round(gap_at_contact({"a0": 2e-10, "eta": 60e-9}), 6)
    0.003333
    """
    return parameters["a0"] / parameters["eta"]

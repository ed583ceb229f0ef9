"""Places of cantilever, tip and sample surface along a periodic orbit, in an instrument's units."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.models.parts import is_model, parts_of
from saltus.afm.paper.regimes import tapping_modes
from saltus.afm.probe.beam import mode_shape
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.afm.paper.tapping import Setup
    from saltus.flow import Trajectory
    from saltus.orbits import PeriodicOrbit
    from saltus.system import HybridSystem

__all__ = ["Motion", "hertz_profile", "modes_of", "motion_of"]

_SHORT = 1e-6  # time over which the gap's rate is a difference, over the period
_RADIUS = 10.0  # nm; radius of the tip as drawn, where the law does not have it


@dataclass(frozen=True)
class Motion:
    """A periodic tapping motion at equally spaced times, in nanometres, nanonewtons and, where known, microseconds."""

    t: NDArray[np.float64]  # shape (time,): times, from 0; in us, or in periods of the motion
    period: float  # in the unit of `t`
    # shape (time, place), in nm: height of the beam's points over the sample, the tip's height left out
    beam: NDArray[np.float64]
    z: NDArray[np.float64]  # shape (time,), in nm: gap between tip and sample
    v: NDArray[np.float64]  # shape (time,), in mm/s or ``eta omega_1``: velocity of the gap
    force: NDArray[np.float64]  # shape (time,), in nN: on the tip, positive where it repels
    contact: NDArray[np.bool_]  # shape (time,): whether the tip is in contact
    surface: float  # in nm: gap at which contact begins
    radius: float  # in nm: radius of the tip


def modes_of(system: HybridSystem) -> int:
    """Return how many modes of the cantilever a system has.

    Raises
    ------
    InputError
        The system is none of `saltus.afm.tapping_mode` and `saltus.afm.model`.

    Examples
    --------
    >>> from saltus.afm import table1, tapping_mode
    >>> modes_of(tapping_mode(table1(), modes=2))
    2
    """
    if is_model(system):
        return parts_of(system).probe.modes
    return tapping_modes(system)


def motion_of(orbit: PeriodicOrbit, places: NDArray[np.float64], times: int, setup: Setup | None = None) -> Motion:
    """Return an orbit over one period from phase 0 on; the last time is one step before the end.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Admissible orbit of a system that `tapping_mode` or `model` returns.
    places : ndarray, shape (place,), in units of the beam's length
        Places of the beam's heights.
    times : int
        How many times.
    setup : Setup, optional
        As for `animate`.

    Raises
    ------
    InputError
        The system is neither, the orbit is not admissible, or `setup` is no Setup or is given for a model.

    Examples
    --------
    The tip's height is the gap:

    >>> from saltus.afm import table1, tapping_mode
    >>> from saltus.afm.paper.regimes import settled_orbit
    >>> orbit = settled_orbit(tapping_mode(table1()), {"Omega": 1.15})
    >>> motion = motion_of(orbit, np.array([0.0, 1.0]), 4)
    >>> bool(np.allclose(motion.beam[:, 1], motion.z)), motion.t.tolist()
    (True, [0.0, 0.25, 0.5, 0.75])
    """
    from saltus.afm.paper.tapping import Setup
    from saltus.flow import simulate

    n = modes_of(orbit.system)
    if not orbit.admissible:
        raise InputError("orbit", repr(orbit).splitlines()[0], "admissible", "; ".join(orbit.reasons))
    if setup is not None:
        checks.instance("setup", setup, Setup)
    p = orbit.parameters
    found = simulate(orbit.system, p, orbit.x0, periods=orbit.form.turns)
    t = found.t_end * np.arange(times) / times
    shapes = np.array([mode_shape(i + 1, places) for i in range(n)])
    if is_model(orbit.system):
        if setup is not None:
            raise InputError("setup", setup, "left out for a model of saltus.afm.model", "it is in nm and us already")
        return _in_nm(found, t, shapes)
    states, eta = found(t), 1e9 * p["eta"]
    base = p["ybar"] * np.sin(states[:, -1])
    unit, speed = 1.0 / found.t_end, 1.0
    if setup is not None:
        omega_1 = setup.cantilever.omega_1
        unit, speed = 1e6 / omega_1, 1e3 * p["eta"] * omega_1
    return Motion(
        t=unit * t,
        period=unit * found.t_end,
        beam=eta * (1.0 - base[:, None] - states[:, :n] @ shapes),
        z=eta * found.output("z", t),
        v=speed * found.output("v", t),
        force=eta * p["k"] * found.output("force", t),
        contact=found.mode_at(t) == "contact",
        surface=1e9 * p["a0"],
        radius=1e9 * p["R"],
    )


def _in_nm(found: Trajectory, t: NDArray[np.float64], shapes: NDArray[np.float64]) -> Motion:
    """Return a motion of a model, which is in nm and us; the gap's rate is a difference over a short time."""
    outputs, p = found.system.output_names, found.parameters
    gap, bent = found.output("D_nm", t), found(t)[:, : len(shapes)]
    short = _SHORT * found.t_end
    soon, later = found.output("D_nm", t + short), found.output("D_nm", t + 2.0 * short)
    contact, depth = np.zeros(len(t), dtype=bool), np.zeros(len(t))
    if "contact" in outputs:
        contact, depth = found.output("contact", t) > 0.5, found.output("indentation_nm", t)
    return Motion(
        t=t,
        period=found.t_end,
        beam=(gap - bent.sum(axis=1))[:, None] + bent @ shapes,
        z=gap,
        v=(4.0 * soon - 3.0 * gap - later) / (2.0 * short),
        force=found.output("force_nN", t),
        contact=contact,
        surface=float((gap + depth)[contact].max()) if contact.any() else p.get("a0_nm", 0.0),
        radius=p.get("R_nm", _RADIUS),
    )


def hertz_profile(r: NDArray[np.float64], depth: float, radius: float) -> NDArray[np.float64]:
    """Return how far a rigid sphere presses down the surface of an elastic half-space, at distances from its axis.

    Parameters
    ----------
    r : ndarray, any shape
        Distances.
    depth : float
        Indentation at the axis; in one unit with `r` and `radius`.
    radius : float
        Of the sphere, much larger than `depth`.

    Returns
    -------
    ndarray, shape of `r`

    References
    ----------
    K. L. Johnson, Contact Mechanics (1985), Eqs. (3.41a) and (3.42a); the DMT model's profile is Hertz's.

    Examples
    --------
    At the rim of the contact, ``r**2 = depth * radius``, the profile is half the depth, and far off it vanishes:

    >>> hertz_profile(np.array([0.0, 6.0, 600.0]), 2.0, 18.0).round(3).tolist()
    [2.0, 1.0, 0.008]
    """
    if depth <= 0.0:
        return np.zeros_like(r)
    ratio = np.maximum(np.abs(r) / math.sqrt(depth * radius), 1e-300)
    outside = (
        (2.0 - ratio**2) * np.arcsin(np.minimum(1.0 / ratio, 1.0)) + np.sqrt(np.maximum(ratio**2 - 1.0, 0.0))
    ) / np.pi
    return np.asarray(depth * np.where(ratio <= 1.0, 1.0 - 0.5 * ratio**2, outside))

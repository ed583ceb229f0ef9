"""A film of tapping: the cantilever in its true shape over the sample, beside the phase portrait and the force.

The beam has base and modes, ``w(x, t) = ybar sin(theta) + sum(q_i phi_i(x))`` with ``phi_i(L) = 1``. Heights are
enlarged against lengths some thousand times, and the tip's height and the beam's are not to scale; the lens shows the
tip's end at the sample, both directions on one scale.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.beam import mode_shape
from saltus.afm.movies import checked_movie, write_movie
from saltus.afm.regimes import tapping_modes
from saltus.errors import InputError

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from numpy.typing import NDArray

    from saltus.afm.tapping import Setup
    from saltus.orbits import PeriodicOrbit

__all__ = ["Motion", "Scene", "animate", "motion_of"]

_INCHES = (8.0, 4.4)
_WIDTHS = (320, 1920)
_SECONDS = (0.5, 60.0)
_FRAMES = 1000
"""A film has so many at the most."""

_CURVE, _PLACES = 1500, 121
"""Times a period of the drive at which curves are drawn, and points of the beam."""

_TIP_LENGTH, _TIP_HALF_WIDTH, _THICKNESS, _CLAMP = 26.0, 0.03, 5.0, 12.0
"""How the cantilever is drawn: the tip's height in nm, half its width in units of the beam's length, the beam's
thickness and half the clamp's height in nm. None is to scale."""

_DENT = 0.02
"""Half width of the dent in the sample as drawn below the cantilever, in units of the beam's length."""

_LENS, _LENS_RIM = (0.04, 6.0, 0.46, 48.0), (-8.0, 10.0)
"""Where the lens stands (left and width in units of the beam's length, bottom and height in nm: left, bottom, width,
height), and the heights seen in it."""

_WEAK = 0.1
"""Force in nN below which it is drawn in pN."""

_TRAIL = 0.12
"""Part of the period that the moving point's trail covers."""

_COLOURS = {False: "#0072b2", True: "#d55e00"}
"""Of flight and contact."""

_STEEL, _SAMPLE, _RIM, _FAINT, _TRACE = "#4b5563", "#d9c9a8", "#8a7650", "#eceff3", "#f2c84b"
"""Of the beam, the sample and its surface, the heights that the beam passes through, and the trail."""

_LOOK: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "0.35",
    "axes.linewidth": 0.8,
    "axes.labelsize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.color": "0.25",
    "ytick.color": "0.25",
    "mathtext.fontset": "dejavusans",
}


@dataclass(frozen=True)
class Motion:
    """A periodic tapping motion at equally spaced times, in nanometres, nanonewtons and, where known, microseconds.

    Attributes
    ----------
    t : ndarray, shape (time,)
        Times, from 0; in us, or in periods of the motion.
    period : float
        In the unit of `t`.
    beam : ndarray, shape (time, place), in nm
        Height of the beam's points over the sample, the tip's height left out.
    z : ndarray, shape (time,), in nm
        Gap between tip and sample.
    v : ndarray, shape (time,), in mm/s or ``eta omega_1``
        Velocity of the gap.
    force : ndarray, shape (time,), in nN
        On the tip, positive where it repels.
    contact : ndarray of bool, shape (time,)
        Whether the tip is in contact.
    """

    t: NDArray[np.float64]
    period: float
    beam: NDArray[np.float64]
    z: NDArray[np.float64]
    v: NDArray[np.float64]
    force: NDArray[np.float64]
    contact: NDArray[np.bool_]


def animate(
    orbit: PeriodicOrbit,
    path: str | os.PathLike[str],
    *,
    setup: Setup | None = None,
    fps: int = 25,
    seconds: float = 4.0,
    width: int = 800,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write a film of a periodic tapping motion, over one period, which closes on itself; return its path.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Of a system that `tapping_mode` returns, admissible.
    path : path-like
        A ``.gif``, or an ``.mp4`` where the extra ``saltus[video]`` is installed; an existing file is replaced.
    setup : Setup, optional
        The cantilever and sample of the system: with it time is in microseconds and length in micrometres, without it
        in periods and in units of the beam's length. Heights are in nanometres always.
    fps : int, optional
        Frames a second, for a GIF a divisor of 100 up to 50.
    seconds : float, optional
        How long the film lasts, from 0.5 to 60.
    width : int, optional
        In pixels, from 320 to 1920.
    progress : callable, optional
        Called with the number of frames done and of all.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        An argument that cannot be used.
    SaltusError
        An MP4 is asked for and its encoder is not installed.

    Examples
    --------
    >>> from saltus.afm import table1, tapping_mode
    >>> from saltus.afm.regimes import settled_orbit
    >>> orbit = settled_orbit(tapping_mode(table1()), {"Omega": 1.15})
    >>> animate(orbit, "nowhere/tap.gif")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: path = 'nowhere/tap.gif': must be a file in a folder that exists
    """
    from saltus.orbits import PeriodicOrbit

    checks.instance("orbit", orbit, PeriodicOrbit)
    path = checked_movie(path, fps)
    low, high = _SECONDS
    allowed = f"a number from {low:g} to {high:g} with {_FRAMES} frames at most"
    seconds = checks.number("seconds", seconds, allowed)
    if not low <= seconds <= high or (frames := max(2, round(seconds * fps))) > _FRAMES:
        raise InputError("seconds", seconds, allowed)
    width = checks.count("width", width, *_WIDTHS, "in pixels")
    checks.function("progress", progress, "of two counts")
    scene = Scene(orbit, setup, frames, seconds)
    shown = [partial(scene.show, frame) for frame in range(frames)]
    say = progress or (lambda done, total: None)
    write_movie(scene.figure, path, shown, fps=fps, dpi=width / _INCHES[0], progress=say)
    return path


def motion_of(orbit: PeriodicOrbit, places: NDArray[np.float64], times: int, setup: Setup | None = None) -> Motion:
    """Return an orbit over one period from phase 0 on, the last time one step before the period's end.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Of a system that `tapping_mode` returns, admissible.
    places : ndarray, shape (place,), in units of the beam's length
        Where the beam's height is asked for.
    times : int
        How many times.
    setup : Setup, optional
        As for `animate`.

    Raises
    ------
    InputError
        The system is not tapping mode, the orbit is not admissible, or `setup` is no Setup.

    Examples
    --------
    The tip's height is the gap:

    >>> from saltus.afm import table1, tapping_mode
    >>> from saltus.afm.regimes import settled_orbit
    >>> orbit = settled_orbit(tapping_mode(table1()), {"Omega": 1.15})
    >>> motion = motion_of(orbit, np.array([0.0, 1.0]), 4)
    >>> bool(np.allclose(motion.beam[:, 1], motion.z)), motion.t.tolist()
    (True, [0.0, 0.25, 0.5, 0.75])
    """
    from saltus.afm.tapping import Setup
    from saltus.flow import simulate

    n = tapping_modes(orbit.system)
    if not orbit.admissible:
        raise InputError("orbit", repr(orbit).splitlines()[0], "admissible", "; ".join(orbit.reasons))
    if setup is not None:
        checks.instance("setup", setup, Setup)
    p = orbit.parameters
    eta = 1e9 * p["eta"]
    found = simulate(orbit.system, p, orbit.x0, periods=orbit.form.turns)
    t = found.t_end * np.arange(times) / times
    states = found(t)
    base = p["ybar"] * np.sin(states[:, -1])
    shapes = np.array([mode_shape(i + 1, places) for i in range(n)])
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
    )


class Scene:
    """The picture of which the film is made: `show` moves it to a frame.

    Parameters
    ----------
    orbit : PeriodicOrbit
        As for `animate`.
    setup : Setup, optional
        As for `animate`.
    frames : int
        Into how many frames the period is cut.
    seconds : float
        How long the film of the period lasts.

    Attributes
    ----------
    figure : matplotlib.figure.Figure
        What is filmed.

    Raises
    ------
    InputError
        As `motion_of`.
    """

    def __init__(self, orbit: PeriodicOrbit, setup: Setup | None, frames: int, seconds: float) -> None:
        import matplotlib
        from matplotlib.figure import Figure

        places = np.linspace(0.0, 1.0, _PLACES)
        self._motion = motion_of(orbit, places, frames, setup)
        self._curve = motion_of(orbit, places[-1:], _CURVE * orbit.form.turns, setup)
        self._a0 = 1e9 * orbit.parameters["a0"]
        self._radius = 1e9 * orbit.parameters["R"]
        length = None if setup is None else setup.cantilever.length
        self._length, self._length_unit = (1e6 * length, "µm") if length else (1.0, "its length")
        self._time_unit, self._speed_unit = ("µs", "mm/s") if setup else ("periods", r"$\omega_1 \eta^*$")
        with matplotlib.rc_context(_LOOK):
            self.figure = Figure(figsize=_INCHES, facecolor="white")
            self.figure.text(0.068, 0.945, _title(orbit, setup, seconds), fontsize=10.0)
            self._draw_cantilever(self.figure.add_axes((0.068, 0.118, 0.535, 0.785)))
            self._draw_portrait(self.figure.add_axes((0.705, 0.598, 0.285, 0.305)))
            self._draw_force(self.figure.add_axes((0.705, 0.118, 0.285, 0.305)))
        self.show(0)

    def show(self, frame: int) -> None:
        """Move the picture to a frame, counted from 0."""
        motion = self._motion
        z, contact = float(motion.z[frame]), bool(motion.contact[frame])
        self._show_cantilever(motion.beam[frame], z, contact)
        colour = _COLOURS[contact]
        for point, place in (
            (self._moving, (z, motion.v[frame])),
            (self._pushed, (motion.t[frame], self._per_nN * motion.force[frame])),
        ):
            point.set_data(*np.array(place)[:, None])
            point.set_markerfacecolor(colour)
        at = round(frame * len(self._curve.t) / len(motion.t))
        trail = np.arange(at - round(_TRAIL * _CURVE), at + 1) % len(self._curve.t)
        self._trail.set_data(self._curve.z[trail], self._curve.v[trail])
        self._clock.set_text(f"t = {motion.t[frame]:.{1 if self._time_unit == 'µs' else 2}f} {self._time_unit}")
        self._told.set_text("contact" if contact else "")

    def _show_cantilever(self, beam: NDArray[np.float64], z: float, contact: bool) -> None:
        bottom = _to_the_end(beam) + _TIP_LENGTH
        outline = np.concatenate([bottom, bottom[::-1] + _THICKNESS])
        self._beam.set_xy(np.column_stack([np.concatenate([self._x, self._x[::-1]]), outline]))
        self._clamp.set_y(bottom[0] + 0.5 * _THICKNESS - _CLAMP)
        self._tip.set_xy(_cone(self._length, self._overhang, z, bottom[-1]))
        depth = max(self._a0 - z, 0.0)
        across = np.linspace(-1.0, 1.0, 21)
        dent = self._length * (1.0 + _DENT * across), self._a0 - depth * (1.0 - across**2)
        self._sample.set_xy(_below(self._edges, dent, self._floor))
        half = self._lens_half
        near = np.linspace(-half, half, 241)
        surface = self._a0 - hertz_profile(near, depth, self._radius)
        self._near_sample.set_xy(_below((-half, half), (near, surface), 2.0 * _LENS_RIM[0]))
        self._near_tip.set_center((0.0, z + self._radius))
        for patch in (self._tip, self._near_tip):
            patch.set_facecolor(_COLOURS[contact])

    def _draw_cantilever(self, ax: Axes) -> None:
        """Draw the beam over the sample, the heights that it passes through, and the lens."""
        from matplotlib.patches import Polygon, Rectangle

        beam, length = _to_the_end(self._motion.beam) + _TIP_LENGTH, self._length
        self._overhang = _TIP_HALF_WIDTH * length
        self._x = np.append(np.linspace(0.0, length, _PLACES), length + self._overhang)
        self._edges, self._floor = (-0.1 * length, 1.1 * length), -0.14 * float(beam.max())
        ax.set(xlim=self._edges, ylim=(self._floor, 1.1 * float(beam.max()) + _THICKNESS))
        ax.fill_between(self._x, beam.min(axis=0), beam.max(axis=0) + _THICKNESS, color=_FAINT, linewidth=0.0)
        hidden = np.zeros((3, 2))
        self._sample = Polygon(hidden, facecolor=_SAMPLE, edgecolor=_RIM, linewidth=1.0)
        ax.add_patch(self._sample)
        self._tip = Polygon(hidden, edgecolor="black", linewidth=0.7, zorder=4)
        ax.add_patch(self._tip)
        self._beam = Polygon(hidden, facecolor=_STEEL, edgecolor="black", linewidth=0.5, zorder=5)
        ax.add_patch(self._beam)
        clamp = Rectangle((self._edges[0], 0.0), -self._edges[0], 2.0 * _CLAMP, facecolor="0.72", edgecolor="0.3")
        clamp.set(hatch="////", linewidth=0.8, zorder=6)
        self._clamp = clamp
        ax.add_patch(clamp)
        ax.text(0.5 * length, 0.5 * self._floor, "sample", ha="center", va="center", color="#5c4d2e", fontsize=8.5)
        self._clock = ax.text(0.02, 0.96, "", transform=ax.transAxes, va="top", fontsize=10.0)
        self._told = ax.text(length, 0.5 * self._floor, "", ha="center", va="center", fontweight="bold")
        self._told.set_color(_COLOURS[True])
        ax.set_xlabel(f"along the cantilever ({self._length_unit})")
        ax.set_ylabel("height over the sample (nm)")
        self._draw_lens(ax)

    def _draw_lens(self, ax: Axes) -> None:
        """Draw the tip's end and the sample's surface, in nm in both directions."""
        from matplotlib.patches import Circle, Polygon

        left, bottom, width, height = _LENS
        place = (left * self._length, bottom, width * self._length, height)
        lens = ax.inset_axes(place, transform=ax.transData, zorder=3)
        figure_width, figure_height = ax.get_position().size * np.array(_INCHES)
        shape = (width * self._length * figure_width / np.ptp(ax.get_xlim())) / (
            height * figure_height / np.ptp(ax.get_ylim())
        )
        self._lens_half = 0.5 * shape * (_LENS_RIM[1] - _LENS_RIM[0])
        lens.set(xlim=(-self._lens_half, self._lens_half), ylim=_LENS_RIM, xticks=[], yticks=[])
        lens.spines[:].set(visible=True, color="0.4")
        self._near_sample = Polygon(np.zeros((3, 2)), facecolor=_SAMPLE, edgecolor=_RIM)
        lens.add_patch(self._near_sample)
        self._near_tip = Circle((0.0, 0.0), self._radius, edgecolor="black", linewidth=0.8)
        lens.add_patch(self._near_tip)
        bar = (-0.92 * self._lens_half, -0.92 * self._lens_half + 5.0)
        lens.plot(bar, (_LENS_RIM[0] + 1.5,) * 2, color="black", linewidth=1.6)
        lens.text(sum(bar) / 2.0, _LENS_RIM[0] + 2.1, "5 nm", ha="center", va="bottom", fontsize=7.0)
        right = place[0] + place[2], place[1] + 0.5 * place[3]
        ax.plot((right[0], 0.955 * self._length), (right[1], self._a0), color="0.55", linewidth=0.7, zorder=1)

    def _draw_portrait(self, ax: Axes) -> None:
        """Draw velocity against gap, the region of contact shaded."""
        _two_coloured(ax, self._curve.z, self._curve.v, self._curve.contact)
        limits = ax.get_xlim()
        ax.axvspan(limits[0], self._a0, color=_COLOURS[True], alpha=0.12, linewidth=0.0, zorder=0)
        ax.set_xlim(limits)
        (self._trail,) = ax.plot([], [], color=_TRACE, linewidth=4.5, zorder=1, solid_capstyle="round")
        self._moving = _dot(ax)
        ax.set_xlabel("gap $z$ (nm)")
        ax.set_ylabel(f"velocity $\\dot{{z}}$ ({self._speed_unit})")

    def _draw_force(self, ax: Axes) -> None:
        """Draw the force against time, the contacts shaded."""
        curve = self._curve
        self._per_nN, unit = (1.0, "nN") if np.abs(curve.force).max() > _WEAK else (1e3, "pN")
        _two_coloured(ax, curve.t, self._per_nN * curve.force, curve.contact)
        limits = ax.get_ylim()
        ax.fill_between(
            curve.t, *limits, where=curve.contact.tolist(), color=_COLOURS[True], alpha=0.12, linewidth=0.0, zorder=0
        )
        ax.set(xlim=(0.0, curve.period), ylim=limits)
        self._pushed = _dot(ax)
        ax.set_xlabel(f"time $t$ ({self._time_unit})")
        ax.set_ylabel(f"force ({unit})")


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
    At the rim of the contact, ``r**2 = depth * radius``, it is half the depth, and far off it vanishes:

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


def _title(orbit: PeriodicOrbit, setup: Setup | None, seconds: float) -> str:
    """Return what moves, and how fast."""
    n, omega, turns = tapping_modes(orbit.system), orbit.parameters["Omega"], orbit.form.turns
    words = [f"tapping mode, {n} {'mode' if n == 1 else 'modes'}", rf"$\Omega = {omega:g}\,\omega_1$"]
    if turns > 1:
        words.append(f"period {turns}")
    if setup is not None:
        words[1] += f" = {omega * setup.cantilever.f0 / 1e3:.1f} kHz"
        slowed = seconds * setup.cantilever.omega_1 / orbit.period
        words.append(f"slowed {float(f'{slowed:.1g}'):,.0f} times".replace(",", " "))
    return "  ·  ".join(words)


def _two_coloured(ax: Axes, x: NDArray[np.float64], y: NDArray[np.float64], contact: NDArray[np.bool_]) -> None:
    """Draw a curve, contact in its colour."""
    touching = contact | np.roll(contact, 1)
    for part, colour in ((~contact, _COLOURS[False]), (touching, _COLOURS[True])):
        ax.plot(np.where(part, x, np.nan), np.where(part, y, np.nan), color=colour, linewidth=1.3, zorder=2)


def _dot(ax: Axes) -> Line2D:
    (dot,) = ax.plot([], [], "o", markersize=7.0, markeredgecolor="black", markeredgewidth=0.8, zorder=5, clip_on=False)
    return dot


def _to_the_end(beam: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heights of the beam (..., place) with one beyond the tip's place, where the drawn beam ends."""
    slope = (beam[..., -1:] - beam[..., -2:-1]) * (_PLACES - 1)
    return np.concatenate([beam, beam[..., -1:] + slope * _TIP_HALF_WIDTH], axis=-1)


def _cone(x: float, half_width: float, apex: float, top: float) -> NDArray[np.float64]:
    """Return the outline of the tip, its end rounded."""
    across = np.linspace(-1.0, 1.0, 41)
    rounded = np.sqrt(across**2 + 0.02) - math.sqrt(0.02)
    return np.column_stack([x + half_width * across, apex + (top - apex) * rounded / rounded[0]])


def _below(
    edges: tuple[float, float], dent: tuple[NDArray[np.float64], NDArray[np.float64]], floor: float
) -> NDArray[np.float64]:
    """Return the outline of the sample between two edges, down to a floor, its surface given where it is no plane."""
    x = np.concatenate([[edges[0]], dent[0], [edges[1], edges[1], edges[0]]])
    y = np.concatenate([dent[1][:1], dent[1], dent[1][-1:], [floor, floor]])
    return np.column_stack([x, y])

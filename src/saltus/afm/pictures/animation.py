"""A film of tapping: the cantilever in its true shape over the sample, beside the phase portrait and the force.

The beam has base and modes, ``w(x, t) = ybar sin(theta) + sum(q_i phi_i(x))`` with ``phi_i(L) = 1``. Heights are
enlarged against lengths some thousand times. The tip's and the beam's height are not to scale. The lens shows the tip's
end at the sample, both directions on one scale.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.models.parts import is_model
from saltus.afm.pictures.cantilever_motion import hertz_profile, modes_of, motion_of
from saltus.errors import InputError
from saltus.plotting.movies import checked_movie, write_movie
from saltus.progress import Report, Reporter

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from numpy.typing import NDArray

    from saltus.afm.paper.tapping import Setup
    from saltus.orbits import PeriodicOrbit

__all__ = ["Scene", "animate"]

_INCHES = (8.0, 4.4)  # width and height of a frame at the default size
_WIDTHS = (320, 1920)  # smallest and largest width of a film, in pixels
_SECONDS = (0.5, 60.0)  # shortest and longest film, in seconds
_FRAMES = 1000  # frames of a film, at most

_CURVE = 1500  # times a period of the drive at which curves are drawn
_PLACES = 121  # points of the beam that are drawn

# The cantilever as drawn, not to scale; heights are for a gap of 60 nm.
_GAP = 60.0  # gap at rest, in nm
_TIP_LENGTH = 26.0  # height of the tip, in nm
_TIP_HALF_WIDTH = 0.03  # half width of the tip, in lengths of the beam
_THICKNESS = 5.0  # thickness of the beam, in nm
_CLAMP = 12.0  # half height of the clamp, in nm


_DENT = 0.02  # half width of the sample's dent as drawn below the cantilever, in lengths of the beam

# Place of the lens: left in lengths of the beam, bottom in nm, width in lengths of the beam, height in nm.
_LENS = (0.04, 6.0, 0.46, 48.0)
_LENS_RIM = (-8.0, 10.0)  # heights seen in the lens, in nm

_WEAK = 0.1  # force in nN below which it is drawn in pN

_TRAIL = 0.12  # share of the period that the moving point's trail covers

_COLOURS = {False: "#0072b2", True: "#d55e00"}  # of flight and of contact

_STEEL = "#4b5563"  # colour of the beam
_SAMPLE = "#d9c9a8"  # colour of the sample
_RIM = "#8a7650"  # colour of the sample's surface
_FAINT = "#eceff3"  # colour of the heights that the beam passes through
_TRACE = "#f2c84b"  # colour of the trail

# Matplotlib's settings for a film.
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


def animate(
    orbit: PeriodicOrbit,
    path: str | os.PathLike[str],
    *,
    setup: Setup | None = None,
    fps: int = 25,
    seconds: float = 4.0,
    width: int = 800,
    progress: bool | Report = False,
) -> Path:
    """Write a film of one period of a tapping motion, which closes on itself; return its path.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Admissible orbit of a system that `tapping_mode` or `model` returns.
    path : path-like
        A ``.gif``, or an ``.mp4`` where the extra ``saltus[video]`` is installed; an existing file is replaced.
    setup : Setup, optional
        The cantilever and sample of `tapping_mode`. With it, time is in microseconds and length in micrometres; else in
        periods and lengths of the beam. A model has microseconds without it. Heights are always in nanometres.
    fps : int, optional
        Frames a second, for a GIF a divisor of 100 up to 50.
    seconds : float, optional
        Duration of the film, from 0.5 to 60.
    width : int, optional
        Width in pixels, from 320 to 1920.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress`, which counts the frames.

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
    >>> from saltus.afm.paper.regimes import settled_orbit
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
    reporter = Reporter(progress, frames)
    scene = Scene(orbit, setup, frames, seconds)
    shown = [partial(scene.show, frame) for frame in range(frames)]
    with reporter:
        write_movie(scene.figure, path, shown, fps=fps, dpi=width / _INCHES[0], reporter=reporter)
    return path


class Scene:
    """The picture that is filmed; `show` moves it to a frame.

    Parameters
    ----------
    orbit : PeriodicOrbit
        As for `animate`.
    setup : Setup, optional
        As for `animate`.
    frames : int
        Count of frames in the period.
    seconds : float
        Duration of the film.

    Attributes
    ----------
    figure : matplotlib.figure.Figure
        The picture.

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
        self._a0, self._radius = self._motion.surface, self._motion.radius
        measured = setup is not None or is_model(orbit.system)
        heights = self._motion.z
        self._scale = max(heights.max(), np.ptp(heights)) / (2.0 * _GAP) if is_model(orbit.system) else 1.0
        length = None if setup is None else setup.cantilever.length
        self._length, self._length_unit = (1e6 * length, "µm") if length else (1.0, "its length")
        self._time_unit, self._speed_unit = ("µs", "mm/s") if measured else ("periods", r"$\omega_1 \eta^*$")
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
        bottom = _to_the_end(beam) + self._scale * _TIP_LENGTH
        outline = np.concatenate([bottom, bottom[::-1] + self._scale * _THICKNESS])
        self._beam.set_xy(np.column_stack([np.concatenate([self._x, self._x[::-1]]), outline]))
        self._clamp.set_y(bottom[0] + self._scale * (0.5 * _THICKNESS - _CLAMP))
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
        """Draw the beam over the sample, the range of its heights, and the lens."""
        from matplotlib.patches import Polygon, Rectangle

        beam, length = _to_the_end(self._motion.beam) + self._scale * _TIP_LENGTH, self._length
        self._overhang = _TIP_HALF_WIDTH * length
        self._x = np.append(np.linspace(0.0, length, _PLACES), length + self._overhang)
        self._edges, self._floor = (-0.1 * length, 1.1 * length), -0.14 * float(beam.max())
        ax.set(xlim=self._edges, ylim=(self._floor, 1.1 * float(beam.max()) + self._scale * _THICKNESS))
        ax.fill_between(
            self._x, beam.min(axis=0), beam.max(axis=0) + self._scale * _THICKNESS, color=_FAINT, linewidth=0.0
        )
        hidden = np.zeros((3, 2))
        self._sample = Polygon(hidden, facecolor=_SAMPLE, edgecolor=_RIM, linewidth=1.0)
        ax.add_patch(self._sample)
        self._tip = Polygon(hidden, edgecolor="black", linewidth=0.7, zorder=4)
        ax.add_patch(self._tip)
        self._beam = Polygon(hidden, facecolor=_STEEL, edgecolor="black", linewidth=0.5, zorder=5)
        ax.add_patch(self._beam)
        clamp = Rectangle((self._edges[0], 0.0), -self._edges[0], 2.0 * self._scale * _CLAMP, fc="0.72", ec="0.3")
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

        left, bottom, width, height = np.array(_LENS) * (1.0, self._scale, 1.0, self._scale)
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


def _title(orbit: PeriodicOrbit, setup: Setup | None, seconds: float) -> str:
    """Return the title: parameters, and rate of the film."""
    n, p, turns = modes_of(orbit.system), orbit.parameters, orbit.form.turns
    words = [f"tapping mode, {n} {'mode' if n == 1 else 'modes'}"]
    if is_model(orbit.system):
        slowed = float(f"{seconds * 1e6 / orbit.period:.1g}")
        return "  ·  ".join([*words, f"{p['f_kHz']:.1f} kHz", f"slowed {slowed:,.0f} times".replace(",", " ")])
    omega = p["Omega"]
    words.append(rf"$\Omega = {omega:g}\,\omega_1$")
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
    """Return the beam's heights (..., place) with one more beyond the tip, where the drawn beam ends."""
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
    """Return the outline of the sample between two edges, from its surface down to a floor."""
    x = np.concatenate([[edges[0]], dent[0], [edges[1], edges[1], edges[0]]])
    y = np.concatenate([dent[1][:1], dent[1], dent[1][-1:], [floor, floor]])
    return np.column_stack([x, y])

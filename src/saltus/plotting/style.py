"""Colours, markers and line styles of all pictures, and sizes for print."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.continuation.core.point_types import POINT_TYPES, PointType, type_on
from saltus.errors import InputError
from saltus.extras import check_installed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "CURVE",
    "EVENT",
    "FAULTY",
    "LINES",
    "PLANE",
    "SPECIAL",
    "SURFACE",
    "Marker",
    "axes",
    "check_matplotlib",
    "check_options",
    "chosen_colour",
    "colour_of_mode",
    "draw_legend",
    "label_of",
    "line_of",
    "new_figure",
    "plain",
    "publication",
    "values_of",
]

CURVE = "#1b1b1e"  # colour of a branch
SURFACE = "#e8820c"  # colour of an event surface, drawn as a dotted line: the paper's orange

_NO_MOTION = {"color": "0.6", "linestyle": (0, (1.0, 1.5)), "linewidth": 1.1}  # of what is no motion of the system

# Line styles by the kind of orbits or equilibria.
LINES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "stable": {"color": CURVE, "linestyle": "-", "linewidth": 1.4},
        "unstable": {"color": CURVE, "linestyle": (0, (3.5, 1.7)), "linewidth": 1.1},
        "not admissible": _NO_MOTION,
        "virtual": _NO_MOTION,
    }
)

FAULTY = ("not admissible", "virtual")  # kinds that are no motion of the system

# How an event surface is drawn in space: the paper's pink.
PLANE: Mapping[str, Any] = MappingProxyType(
    {"facecolor": "#f28ab2", "alpha": 0.25, "edgecolor": "#c85a87", "linewidth": 0.5}
)


@dataclass(frozen=True)
class Marker:
    """Marker of a type of special point, and the type's name in a legend."""

    meaning: str
    marker: str
    colour: str
    filled: bool = True
    size: float = 5.0

    def options(self) -> dict[str, Any]:
        """Return keyword options of `Axes.plot`."""
        return {
            "linestyle": "none",
            "marker": self.marker,
            "markersize": self.size,
            "markerfacecolor": self.colour if self.filled else "white",
            "markeredgecolor": "white" if self.filled else self.colour,
            "markeredgewidth": 0.5 if self.filled else 1.1,
        }


def _marker(of: PointType) -> Marker:
    return Marker(of.legend, of.marker, of.colour, of.filled, of.size)


# Markers of special points, those of loci where letters have two meanings.
SPECIAL: Mapping[str, Marker] = MappingProxyType({name: _marker(of) for name, of in POINT_TYPES.items()})

EVENT = Marker("event", "o", "#8a6d00", filled=False)  # marker of a user's event

# Colours of modes, after M. Okabe and K. Ito, distinguishable by the colour-blind.
_MODES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#555555")

# Names that an axis shows as Greek letters.
_GREEK = (
    *("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu", "nu", "xi"),
    *("rho", "sigma", "tau", "phi", "chi", "psi", "omega"),
    *("Gamma", "Delta", "Theta", "Lambda", "Xi", "Sigma", "Phi", "Psi", "Omega"),
)

# Units at the ends of names, and how an axis shows them.
_UNITS = {
    **{unit: unit for unit in ("nm", "pm", "us", "kHz", "nN", "aJ", "eV", "pW", "GPa")},
    **{"nm_us": "nm/us", "N_m": "N/m", "uNs_m": "uN s/m", "Pa_s": "Pa s", "mC_m2": "mC/m²", "deg": "degrees"},
}
_MEASURED = re.compile(rf"(?P<name>\w+?)_(?P<unit>{'|'.join(_UNITS)})(?P<number>_[2-9]\d*)?")

# Settings of matplotlib for print, sizes in points.
_PRINT: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.labelsize": 8.5,
    "axes.titlesize": 9.0,
    "axes.linewidth": 0.7,
    "grid.color": "0.82",
    "grid.linewidth": 0.4,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.fontsize": 7.0,
    "legend.frameon": False,
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,
    "savefig.dpi": 300,
}


@contextmanager
def publication() -> Iterator[None]:
    """Run a block with font sizes and line widths for a figure printed at its true size (8 pt text, 300 dpi).

    Examples
    --------
    >>> import matplotlib
    >>> with publication():
    ...     matplotlib.rcParams["font.size"]
    8.0
    """
    import matplotlib

    with matplotlib.rc_context(_PRINT):
        yield


def check_options(ax: object, *names: object, **flags: object) -> None:
    """Raise `InputError` unless `ax` is Axes or None, each name a text or None, each flag a truth value."""
    if ax is not None:
        from matplotlib.axes import Axes

        checks.instance("ax", ax, Axes)
    for name in names:
        if name is not None:
            checks.text("quantity", name, "the name of a quantity")
    for name, value in flags.items():
        checks.flag(name, value)


def chosen_colour(colour: str | None, own: str) -> str:
    """Return a colour that was asked for, or its own one where none was.

    Raises
    ------
    InputError
        It is no colour of matplotlib.
    """
    from matplotlib.colors import is_color_like

    if colour is not None and not is_color_like(colour):
        raise InputError("colour", colour, "a colour of matplotlib, as '#2f6fb0'")
    return own if colour is None else colour


def line_of(kind: str, colour: str | None = None) -> dict[str, Any]:
    """Return the options of a line of a kind; in a colour of one's own unless it is no motion of the system.

    Raises
    ------
    InputError
        It is no colour of matplotlib.
    """
    own = dict(LINES[kind])
    return own if kind in FAULTY else own | {"color": chosen_colour(colour, own["color"])}


def on_branches(kind: str) -> Marker:
    """Return the marker of a type of special points of branches; one without a meaning for a user's event.

    Examples
    --------
    >>> on_branches("CH").meaning, SPECIAL["CH"].meaning
    ('accumulation of hits', 'Chenciner point')
    """
    return marker_of(kind) or replace(EVENT, meaning="")


def marker_of(kind: str, locus: str = "") -> Marker | None:
    """Return the marker of a type of special points of a branch, or of a locus of some type; None of users' events."""
    of = type_on(kind, locus)
    return None if of is None else _marker(of)


def axes(ax: Axes | None) -> Axes:
    """Return `ax`, or the Axes of a new figure."""
    return new_figure().add_subplot() if ax is None else ax


def draw_legend(ax: Axes) -> None:
    """Draw the legend of Axes; what several curves have in common is named once."""
    handles, labels = ax.get_legend_handles_labels()
    named = dict(zip(reversed(labels), reversed(handles), strict=True))
    ax.legend([named[label] for label in dict.fromkeys(labels)], [*dict.fromkeys(labels)])


def new_figure(**options: Any) -> Figure:
    """Return a new figure of pyplot; options are those of `matplotlib.pyplot.figure`.

    Raises
    ------
    InputError
        The backend of matplotlib cannot be used here.
    """
    check_matplotlib()
    from matplotlib import get_backend, pyplot

    try:
        return pyplot.figure(**{"layout": "constrained"} | options)
    except ImportError as error:
        wanted = "a backend of matplotlib that can be used here"
        raise InputError("MPLBACKEND", get_backend(), wanted, f"agg can be; {error}") from error


def panels_of(ax: Sequence[Axes] | Axes | None, count: int = 2) -> tuple[Axes, ...]:
    """Return Axes, one above the other: those given, or new ones with a common axis below."""
    if ax is None:
        height = {1: 4.0, 2: 6.4}.get(count, 2.4 * count + 0.8)
        drawn = new_figure(figsize=(6.4, height)).subplots(count, 1, sharex=True, squeeze=False)
        return tuple(drawn[:, 0])
    from matplotlib.axes import Axes

    given = [*ax] if not isinstance(ax, Axes) else [ax]
    if len(given) != count or not all(isinstance(panel, Axes) for panel in given):
        allowed = {1: "one Axes", 2: "two Axes, the upper and the lower one"}
        raise InputError("ax", ax, allowed.get(count, f"{count} Axes, from the upper to the lower one"))
    return tuple(given)


def check_matplotlib() -> None:
    """Raise where matplotlib cannot be imported: `SaltusError` if absent, `InputError` if MPLBACKEND is unknown."""
    check_installed("matplotlib")
    try:
        import matplotlib  # noqa: F401 - reads MPLBACKEND
    except ValueError as error:
        named = os.environ.get("MPLBACKEND")
        raise InputError("MPLBACKEND", named, "the name of a backend of matplotlib", "agg is one") from error


def values_of(values: Mapping[str, float], labels: Mapping[str, str] | None = None) -> str:
    r"""Return quantities with their values as text of a title.

    Examples
    --------
    >>> values_of({"q2": 0.25, "v2": 0.48564})
    '$q_{2}$ = 0.25, $v_{2}$ = 0.48564'
    """
    told = [f"{(labels or {}).get(name) or label_of(name)} = {value:.5g}" for name, value in values.items()]
    return ", ".join(told).replace("-", "\N{MINUS SIGN}")


def colour_of_mode(index: int) -> str:
    """Return the colour of a mode by its index in the definition."""
    return _MODES[index % len(_MODES)]


def plain(name: str) -> str:
    r"""Return any name, as from a file, with dollar signs escaped: no part is read as mathematics.

    Examples
    --------
    >>> plain("from 1$ to 2$")
    'from 1\\$ to 2\\$'
    """
    return name.replace("$", r"\$")


def label_of(name: str) -> str:
    r"""Return a quantity's name for an axis, with Greek letters and subscripts.

    Examples
    --------
    >>> label_of("Omega"), label_of("min_z"), label_of("v1"), label_of("D_rep_2"), label_of("period")
    ('$\\Omega$', 'min $z$', '$v_{1}$', '$D_{rep,2}$', 'period')

    A unit at a name's end is told in brackets, before the number of a mode or a drive as well:

    >>> label_of("z1_nm"), label_of("v1_nm_us"), label_of("k_N_m_2"), label_of("virial_eV")
    ('$z_{1}$ (nm)', '$v_{1}$ (nm/us)', '$k_{2}$ (N/m)', 'virial (eV)')
    """
    if name in ("period", "arclength") or not name.isidentifier():
        return plain(name)
    for extreme in ("min", "max"):
        if name.startswith(f"{extreme}_"):
            return f"{extreme} {label_of(name[4:])}"
    if measured := _MEASURED.fullmatch(name):
        return f"{label_of(measured['name'] + (measured['number'] or ''))} ({_UNITS[measured['unit']]})"
    head, *indices = name.split("_")
    stem = head.rstrip("0123456789")
    if stem and stem != head:
        indices.insert(0, head[len(stem) :])
    stem = stem or head
    if stem in _GREEK:
        symbol = f"\\{stem}"
    elif len(stem) == 1:
        symbol = stem
    else:
        return name
    below = f"_{{{','.join(index for index in indices if index)}}}" if any(indices) else ""
    return f"${symbol}{below}$"

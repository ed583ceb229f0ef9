"""The types of special points, a line each: what a type means, on which curves it is located, how it is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

__all__ = [
    "ACCUMULATION",
    "CHANGES",
    "POINT_TYPES",
    "PointType",
    "accumulates",
    "loci_through",
    "meaning_of",
    "on_branches",
    "type_on",
]

_INK = "#1b1b1e"
_RED = "#b8101f"  # red, green and purple are the paper's
_GREEN = "#35b755"  # much lighter than the red: the two differ without colour too
_PURPLE = "#7b3294"
_BROWN = "#8a4b08"


@dataclass(frozen=True)
class PointType:
    """A type of special point; a kind of solution is ``orbit``, ``equilibrium`` or ``map``."""

    meaning: str  # in words, as a `repr` has them
    legend: str  # in words, as a picture has them
    marker: str  # of Matplotlib
    colour: str
    branches: tuple[str, ...] = ()  # kinds of solutions on whose branches the type is located
    loci: tuple[str, ...] = ()  # kinds that have loci through points of the type
    locus: str = ""  # of a type of codimension two the simplest locus through it; empty for others
    filled: bool = True
    size: float = 5.0  # of the marker
    changes: bool = False  # whether the signature of an orbit changes there


_ALL = ("orbit", "equilibrium", "map")
_BOTH = ("orbit", "map")
_ORBIT = ("orbit",)
_REST = ("equilibrium",)
_MAP = ("map",)

POINT_TYPES: Mapping[str, PointType] = MappingProxyType(
    {
        "SN": PointType("saddle-node (fold)", "saddle-node", "o", _RED, _ALL, _ALL),
        "PD": PointType("period doubling (flip)", "period doubling", "o", _PURPLE, _BOTH, _BOTH, size=3.5),
        "TR": PointType("torus (Neimark-Sacker)", "torus", "D", "#0f5fa8", _BOTH, _BOTH, filled=False),
        "BP": PointType("branch point", "branch point", "s", "#000000", _ALL, _ORBIT),
        "GR": PointType("grazing", "grazing", "o", _GREEN, _ORBIT, _ORBIT, changes=True),
        "CS": PointType("crossing-sliding", "crossing-sliding", "v", _GREEN, _ORBIT, _ORBIT, changes=True),
        "GS": PointType("grazing-sliding", "grazing-sliding", "^", _GREEN, _ORBIT, _ORBIT, changes=True),
        "SS": PointType("switching-sliding", "switching-sliding", "<", _GREEN, _ORBIT, _ORBIT, changes=True),
        "AS": PointType("adding-sliding", "adding-sliding", ">", _GREEN, _ORBIT, _ORBIT, changes=True),
        "HB": PointType("Hopf", "Hopf point", "D", "#b35900", _REST, _REST),
        "HOM": PointType("homoclinic orbit", "homoclinic orbit", "*", _INK, size=7.0),
        "SNIC": PointType(
            *("saddle-node on an invariant circle", "saddle-node on an invariant circle", "*", _RED),
            filled=False, size=7.0,
        ),
        "BE": PointType("boundary equilibrium", "boundary equilibrium", "s", "#00798c", _REST, _REST, filled=False),
        "BC": PointType("border collision", "border collision", "s", _GREEN, _BOTH, _BOTH, changes=True),
        "CP": PointType("cusp", "cusp", "^", _INK, loci=_ALL, locus="SN", size=6.0),
        "GPD": PointType(
            "generalised period doubling", "generalised period doubling", "v", _INK, loci=_BOTH, locus="PD", size=6.0
        ),
        "CH": PointType("Chenciner", "Chenciner point", "p", _INK, loci=_BOTH, locus="TR", size=6.0),
        "R1": PointType("strong resonance 1:1", "resonance 1:1", "<", _BROWN, loci=_BOTH, locus="SN", size=6.0),
        "R2": PointType("strong resonance 1:2", "resonance 1:2", ">", _BROWN, loci=_BOTH, locus="PD", size=6.0),
        "R3": PointType("strong resonance 1:3", "resonance 1:3", "h", _BROWN, loci=_BOTH, locus="TR", size=6.0),
        "R4": PointType("strong resonance 1:4", "resonance 1:4", "X", _BROWN, loci=_BOTH, locus="TR", size=6.0),
        "FF": PointType("fold-flip", "fold-flip", "P", _INK, loci=_BOTH, locus="SN", size=6.0),
        "FNS": PointType(
            "fold-Neimark-Sacker", "fold-Neimark-Sacker", "p", _INK, loci=_BOTH, locus="SN", filled=False, size=6.0
        ),
        "PDNS": PointType(
            "flip-Neimark-Sacker", "flip-Neimark-Sacker", "v", _BROWN, loci=_BOTH, locus="PD", filled=False, size=6.0
        ),
        "NSNS": PointType(
            "double Neimark-Sacker", "double Neimark-Sacker", "h", _INK, loci=_BOTH, locus="TR", filled=False, size=6.0
        ),
        "SNSN": PointType(
            "double saddle-node, as by symmetry", "double saddle-node", "P", _INK, loci=_ALL, locus="SN", filled=False,
            size=6.0,
        ),
        "PDPD": PointType(
            "double period doubling, as by symmetry", "double period doubling", "P", _BROWN, loci=_BOTH, locus="PD",
            filled=False, size=6.0,
        ),
        "BT": PointType("Bogdanov-Takens", "Bogdanov-Takens", "*", _INK, loci=_REST, locus="HB", size=8.0),
        "GH": PointType(
            "generalised Hopf (Bautin)", "generalised Hopf", "v", _INK, loci=_REST, locus="HB", filled=False, size=6.0
        ),
        "ZH": PointType("zero-Hopf", "zero-Hopf", "p", _INK, loci=_REST, locus="SN", filled=False, size=6.0),
        "HH": PointType("double Hopf", "double Hopf", "h", _INK, loci=_REST, locus="HB", filled=False, size=6.0),
        "TP": PointType("turning point of a parameter", "turning point", "o", "#5c5c66", filled=False, size=4.0),
        "EX": PointType("extremum", "extremum", "^", "#8a6d00", filled=False),
    }
)  # fmt: skip

# The type of a branch's points at which hits become infinitely many. On a TR locus its letters name Chenciner points.
ACCUMULATION = "CH"
_CHATTER = PointType("accumulation of hits (chatter)", "accumulation of hits", "X", _GREEN, _ORBIT, size=6)

# Types of special points at which the signature of an orbit changes.
CHANGES = tuple(name for name, known in POINT_TYPES.items() if known.changes)


def on_branches(kind: str) -> tuple[str, ...]:
    """Return the types that are located on branches of a kind of solution, where a bifurcation or a border is met."""
    return tuple(name for name, known in POINT_TYPES.items() if kind in known.branches)


def loci_through(kind: str) -> Mapping[str, str]:
    """Return the types of points through which a kind of solution has loci, each with the type of its locus."""
    return {name: known.locus or name for name, known in POINT_TYPES.items() if kind in known.loci}


def accumulates(type: str, locus: str) -> bool:
    """Return whether a special point of a type, on a branch or on a locus of some type, is an accumulation of hits."""
    return type == ACCUMULATION and locus in ("", ACCUMULATION)


def type_on(name: str, locus: str = "") -> PointType | None:
    """Return what is known of a type of special points of a branch, or of a locus of some type; None of users' events.

    Examples
    --------
    >>> type_on("CH").meaning, type_on("CH", "TR").meaning
    ('accumulation of hits (chatter)', 'Chenciner')
    """
    return _CHATTER if accumulates(name, locus) else POINT_TYPES.get(name)


def meaning_of(name: str, locus: str = "") -> str:
    """Return a type of special points in words; empty for users' events."""
    known = type_on(name, locus)
    return "" if known is None else known.meaning

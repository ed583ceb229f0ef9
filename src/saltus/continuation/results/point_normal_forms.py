"""Normal forms at special points, by the kind of solution, or why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import singledispatch
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.continuation.core.point_types import POINT_TYPES
from saltus.equilibria import Equilibrium, find_equilibrium
from saltus.equilibria.normal_forms import (
    NORMAL_FORMS as EQUILIBRIUM_FORMS,
    EquilibriumNormalForm,
    normal_form as equilibrium_form,
)
from saltus.errors import InputError, SaltusError
from saltus.maps import MapOrbit
from saltus.maps.halves import half_of
from saltus.maps.normal_forms import map_normal_form
from saltus.orbits import PeriodicOrbit
from saltus.orbits.find import once_round
from saltus.orbits.normal_forms import NORMAL_FORMS, NormalForm, normal_form

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Critical", "NoNormalForm", "normal_form_at"]


class Critical(NamedTuple):
    """What a normal form takes from a special point: its type, label, varied parameters and sizes of the unknowns."""

    type: str
    label: str
    varied: tuple[str, ...]
    scale: NDArray[np.float64] | None


@dataclass(frozen=True)
class NoNormalForm:
    """What a point without a normal form has instead: the reason."""

    type: str  # type of the point
    reason: str  # why there is none, a sentence
    expected: bool = True  # whether no point of this type has one
    coefficient: float = math.nan  # NaN, as there is none

    @property
    def criticality(self) -> str:
        """What is born: ``undetermined``."""
        return "undetermined"

    def __repr__(self) -> str:
        return f"NoNormalForm {self.type}: {self.reason}"


_REASONS = {
    "BP": "two branches cross there; switch_branch(point) goes to the other one",
    "HOM": "cycles end there at a homoclinic orbit, with an infinite period",
    "SNIC": "cycles end there at a saddle-node on their own curve, with an infinite period",
    "BE": "an equilibrium meets a surface there; switch_branch(point) tells what lies beyond",
    "TP": "a parameter turns there; it is no bifurcation",
    "EX": "a quantity has an extremum there; it is no bifurcation",
}


def _reason(type: str) -> str:
    """Return why points of a type have no normal form."""
    known = POINT_TYPES[type]
    if known.changes:
        return "the sequence of events changes there; switch_branch(point) tells what lies beyond"
    if known.locus:
        beside = f"points of the {known.locus} locus beside it have theirs"
        return f"none is computed at this point of codimension two; {beside}"
    return _REASONS.get(type, "none is known of this kind of solution")


def normal_form_at(solution: Any, point: Critical) -> NormalForm | EquilibriumNormalForm | NoNormalForm:
    """Return the normal form at a special point, or why there is none.

    Parameters
    ----------
    solution : Solution
        The solution at the point.
    point : Critical
        The point.
    """
    if not any(isinstance(solution, kind) and point.type in types for kind, types in _OWN.items()):
        return NoNormalForm(point.type, _doubling(solution, point) or _reason(point.type))
    try:
        return _form_at(solution, point)
    except SaltusError as error:
        return NoNormalForm(point.type, str(error), expected=False)
    except np.linalg.LinAlgError as error:
        return NoNormalForm(point.type, f"the equations are singular there: {error}", expected=False)


def _doubling(solution: Any, point: Critical) -> str:
    """Return what doubles its period at a BP; an empty text where no orbit does, or its normal form is unknown."""
    if point.type != "BP":
        return ""
    single: Any = None
    if isinstance(solution, MapOrbit):
        single = half_of(solution)
    elif isinstance(solution, PeriodicOrbit) and solution.rounds == 2:
        single = once_round(solution)
    if single is None:
        return ""
    form = normal_form_at(single, point._replace(type="PD"))
    if not isinstance(form, NormalForm):
        return ""
    doubling = f"the orbit of half the period doubles there ({form.criticality}, coefficient {form.coefficient:.6g})"
    return f"{doubling}; switch_branch(point) goes to the other branch"


# Types with a normal form, by the class of the solution. An HB of orbits is that of the equilibrium they shrink to.
_OWN: dict[type, tuple[str, ...]] = {
    Equilibrium: EQUILIBRIUM_FORMS,
    MapOrbit: NORMAL_FORMS,
    PeriodicOrbit: (*NORMAL_FORMS, "HB"),
}


@singledispatch
def _form_at(solution: Any, point: Critical) -> NormalForm | EquilibriumNormalForm:
    """Return the normal form at a point of a type that has one; a kind of solution registers what it knows."""
    raise InputError("type", point.type, "that of a point with a normal form", "none is known of this kind of solution")


@_form_at.register(Equilibrium)
def _(solution: Equilibrium, point: Critical) -> EquilibriumNormalForm:
    if (count := solution.multiplicity(point.type, point.varied)) > 1:
        hint = f"{count} are critical at once; switch_branch(point, which=...) gives the branches"
        raise InputError("point", point.label, "critical in one direction", hint)
    u = np.append(solution.state, [solution.parameters[name] for name in point.varied])
    return equilibrium_form(solution.problem(*point.varied), u, point.type, point.scale)


@_form_at.register(MapOrbit)
def _(solution: MapOrbit, point: Critical) -> NormalForm:
    several = _several(solution, point)
    return NormalForm(point.type, *map_normal_form(solution, point.type)) if several is None else several


@_form_at.register(PeriodicOrbit)
def _(solution: PeriodicOrbit, point: Critical) -> NormalForm | EquilibriumNormalForm:
    if point.type == "HB":
        return _of_birth(solution, point)
    several = _several(solution, point)
    return normal_form(solution, point.type) if several is None else several


def _of_birth(solution: PeriodicOrbit, point: Critical) -> NormalForm | EquilibriumNormalForm:
    """Return the normal form of the Hopf point at which a branch of cycles begins or ends."""
    low, high = solution.extremes
    mode = solution.signature[0][0]
    rest = find_equilibrium(solution.system, solution.parameters, 0.5 * (low + high), mode=mode)
    return _form_at(rest, point._replace(scale=None))


def _several(solution: MapOrbit | PeriodicOrbit, point: Critical) -> NormalForm | None:
    """Return a form without coefficients where several multipliers are critical at once, as in a conservative map."""
    count = solution.multiplicity(point.type, point.varied)
    return NormalForm(point.type, math.nan, math.nan, count) if count > 1 and point.type in NORMAL_FORMS else None

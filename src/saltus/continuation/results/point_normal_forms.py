"""Normal forms at special points, by the kind of solution."""

from __future__ import annotations

import math
from functools import singledispatch
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.equilibria import Equilibrium
from saltus.equilibria.normal_forms import EquilibriumNormalForm, normal_form as equilibrium_form
from saltus.errors import InputError
from saltus.maps import MapOrbit
from saltus.maps.normal_forms import map_normal_form
from saltus.orbits import PeriodicOrbit
from saltus.orbits.normal_forms import NORMAL_FORMS, NormalForm, normal_form

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Critical", "normal_form_at"]


class Critical(NamedTuple):
    """What a normal form takes from a special point: its type, label, varied parameters and sizes of the unknowns."""

    type: str
    label: str
    varied: tuple[str, ...]
    scale: NDArray[np.float64] | None


@singledispatch
def normal_form_at(solution: Any, point: Critical) -> NormalForm | EquilibriumNormalForm:
    """Return the normal form at a special point; a kind of solution registers what it knows.

    Parameters
    ----------
    solution : Solution
        The solution at the point.
    point : Critical
        The point.

    Raises
    ------
    InputError
        No normal form belongs to the type.
    """
    raise InputError("type", point.type, "that of a point with a normal form", "none is known of this kind of solution")


@normal_form_at.register(Equilibrium)
def _(solution: Equilibrium, point: Critical) -> EquilibriumNormalForm:
    if (count := solution.multiplicity(point.type, point.varied)) > 1:
        hint = f"{count} are critical at once; switch_branch(point, which=...) gives the branches"
        raise InputError("point", point.label, "critical in one direction", hint)
    u = np.append(solution.state, [solution.parameters[name] for name in point.varied])
    return equilibrium_form(solution.problem(*point.varied), u, point.type, point.scale)


@normal_form_at.register(MapOrbit)
def _(solution: MapOrbit, point: Critical) -> NormalForm:
    several = _several(solution, point)
    return NormalForm(point.type, *map_normal_form(solution, point.type)) if several is None else several


@normal_form_at.register(PeriodicOrbit)
def _(solution: PeriodicOrbit, point: Critical) -> NormalForm:
    if point.type not in NORMAL_FORMS:
        raise InputError("type", point.type, f"one of {', '.join(NORMAL_FORMS)}", "no normal form belongs to it")
    several = _several(solution, point)
    return normal_form(solution, point.type) if several is None else several


def _several(solution: MapOrbit | PeriodicOrbit, point: Critical) -> NormalForm | None:
    """Return a form without coefficients where several multipliers are critical at once, as in a conservative map."""
    count = solution.multiplicity(point.type, point.varied)
    return NormalForm(point.type, math.nan, math.nan, count) if count > 1 and point.type in NORMAL_FORMS else None

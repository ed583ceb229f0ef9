"""Steps of a session: each is a call of the package with its arguments, can be kept as JSON and told as Python."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from saltus.errors import InputError
from saltus.explorer.steps.base import Place, Step, taken
from saltus.explorer.steps.curves import Cascade, Continue, Follow, Switch
from saltus.explorer.steps.searches import FindEquilibrium, FindOrbit, Iterate, Move, SolveOrbit
from saltus.explorer.steps.surveys import Attract, Basin, Sweep

__all__ = [
    "Attract",
    "Basin",
    "Cascade",
    "Continue",
    "FindEquilibrium",
    "FindOrbit",
    "Follow",
    "Iterate",
    "Move",
    "Place",
    "SolveOrbit",
    "Step",
    "Sweep",
    "Switch",
    "step_from",
    "taken",
]

_STEPS: TypeAdapter[Any] = TypeAdapter(
    Annotated[
        FindOrbit
        | FindEquilibrium
        | SolveOrbit
        | Continue
        | Switch
        | Follow
        | Cascade
        | Sweep
        | Move
        | Iterate
        | Attract
        | Basin,
        Field(discriminator="kind"),
    ]
)


def step_from(plain: Any) -> Step:
    """Return the step that plain data describe.

    Raises
    ------
    InputError
        The data describe no step.

    Examples
    --------
    >>> step_from({"kind": "find_orbit", "parameters": {"w": 1.0}, "x0": [0.0, 0.0]}).text()
    "saltus.find_orbit(system, {'w': 1.0}, x0=[0.0, 0.0])"
    """
    try:
        found: Step = _STEPS.validate_python(plain)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(f"step's {place}" if place else "step", first.get("input"), first["msg"]) from None
    return found

"""The formulas of a law of force, region by region, and where one region gives way to another.

A formula is a text in the law's parameters, its own states, ``R_nm`` and these names:

================  ====================================================================================================
``D_nm``          gap between tip and sample, negative where the tip indents
``V_nm_us``       its rate
``separation_nm`` distance between the two surfaces: the gap or, in contact, what the law of contact says
``contact_nm``    gap at which the law of contact begins
``release_nm``    gap at which it ends, as the level of a crossing only
================  ====================================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from saltus.errors import InputError

__all__ = ["Crossing", "Part", "Region"]


@dataclass(frozen=True)
class Region:
    """The formulas of a law between two crossings.

    Parameters
    ----------
    force : str, optional
        Force on the tip in nN, positive where it repels.
    elastic : str, optional
        Its part that depends on the gap and not on the gap's rate. By default `force` at rate 0.
    states : mapping of str to str, optional
        Rates of the law's own states, the same ones in every region of the law.
    impulse : str, optional
        Time integral of a further force, in nN us, as a function of the gap. A force ``c(D) V`` is given so where c has
        a root at the surface: momentum without this impulse is smoother. It must vanish where the region ends.
    impulse_force : str, optional
        The force whose integral `impulse` is.
    separation : str, optional
        What other laws see as ``separation_nm``, by default the gap.
    indentation : str, optional
        Depth of indentation, in nm; given in contact and only there.
    domain : str, optional
        Positive where `force` has a meaning.

    Examples
    --------
    >>> Region("-H_aJ*R_nm/(6*separation_nm**2)", domain="D_nm").elastic
    """

    force: str = "0"
    elastic: str | None = None
    states: Mapping[str, str] = field(default_factory=dict)
    impulse: str = "0"
    impulse_force: str = "0"
    separation: str = ""
    indentation: str = ""
    domain: str = ""


@dataclass(frozen=True)
class Crossing:
    """Where a region of a law gives way to another.

    Parameters
    ----------
    source, target : str
        Regions.
    level : str
        Gap at which it happens, in nm: a formula in parameters and the law's own states.
    direction : {-1, 1}
        Whether the gap falls or rises through the level.
    name : str
        What happens, as "touch".

    Raises
    ------
    InputError
        The direction is another.

    Examples
    --------
    >>> Crossing("far", "contact", "a0_nm", -1, "touch").level
    'a0_nm'
    """

    source: str
    target: str
    level: str
    direction: int
    name: str

    def __post_init__(self) -> None:
        if self.direction not in (-1, 1):
            raise InputError("direction of a crossing", self.direction, "-1 (the gap falls) or 1 (it rises)")


class Part(Protocol):
    """What is asked of a law that is to be added to others; `saltus.afm.Law` has it."""

    positive: ClassVar[tuple[str, ...]]
    contact: ClassVar[str]
    own: ClassVar[tuple[str, ...]]

    @property
    def regions(self) -> dict[str, Region]:
        """Formulas of each region, the farthest first."""

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where regions end."""

    @property
    def parameters(self) -> dict[str, float]:
        """Names and values of the parameters that are given."""

"""Axes that follow the results: what a diagram shows when a branch, a locus or a sweep comes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

from saltus.continuation.results.branch import Branch
from saltus.continuation.results.curve import SolutionCurve
from saltus.errors import SaltusError
from saltus.explorer.drawing import default_axes, drawn
from saltus.plotting.ordinates import instead_of_held
from saltus.sweeps import Sweep

if TYPE_CHECKING:
    from saltus.system import HybridSystem, Map

__all__ = ["followed_axes", "told_where_fixed", "varied_of"]


def varied_of(result: Any) -> tuple[str, ...]:
    """Return the parameters that vary along a branch, a locus or a sweep; empty for other results."""
    if isinstance(result, Sweep):
        return (result.parameter,)
    return result.varied if isinstance(result, SolutionCurve) else ()


def followed_axes(
    result: Any, axes: tuple[str, str], fixed: Collection[str], system: HybridSystem | Map
) -> tuple[str, str]:
    """Return the axes on which a result is seen: its own parameters, and what was shown upwards before.

    What a wall or a reset holds along the whole branch gives way to what varies.

    Parameters
    ----------
    result : Result
        What has come.
    axes : (str, str)
        Abscissa and ordinate up to now.
    fixed : collection of {"x", "y"}
        Axes that the user has chosen: they stay.
    system : HybridSystem
        The system.

    Examples
    --------
    >>> from saltus import HybridSystem, continue_equilibrium, find_equilibrium
    >>> system = HybridSystem.smooth({"x": "a - x + b"}, {"a": 1.0, "b": 0.0})
    >>> branch = continue_equilibrium(find_equilibrium(system, x0=[1.0]), "b", (0.0, 1.0))
    >>> followed_axes(branch, ("a", "max_x"), (), system), followed_axes(branch, ("a", "max_x"), ("x",), system)
    (('b', 'max_x'), ('a', 'max_x'))
    """
    varied = varied_of(result)
    if not varied:
        return axes
    x = axes[0] if "x" in fixed else varied[0]
    if "y" in fixed:
        return x, axes[1]
    if len(varied) == 2:
        return x, next(name for name in (*reversed(varied), varied[0]) if name != x)
    kept = () if axes[1] in system.parameter_names else (axes[1],)
    upwards = (*kept, default_axes(system, varied[0])[1], system.states[0])
    y = next((y for y in upwards if _can_be_drawn(result, (x, y))), upwards[0])
    return x, instead_of_held(result, y) if isinstance(result, Branch) else y


def told_where_fixed(result: Any, axes: tuple[str, str], fixed: Collection[str]) -> str:
    """Return what to say of a result that fixed axes do not show along its parameter; empty where they do."""
    if "x" not in fixed or axes[0] in (varied := varied_of(result)) or not varied:
        return ""
    along = " and ".join(varied)
    return f"this result goes along {along}, and the axis to the right is fixed at {axes[0]}: empty it to let it follow"


def _can_be_drawn(result: Any, axes: Sequence[str]) -> bool:
    try:
        drawn(result, axes)
    except SaltusError:
        return False
    return True

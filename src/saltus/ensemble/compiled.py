"""The steps of many motions at once, compiled for one system."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.ensemble.labels import ADDRESSED, NL, Lanes, Scratch
from saltus.errors import NotAnalyticError
from saltus.system.compiled import SERIES_TEXT
from saltus.system.generated import Kind, module_of
from saltus.system.numba_tools.calling import callable_at, with_constants

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.definition import Definition
    from saltus.system.derivatives import Symbolic
    from saltus.system.writing.writer import Writer

__all__ = ["LANES", "OWN_LANES", "CompiledLanes", "load_lanes", "load_own_lanes"]


class CompiledLanes:
    """Steps of many motions at once, compiled for one system.

    Attributes
    ----------
    module : module
        The generated module, from which a graphics card's kernels take the same functions.
    quantities : tuple of str
        Names of the numbers besides parameters that the functions read; see `Lanes.q`.
    own : tuple of str
        Names of the numbers that a lane has of its own: ``p[i]`` for a parameter or a constant, and others.
    """

    def __init__(self, module: Any) -> None:
        self.module = module
        self.quantities: tuple[str, ...] = module.QUANTITIES
        self.own: tuple[str, ...] = module.OWN
        self._n_constants = int(module.CONSTANTS)
        names = (*ADDRESSED, *(f"step_{k}" for k in range(module.POOLS)))
        self._functions = np.array([getattr(module, f"{name}_at").address for name in names])
        self._derive: Any = callable_at(module.derive)

    def constants(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters with the constants of these functions behind them."""
        return with_constants(self._derive, p, self._n_constants)

    def with_numbers(self, p: NDArray[np.float64], q: NDArray[np.float64]) -> Lanes:
        """Return what the loop over lanes reads of the system, with parameters and constants, and other numbers."""
        return Lanes(self._functions, np.array(self.module.MODE_OF), p, q)

    def scratch(self, motions: int) -> Scratch:
        """Return the arrays that one call of `run` works in, for at most `motions` motions."""
        m = self.module
        pools = np.ones((m.POOLS + 1, m.NF * NL)), np.zeros((m.POOLS, NL), np.int64), np.zeros(m.POOLS, np.int64)
        return Scratch(*pools, np.zeros(motions, np.int64), np.empty(m.N))


def _writer(symbolic: Symbolic, order: int, exact: list[tuple[int, int]], _: tuple[str, ...]) -> Writer:
    from saltus.ensemble.writer import LaneWriter

    return LaneWriter(symbolic, order, dict(exact))


def _own_writer(symbolic: Symbolic, order: int, _: tuple[str, ...]) -> Writer:
    from saltus.ensemble.writer import LaneWriter

    return LaneWriter(symbolic, order, {}, own=True)


def _growth_writer(symbolic: Symbolic, order: int, columns: int, _: tuple[str, ...]) -> Writer:
    from saltus.ensemble.tangents import with_tangents
    from saltus.ensemble.writer import LaneWriter

    return LaneWriter(with_tangents(symbolic, columns), order, {}, own=True)


# Modules from which the text of lanes comes, besides those of series.
_TEXT = ("exact_step", "labels", "lane_kinds", "lane_text", "taylor_step", "writer")
_OF_SYSTEMS = ("scales.doubles", "system.faces", "system.once", "system.own_states", "system.writing.rounding")
_SOURCES = (*SERIES_TEXT, *_OF_SYSTEMS, *(f"ensemble.{name}" for name in _TEXT))
LANES = Kind("lanes", _writer, _SOURCES)
OWN_LANES = Kind("lanes with parameters of their own", _own_writer, _SOURCES)
GROWTH_LANES = Kind("lanes with perturbations", _growth_writer, (*_SOURCES, "ensemble.tangents"))


def load_lanes(system: Definition, order: int, exact: dict[int, int]) -> CompiledLanes | None:
    """Return the steps of many motions at once; None where the definition has no series.

    Parameters
    ----------
    order : int
        Last coefficient of the Taylor series.
    exact : dict of int to int
        Modes with steps by the exact flow, and the pairs of complex eigenvalues of their linear parts.
    """
    try:
        return CompiledLanes(module_of(LANES, system, order, sorted(exact.items()), system.positive))
    except NotAnalyticError:
        return None


def load_own_lanes(system: Definition, order: int, columns: int = 0) -> CompiledLanes | None:
    """Return steps of many motions, each with parameters of its own; None where the definition has no series.

    Parameters
    ----------
    order : int
        Last coefficient of the Taylor series.
    columns : int, optional
        Perturbations that each motion carries.
    """
    try:
        if columns:
            return CompiledLanes(module_of(GROWTH_LANES, system, order, columns, system.positive))
        return CompiledLanes(module_of(OWN_LANES, system, order, system.positive))
    except NotAnalyticError:
        return None

"""Growth of small perturbations along a motion of a map: products of the pieces' derivatives, and QR."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.flow.variational import ROWS, Average, Growth, grown
from saltus.maps.code import LIMIT, STRETCH, code_of, error_of
from saltus.result import frozen

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from saltus.system.maps import Map

__all__ = ["growth_of_map"]


def growth_of_map(
    system: Map, p: NDArray[np.float64], x: ArrayLike, *, average: Average, exponents: int | None = None,
    interrupted: Sequence[float] = (),
) -> Growth:  # fmt: skip
    """Return the growth of perturbations along a motion of a map, from which its Lyapunov exponents follow.

    At each state the derivative of its own piece carries a frame on, orthonormal in units of the states' sizes. A
    border needs no further matrix: the pieces on its two sides have their own derivatives, and a motion is on it with
    probability 0.

    Parameters
    ----------
    p : ndarray, shape (parameters,)
        `Map.parameter_vector`.
    x : array_like, shape (states,)
        Start, best on the attractor.
    average : Average
        How many iterations are measured, as its `periods`.
    exponents : int, optional
        How many, the largest; by default as many as there are states.
    interrupted : sequence of float, optional
        As of `saltus.flow.variational.growth_along`.

    Returns
    -------
    Growth
        With times that count iterations.

    Raises
    ------
    InputError
        An average over a time, or more exponents than states.
    DefinitionError
        A state is met at which no piece holds, or several do.
    MapDivergenceError
        The motion leaves every bound.

    References
    ----------
    As `saltus.flow.variational.growth_along`.
    """
    from saltus.maps.kernels import steps as kernels  # with Numba, which takes its time

    if average.periods is None:
        raise InputError("Average.t_end", average.t_end, "left out for a map", "periods counts its iterations")
    n, periods = len(system.states), average.periods
    columns = n if exponents is None else checks.count("exponents", exponents, 1, n, "the number of states")
    first = periods // 2 if average.discard is None else int(average.discard)
    ends = first + np.round(np.linspace(0, periods, min(ROWS, periods) + 1)).astype(np.int64)
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((n, columns)))[0].ravel()
    logs, at = np.zeros((ends.size, columns)), np.array(system.full_state(x))
    work, places, code = np.empty((2, n * (1 + columns))), np.zeros(2, np.int64), code_of(system, p)
    frame = np.ascontiguousarray(frame)
    units = np.stack([np.full(n, math.inf), np.zeros(n), np.ones(n), np.ones(n)])
    units[0, system.angle_places] = math.pi
    status = kernels.AGAIN
    while status == kernels.AGAIN and not interrupted:
        status = kernels.growth(at, frame, units, work, code, LIMIT, ends, logs, places, STRETCH)
    if status not in (kernels.DONE, kernels.AGAIN):
        raise error_of(status, int(places[1]), at, system, p)
    measured = grown(ends[: places[0]].astype(np.float64), logs[: places[0]])
    return Growth(*measured, frozen(at), system.piece_index(at, p), 0, float(ends[0]))

"""Chains of blocks of two states, mixed by a rotation: maps and fields whose special points at the origin are known."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import brentq

import saltus

__all__ = ["chain_of_a_field", "chain_of_a_map", "unlike"]

Known = list[tuple[float, str]]
BLOCKS = (1, 2, 2, 3, 3, 4, 5, 6)
END, EDGE = 3.0, 1e-3  # of the parameter's interval


def _zeros(f: Callable[[float], float]) -> list[float]:
    grid = np.linspace(0.0, END, 20001).tolist()
    signs = np.sign([f(p) for p in grid])
    return [brentq(f, grid[i], grid[i + 1], xtol=1e-14) for i in np.nonzero(signs[1:] != signs[:-1])[0]]


def _mixed(rng: np.random.Generator, blocks: int) -> tuple[list[str], list[list[float]], list[str]]:
    """Return names of the states, an orthogonal matrix, and the blocks' states as sums of those."""
    names = [f"x{k}" for k in range(2 * blocks)]
    Q = np.linalg.qr(rng.normal(size=(2 * blocks, 2 * blocks)))[0].tolist()
    return names, Q, ["(" + " + ".join(f"({q})*{name}" for q, name in zip(row, names, strict=True)) + ")" for row in Q]


def _equations(names: list[str], Q: list[list[float]], images: list[str]) -> dict[str, str]:
    columns = zip(*Q, strict=True)
    return {
        name: " + ".join(f"({q})*{image}" for q, image in zip(column, images, strict=True))
        for name, column in zip(names, columns, strict=True)
    }


def _sorted(points: Known) -> Known:
    return sorted(point for point in points if EDGE < point[0] < END - EDGE)


def chain_of_a_map(seed: int) -> tuple[saltus.Map, Known]:
    """Return a map with a parameter p, and the points at which multipliers of its fixed point 0 are critical.

    Each block has a trace T and a determinant D: BP where 1 - T + D vanishes, PD where 1 + T + D does, TR where D is 1.
    """
    rng = np.random.default_rng(seed)
    names, Q, states = _mixed(rng, BLOCKS[seed % len(BLOCKS)])
    images: list[str] = []
    points: Known = []
    for X, Y in zip(states[::2], states[1::2], strict=True):
        rate, b, slow, other = rng.uniform(1, 9), rng.uniform(0, 6), rng.uniform(1, 5), rng.uniform(0, 6)
        size, d, swing = rng.uniform(0.9, 1.15), rng.uniform(0.5, 0.95), max(0.0, rng.uniform(-0.3, 0.3))
        large = 2.0 * math.sqrt(d) * size

        def D(p: float, d: float = d, swing: float = swing, slow: float = slow, other: float = other) -> float:
            return d + swing * math.cos(slow * p + other)

        def T(p: float, large: float = large, rate: float = rate, b: float = b) -> float:
            return large * math.cos(rate * p + b)

        trace = f"{large}*cos({rate}*p + {b})"
        images += [Y, f"(-({d} + {swing}*cos({slow}*p + {other}))*{X} + {trace}*{Y} - {Y}**3)"]
        points += [(p, "BP") for p in _zeros(lambda p, T=T, D=D: 1.0 - T(p) + D(p))]  # type: ignore[misc]
        points += [(p, "PD") for p in _zeros(lambda p, T=T, D=D: 1.0 + T(p) + D(p))]  # type: ignore[misc]
        points += [(p, "TR") for p in _zeros(lambda p, D=D: D(p) - 1.0) if abs(T(p)) < 2.0]  # type: ignore[misc]
    return saltus.Map(tuple(names), {"p": 0.0}, _equations(names, Q, images)), _sorted(points)


def chain_of_a_field(seed: int) -> tuple[saltus.HybridSystem, Known]:
    """Return a field with a parameter p, and the points at which eigenvalues of its equilibrium 0 are critical.

    Each block is an oscillator: BP where its stiffness vanishes, HB where its damping does.
    """
    rng = np.random.default_rng(seed)
    names, Q, states = _mixed(rng, BLOCKS[seed % len(BLOCKS)])
    rates: list[str] = []
    points: Known = []
    for X, Y in zip(states[::2], states[1::2], strict=True):
        rate, b, slow, other = rng.uniform(1, 9), rng.uniform(0, 6), rng.uniform(1, 5), rng.uniform(0, 6)
        c, a, k, swing = rng.uniform(0.85, 1.02), rng.uniform(0.2, 1.5), rng.uniform(-0.5, 1.5), rng.uniform(0.5, 2.0)

        def stiffness(p: float, k: float = k, swing: float = swing, slow: float = slow, other: float = other) -> float:
            return k + swing * math.cos(slow * p + other)

        force = f"-({k} + {swing}*cos({slow}*p + {other}))*{X}"
        rates += [Y, f"({force} + {2.0 * a}*(cos({rate}*p + {b}) - {c})*{Y} - {Y}**3 - {X}**3)"]
        points += [(p, "BP") for p in _zeros(stiffness)]
        turning = _zeros(lambda p, rate=rate, b=b, c=c: math.cos(rate * p + b) - c)  # type: ignore[misc]
        points += [(p, "HB") for p in turning if stiffness(p) > 0.0]
    return saltus.HybridSystem(tuple(names), {"p": 0.0}, {"m": saltus.Mode(_equations(names, Q, rates))}), _sorted(
        points
    )


def unlike(branch: Any, known: Known) -> tuple[Known, Known]:
    """Return which points a branch lacks, and which it has besides."""
    found = _sorted([(float(point.parameters["p"]), point.type) for point in branch.special_points])

    def among(point: tuple[float, str], others: Known) -> bool:
        return any(kind == point[1] and abs(p - point[0]) < 1e-6 for p, kind in others)

    lacking = [point for point in known if not among(point, found)]
    return lacking, [point for point in found if not among(point, known)]

"""Means of a law's force over two independent phases, with derivatives: the tip moves by two cosines over the sample.

The gap is ``D = c + A1 cos(phi1) + A2 cos(phi2)``. With ``psi = pi - phi`` and ``u = sin(psi/2)**2`` it is
``c - A1 - A2 + 2 A1 u1 + 2 A2 u2``. A layer that acts below a level is integrated over ``sin(psi/2) = s sin(alpha)``,
where s is the value at the level. The depth is then ``h cos(alpha)**2``, and roots of it are smooth. Above the level,
``cos(psi/2) = sqrt(1 - s**2) cos(gamma)``. Gauss-Legendre nodes in these angles converge geometrically.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.afm.bimodal.layers import Layers, Values

__all__ = ["FINE", "MOMENTS", "ROUGH", "STANDARD", "Motion", "Nodes", "averages"]

Floats = NDArray[np.float64]

MOMENTS = 5  # <F>, <F cos phi1>, <F cos phi2>, <gamma sin(phi1)**2>, <gamma sin(phi2)**2>
_CHUNK = 30_000  # nodes that are held at once


class Nodes(NamedTuple):
    """How many nodes there are in each angle."""

    contact: int
    outer: int
    far: int


ROUGH = Nodes(6, 6, 12)
STANDARD = Nodes(12, 14, 24)
FINE = Nodes(20, 28, 40)


class Motion(NamedTuple):
    """Mean gap and amplitudes in nm, each of shape (pixel,)."""

    c: Floats
    A1: Floats
    A2: Floats


def averages(layers: Layers, motion: Motion, p: Values, nodes: Nodes = STANDARD) -> Floats:
    """Return the means of `MOMENTS` with their derivatives along c, A1, A2 and the parameters.

    Returns
    -------
    ndarray, shape (5, 4 + parameter, pixel)
    """
    total = len(motion.c)
    out = np.empty((MOMENTS, 4 + len(layers.names), total))
    size = max(1, _CHUNK // (nodes.outer * (nodes.contact + nodes.far)))
    swapped = motion.A2 > motion.A1  # the larger amplitude is integrated over first
    for swap in (False, True):
        mine = np.flatnonzero(swapped == swap)
        for some in (mine[i : i + size] for i in range(0, len(mine), size)):
            c, A1, A2 = (one[some] for one in motion)
            own = {name: np.broadcast_to(p[name], total)[some] for name in layers.names}
            found = _Sums(layers, Motion(c, A2, A1) if swap else Motion(c, A1, A2), own, nodes).total()
            if swap:
                found = found[[0, 2, 1, 4, 3]]
                found[:, [2, 3]] = found[:, [3, 2]]
            out[:, :, some] = found
    return out


class _Sums:
    """The sums over nodes of some pixels."""

    def __init__(self, layers: Layers, motion: Motion, p: Values, nodes: Nodes) -> None:
        self.layers, self.motion, self.p, self.nodes = layers, motion, p, nodes
        self.low = motion.c - motion.A1 - motion.A2
        self.out = np.zeros((len(motion.c), MOMENTS, 4 + len(layers.names)))

    def total(self) -> Floats:
        depth = np.full(len(self.low), -1.0)
        for i in range(len(self.layers.levels)):
            level, *along = self.layers.level(i, self.p)
            below = level - self.low
            self.contact(i, level, below, np.array(along))
            depth = below if i == 0 else depth
        if not self.layers.empty[0]:
            self.above(depth)
        return self.out.transpose(1, 2, 0)

    def contact(self, i: int, level: Floats, below: Floats, along: Floats) -> None:
        """Add what layer i + 1 contributes below its level, and what moves with the level."""
        some = np.flatnonzero(below > 0.0)
        if not len(some) or (self.layers.empty[i + 1] and (i or self.layers.empty[0])):
            return
        u2, rate2, h = self.outer(some, below)
        A1 = self.motion.A1[some][:, None]
        alpha, weight = _gauss(self.nodes.contact)
        q, s2 = np.minimum(1.0, 2.0 * A1 / h), np.minimum(1.0, h / (2.0 * A1))
        sin2 = np.sin(alpha) ** 2
        u1 = s2[..., None] * sin2
        rate1 = 2.0 * np.sqrt(s2)[..., None] * np.cos(alpha) / np.sqrt(1.0 - u1) * weight
        depth = h[..., None] * (1.0 - q[..., None] * sin2)
        self.add(i + 1, some, level[some][:, None, None] - depth, u1, u2[..., None], rate1 * rate2[..., None])
        self.edge(i, some, level[some], along[:, some], (s2, u2, rate2, h < 2.0 * A1))

    def outer(self, some: NDArray[np.intp], below: Floats) -> tuple[Floats, Floats, Floats]:
        """Nodes of the second phase where the tip comes below a level: u2, weight, depth reached there."""
        A2, h2 = self.motion.A2[some][:, None], below[some][:, None]
        beta, weight = _gauss(self.nodes.outer)
        s2, sin2 = np.minimum(1.0, h2 / (2.0 * A2)), np.sin(beta) ** 2
        u2 = s2 * sin2
        rate = 2.0 * np.sqrt(s2) * np.cos(beta) / np.sqrt(1.0 - u2) * weight
        return u2, rate, h2 * (1.0 - np.minimum(1.0, 2.0 * A2 / h2) * sin2)

    def above(self, depth: Floats) -> None:
        """Add what layer 0 contributes above the first level."""
        t, weight = _gauss(self.nodes.far)
        # nodes are denser near the sample, where the force is greatest
        gamma, weight = np.pi / 2 * (t / (np.pi / 2)) ** 2, weight * 2.0 * t / (np.pi / 2)
        sin2 = np.sin(gamma) ** 2
        touching = np.flatnonzero(depth > 0.0)
        if len(touching):
            u2, rate2, h = self.outer(touching, depth)
            A1 = self.motion.A1[touching][:, None, None]
            rest = np.maximum(0.0, 1.0 - h[..., None] / (2.0 * A1))
            u1 = 1.0 - rest * np.cos(gamma) ** 2
            rate1 = 2.0 * np.sqrt(rest) * np.sin(gamma) / np.sqrt(u1) * weight
            level = (self.low + depth)[touching][:, None, None]
            D = level + 2.0 * A1 * rest * sin2
            self.add(0, touching, D, u1, u2[..., None], rate1 * rate2[..., None])
        apart = np.flatnonzero(depth < 2.0 * self.motion.A2)
        if len(apart):
            A1, A2 = self.motion.A1[apart][:, None, None], self.motion.A2[apart][:, None]
            s2 = np.maximum(0.0, depth[apart][:, None] / (2.0 * A2))
            beta, dense = _gauss(self.nodes.outer)
            beta, dense = np.pi / 2 * (beta / (np.pi / 2)) ** 2, dense * 2.0 * beta / (np.pi / 2)
            u2 = s2 + (1.0 - s2) * np.sin(beta) ** 2
            rate2 = 2.0 * np.sqrt(1.0 - s2) * np.sin(beta) / np.sqrt(u2) * dense
            D = self.low[apart][:, None, None] + 2.0 * A1 * sin2 + 2.0 * (A2 * u2)[..., None]
            self.add(0, apart, D, sin2[None, None, :], u2[..., None], 2.0 * weight * rate2[..., None])

    def add(self, i: int, some: NDArray[np.intp], D: Floats, u1: Floats, u2: Floats, weight: Floats) -> None:
        """Add a layer's sums over nodes, shape (pixel, outer, inner)."""
        n, p = len(some), {name: value[some][:, None, None] for name, value in self.p.items()}
        values = self.layers.layer(i, D, p)
        moved = [np.ones_like(D), np.broadcast_to(2.0 * u1 - 1.0, D.shape), np.broadcast_to(2.0 * u2 - 1.0, D.shape)]
        shares = _shares(u1, u2)
        for part, places in ((0, slice(0, 3)), (1, slice(3, 5))):
            if not values[part].any():
                continue
            force, slope, *along = values[part]
            columns = np.stack([force, *(slope * one for one in moved), *along])
            with np.errstate(invalid="ignore"):
                factors = np.stack([np.broadcast_to(one * weight / np.pi**2, D.shape) for one in shares[places]])
            left = factors.reshape(len(factors), n, -1).transpose(1, 0, 2)
            right = columns.reshape(len(columns), n, -1).transpose(1, 2, 0)
            self.out[some, places] += left @ right

    def edge(self, i: int, some: NDArray[np.intp], level: Floats, along: Floats, crossing: tuple[Any, ...]) -> None:
        """Add what a jump of the force at a level contributes to the derivatives, as the level moves."""
        s2, u2, rate2, passes = crossing
        n, p = len(some), {name: value[some] for name, value in self.p.items()}
        jump = self.layers.layer(i + 1, level, p)[:, 0]
        if i == 0:
            jump = jump - self.layers.layer(0, level, p)[:, 0]
        scale = np.abs(self.layers.layer(0, level, p)[:, 0]) + np.abs(jump)
        jump = np.where(np.abs(jump) > 1e-12 * scale, jump, 0.0)
        if not jump.any():
            return
        with np.errstate(divide="ignore", invalid="ignore"):
            sine = 2.0 * np.sqrt(s2 * (1.0 - s2))
            weight = np.where(passes, rate2 / (self.motion.A1[some][:, None] * sine), 0.0) / np.pi**2
        moved = [np.broadcast_to(-one, s2.shape) for one in (np.ones_like(s2), 2.0 * s2 - 1.0, 2.0 * u2 - 1.0)]
        columns = np.stack([*moved, *(np.broadcast_to(one[:, None], s2.shape) for one in along)])
        for place, share in enumerate(_shares(s2, u2)):
            force = jump[0 if place < 3 else 1]
            self.out[some, place, 1:] += np.einsum("n,no,kno->nk", force, share * weight, columns).reshape(n, -1)


def _shares(u1: Floats, u2: Floats) -> list[Floats]:
    """What force or damping is multiplied with in each mean."""
    return [
        np.ones(np.broadcast_shapes(u1.shape, u2.shape)),
        2.0 * u1 - 1.0,
        2.0 * u2 - 1.0,
        4.0 * u1 * (1.0 - u1),
        4.0 * u2 * (1.0 - u2),
    ]


@lru_cache(maxsize=16)
def _gauss(count: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights from 0 to pi/2."""
    roots, weights = np.polynomial.legendre.leggauss(count)
    return np.pi / 4 * (roots + 1.0), np.pi / 4 * weights

"""Means of a law's force over independent phases, with derivatives: the tip moves by two or three cosines.

The gap is ``D = c + A1 cos(phi1) + A2 cos(phi2)``. With ``psi = pi - phi`` and ``u = sin(psi/2)**2`` it is
``c - A1 - A2 + 2 A1 u1 + 2 A2 u2``. A layer that acts below a level is integrated over ``sin(psi/2) = s sin(alpha)``,
where s is the value at the level. The depth is then ``h cos(alpha)**2``, and roots of it are smooth. Above the level,
``cos(psi/2) = sqrt(1 - s**2) cos(gamma)``. Gauss-Legendre nodes in these angles converge geometrically.

A third cosine, of the least amplitude, moves the mean gap of the other two. Their means are smooth in the gap but
where contact begins, and where it begins to last over a turn of one of them. The third angle is cut there, with nodes
that are denser at the cuts.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.afm.bimodal.layers import Function, Layers, Values

__all__ = ["FINE", "ROUGH", "STANDARD", "Motion", "Nodes", "averages"]

Floats = NDArray[np.float64]

_CHUNK = 30_000  # nodes that are held at once
_BLOCK = 1_000  # pixels with three modes that are held at once
_NARROW = 1e-10  # piece of the third angle that is left out


class Nodes(NamedTuple):
    """How many nodes there are in each angle."""

    contact: int
    outer: int
    far: int
    third: int  # in each piece of it


ROUGH = Nodes(6, 6, 12, 5)
STANDARD = Nodes(12, 14, 24, 12)
FINE = Nodes(20, 28, 40, 20)


class Motion(NamedTuple):
    """Mean gap and amplitudes, in nm."""

    c: Floats  # (pixel,)
    A: Floats  # (mode, pixel)


def averages(layers: Layers, motion: Motion, p: Values, nodes: Nodes = STANDARD) -> Floats:
    """Return means with their derivatives along the mean gap, the amplitudes and the parameters.

    Returns
    -------
    ndarray, shape (2, 1 + mode, 2 + mode + parameter, pixel)
        Of the force, its mean and its means times ``cos(phi)`` of each mode. Of the damping, its mean and its means
        times ``sin(phi)**2``. Each stands before its derivatives.
    """
    modes, total = motion.A.shape
    out = np.empty((2, 1 + modes, 2 + modes + len(layers.names), total))
    order = np.argsort(-motion.A, axis=0, kind="stable")  # the larger amplitude is integrated over first
    for one in permutations(range(modes)):
        some = np.flatnonzero((order == np.array(one)[:, None]).all(0))
        if not len(some):
            continue
        own = {name: np.broadcast_to(p[name], total)[some] for name in layers.names}
        sums = _of_two if modes == 2 else _of_three
        found = sums(layers, Motion(motion.c[some], motion.A[list(one)][:, some]), own, nodes)
        whole = found.copy()
        whole[:, [1 + i for i in one]] = found[:, 1:]
        columns = whole[:, :, 2 : 2 + modes].copy()
        whole[:, :, [2 + i for i in one]] = columns
        out[..., some] = whole
    return out


def _of_two(layers: Layers, motion: Motion, p: Values, nodes: Nodes) -> Floats:
    """Means over two phases, the second of the smaller amplitude."""
    total = len(motion.c)
    out = np.empty((2, 3, 4 + len(layers.names), total))
    size = max(1, _CHUNK // (nodes.outer * (nodes.contact + nodes.far)))
    for some in (slice(i, i + size) for i in range(0, total, size)):
        own = {name: value[some] for name, value in p.items()}
        out[..., some] = _Sums(layers, Motion(motion.c[some], motion.A[:, some]), own, nodes).total()
    return out


def _of_three(layers: Layers, motion: Motion, p: Values, nodes: Nodes) -> Floats:
    """Means over three phases, the last of the least amplitude: sums over its nodes of means over the other two."""
    total = len(motion.c)
    out = np.zeros((2, 4, 5 + len(layers.names), total))
    for start in range(0, total, _BLOCK):
        block = slice(start, start + _BLOCK)
        own = {name: value[block] for name, value in p.items()}
        c, A = motion.c[block], motion.A[:, block]
        pixel, angle, weight = _third(layers, Motion(c, A), own, nodes.third)
        if not len(pixel):
            continue
        u = np.sin(angle) ** 2
        cosine = 2.0 * u - 1.0
        moved = Motion(c[pixel] + A[2, pixel] * cosine, A[:2, pixel])
        inner = _of_two(layers, moved, {name: value[pixel] for name, value in own.items()}, nodes)
        last = inner[:, 0] * np.stack([cosine, 4.0 * u * (1.0 - u)])[:, None]
        rows = np.concatenate([inner, last[:, None]], axis=1)
        whole = np.insert(rows, 4, rows[:, :, 1] * cosine, axis=2) * weight
        firsts = np.flatnonzero(np.diff(pixel, prepend=-1))
        out[..., start + pixel[firsts]] = np.add.reduceat(whole, firsts, axis=-1)
    return out


def _third(layers: Layers, motion: Motion, p: Values, count: int) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Nodes of half the third angle from the closest approach: which pixel each is of, angle, weight of the mean."""
    first, second, third = motion.A
    low = motion.c - motion.A.sum(0)
    cuts = [np.zeros_like(low), np.ones_like(low)]
    for level in layers.levels:
        below = layers.place(level, p)[0] - low
        cuts += [(below - lasting) / (2.0 * third) for lasting in (0.0, 2.0 * second, 2.0 * first)]
        cuts.append((below - 2.0 * (first + second)) / (2.0 * third))
    ends = np.sort(np.arcsin(np.sqrt(np.clip(np.array(cuts), 0.0, 1.0))), axis=0)
    width = np.diff(ends, axis=0)
    pixel, piece = np.nonzero(width.T > _NARROW)
    begin, wide = ends[piece, pixel][:, None], width[piece, pixel][:, None]
    roots, weights = np.polynomial.legendre.leggauss(count)
    t = 0.5 * (roots + 1.0)
    cut_below, cut_above = begin > 0.0, begin + wide < np.pi / 2 - _NARROW
    kinds = [cut_below & cut_above, cut_below, cut_above]
    share = np.select(kinds, [t**3 * (10.0 - 15.0 * t + 6.0 * t**2), t**3, 1.0 - (1.0 - t) ** 3], t)
    rate = np.select(kinds, [30.0 * (t * (1.0 - t)) ** 2, 3.0 * t**2, 3.0 * (1.0 - t) ** 2], 1.0)
    weight = wide * rate * weights / np.pi
    return np.repeat(pixel, count), (begin + wide * share).ravel(), weight.ravel()


class _Sums:
    """The sums over nodes of some pixels."""

    def __init__(self, layers: Layers, motion: Motion, p: Values, nodes: Nodes) -> None:
        self.layers, self.p, self.nodes = layers, p, nodes
        self.A1, self.A2 = motion.A
        self.low = motion.c - self.A1 - self.A2
        self.out = np.zeros((len(motion.c), 2, 3, 4 + len(layers.names)))

    def total(self) -> Floats:
        layers = self.layers
        if not layers.levels and layers.above[0]:
            self.above(layers.above[0], np.full(len(self.low), -1.0))
        for place, above, below in zip(layers.levels, layers.above, layers.below, strict=False):
            level, *along = layers.place(place, self.p)
            self.below(below, above, level, np.array(along))
            if above:
                self.above(above, level - self.low)
        return self.out.transpose(1, 2, 3, 0)

    def below(self, term: Function | None, above: Function | None, level: Floats, along: Floats) -> None:
        """Add what a term contributes below its level, and what moves with the level where another acts above it."""
        below = level - self.low
        some = np.flatnonzero(below > 0.0)
        if not len(some) or not (term or above):
            return
        u2, rate2, h = self.outer(some, below)
        A1 = self.A1[some][:, None]
        alpha, weight = _gauss(self.nodes.contact)
        q, s2 = np.minimum(1.0, 2.0 * A1 / h), np.minimum(1.0, h / (2.0 * A1))
        sin2 = np.sin(alpha) ** 2
        u1 = s2[..., None] * sin2
        rate1 = 2.0 * np.sqrt(s2)[..., None] * np.cos(alpha) / np.sqrt(1.0 - u1) * weight
        depth = h[..., None] * (1.0 - q[..., None] * sin2)
        if term:
            self.add(term, some, level[some][:, None, None] - depth, u1, u2[..., None], rate1 * rate2[..., None])
        self.edge((term, above), some, level[some], along[:, some], (s2, u2, rate2, h < 2.0 * A1))

    def outer(self, some: NDArray[np.intp], below: Floats) -> tuple[Floats, Floats, Floats]:
        """Nodes of the second phase where the tip comes below a level: u2, weight, depth reached there."""
        A2, h2 = self.A2[some][:, None], below[some][:, None]
        beta, weight = _gauss(self.nodes.outer)
        s2, sin2 = np.minimum(1.0, h2 / (2.0 * A2)), np.sin(beta) ** 2
        u2 = s2 * sin2
        rate = 2.0 * np.sqrt(s2) * np.cos(beta) / np.sqrt(1.0 - u2) * weight
        return u2, rate, h2 * (1.0 - np.minimum(1.0, 2.0 * A2 / h2) * sin2)

    def above(self, term: Function, depth: Floats) -> None:
        """Add what a term contributes above a level, to which depths reach."""
        t, weight = _gauss(self.nodes.far)
        # nodes are denser near the sample, where the force is greatest
        gamma, weight = np.pi / 2 * (t / (np.pi / 2)) ** 2, weight * 2.0 * t / (np.pi / 2)
        sin2 = np.sin(gamma) ** 2
        touching = np.flatnonzero(depth > 0.0)
        if len(touching):
            u2, rate2, h = self.outer(touching, depth)
            A1 = self.A1[touching][:, None, None]
            rest = np.maximum(0.0, 1.0 - h[..., None] / (2.0 * A1))
            u1 = 1.0 - rest * np.cos(gamma) ** 2
            rate1 = 2.0 * np.sqrt(rest) * np.sin(gamma) / np.sqrt(u1) * weight
            level = (self.low + depth)[touching][:, None, None]
            D = level + 2.0 * A1 * rest * sin2
            self.add(term, touching, D, u1, u2[..., None], rate1 * rate2[..., None])
        apart = np.flatnonzero(depth < 2.0 * self.A2)
        if len(apart):
            A1, A2 = self.A1[apart][:, None, None], self.A2[apart][:, None]
            s2 = np.maximum(0.0, depth[apart][:, None] / (2.0 * A2))
            beta, dense = _gauss(self.nodes.outer)
            beta, dense = np.pi / 2 * (beta / (np.pi / 2)) ** 2, dense * 2.0 * beta / (np.pi / 2)
            u2 = s2 + (1.0 - s2) * np.sin(beta) ** 2
            rate2 = 2.0 * np.sqrt(1.0 - s2) * np.sin(beta) / np.sqrt(u2) * dense
            D = self.low[apart][:, None, None] + 2.0 * A1 * sin2 + 2.0 * (A2 * u2)[..., None]
            self.add(term, apart, D, sin2[None, None, :], u2[..., None], 2.0 * weight * rate2[..., None])

    def add(self, term: Function, some: NDArray[np.intp], D: Floats, u1: Floats, u2: Floats, weight: Floats) -> None:
        """Add a term's sums over nodes, shape (pixel, outer, inner)."""
        n, p = len(some), {name: value[some][:, None, None] for name, value in self.p.items()}
        values = self.layers.values(term, D, p)
        moved = [np.ones_like(D), np.broadcast_to(2.0 * u1 - 1.0, D.shape), np.broadcast_to(2.0 * u2 - 1.0, D.shape)]
        for part, shares in enumerate(_shares(u1, u2)):
            if not values[part].any():
                continue
            force, slope, *along = values[part]
            columns = np.stack([force, *(slope * one for one in moved), *along])
            with np.errstate(invalid="ignore"):
                factors = np.stack([np.broadcast_to(one * weight / np.pi**2, D.shape) for one in shares])
            left = factors.reshape(len(factors), n, -1).transpose(1, 0, 2)
            right = columns.reshape(len(columns), n, -1).transpose(1, 2, 0)
            self.out[some, part] += left @ right

    def edge(
        self,
        terms: tuple[Function | None, Function | None],
        some: NDArray[np.intp],
        level: Floats,
        along: Floats,
        crossing: tuple[Any, ...],
    ) -> None:
        """Add what a jump of the force at a level contributes to the derivatives, as the level moves."""
        s2, u2, rate2, passes = crossing
        n, p = len(some), {name: value[some] for name, value in self.p.items()}
        below, above = (self.layers.values(one, level, p)[:, 0] if one else np.zeros((2, n)) for one in terms)
        jump = below - above
        jump = np.where(np.abs(jump) > 1e-12 * (np.abs(below) + np.abs(above)), jump, 0.0)
        if not jump.any():
            return
        with np.errstate(divide="ignore", invalid="ignore"):
            sine = 2.0 * np.sqrt(s2 * (1.0 - s2))
            weight = np.where(passes, rate2 / (self.A1[some][:, None] * sine), 0.0) / np.pi**2
        moved = [np.broadcast_to(-one, s2.shape) for one in (np.ones_like(s2), 2.0 * s2 - 1.0, 2.0 * u2 - 1.0)]
        columns = np.stack([*moved, *(np.broadcast_to(one[:, None], s2.shape) for one in along)])
        for part, shares in enumerate(_shares(s2, u2)):
            for place, share in enumerate(shares):
                told = np.einsum("n,no,kno->nk", jump[part], share * weight, columns)
                self.out[some, part, place, 1:] += told.reshape(n, -1)


def _shares(u1: Floats, u2: Floats) -> tuple[list[Floats], list[Floats]]:
    """What force and damping are multiplied with in each mean."""
    one = np.ones(np.broadcast_shapes(u1.shape, u2.shape))
    return [one, 2.0 * u1 - 1.0, 2.0 * u2 - 1.0], [one, 4.0 * u1 * (1.0 - u1), 4.0 * u2 * (1.0 - u2)]


@lru_cache(maxsize=16)
def _gauss(count: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights from 0 to pi/2."""
    roots, weights = np.polynomial.legendre.leggauss(count)
    return np.pi / 4 * (roots + 1.0), np.pi / 4 * weights

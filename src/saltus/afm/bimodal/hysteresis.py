"""What hysteresis adds to the means over two phases: a layer that begins at one gap and ends at a larger one.

Between both gaps the force depends on which of them the tip came from, and so on the order of the motion in time. The
phases are ``phi`` of the larger amplitude and ``psi = beta + r phi``, r being the ratio of the rates. A turn of phi is
followed for each beta, from where the tip is farthest. An excursion begins where the tip rises through the gap at which
the layer begins. It ends where the tip falls through it again, or rises through the other one. The mean over beta and
phi is that over both phases.

Excursions come and go at some beta, where the gap turns at one of both levels. With ``x = cos(phi)`` these are roots of
``((L - c - A1 x)/A2)**2 + (A1/(A2 r))**2 (1 - x**2) = 1``. Gauss-Legendre nodes between them converge fast, as nodes on
each excursion do. Derivatives are exact: nodes move with the ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.afm.bimodal.averages import Motion, Nodes
from saltus.afm.bimodal.layers import Layers, Memory, Values

__all__ = ["remembered"]

Floats = NDArray[np.float64]

_BLOCK = 100  # pixels at once
_PIECE = 6  # nodes between two beta, over those of the second phase of a layer
_WHOLE = 12  # the same of all beta where excursions neither come nor go
_LEAST = 8  # places in a turn, at least
_PLACES = 12  # the same in a turn of the faster phase
_STEPS = 60  # of the search for a crossing, at most
_EXACT = 4e-16  # relative step at which it ends
_UP = 0  # kind of a crossing: of the level at which a layer begins, upwards
_DOWN = 1  # the same downwards
_END = 2  # of the level at which it ends, upwards


def remembered(layers: Layers, motion: Motion, omega: Floats, p: Values, nodes: Nodes) -> Floats:
    """Return what memories add to the means of `averages`, with derivatives along the rates as well.

    Parameters
    ----------
    omega : ndarray, shape (2, pixel)
        Angular frequency of each mode, in 1/us.

    Returns
    -------
    ndarray, shape (2, 3, 6 + parameter, pixel)
        As of `averages`, and last the derivatives along both rates. The damping of a mode is what takes as much energy.
        NaN where a turn of the larger amplitude need not lead beyond the gap at which a layer ends.
    """
    with np.errstate(all="ignore"):  # levels at which the gap does not turn have no roots
        return _remembered(layers, motion, omega, p, nodes)


def _remembered(layers: Layers, motion: Motion, omega: Floats, p: Values, nodes: Nodes) -> Floats:
    total, count = len(motion.c), len(layers.names)
    out = np.zeros((2, 3, 6 + count, total))
    swapped = motion.A[1] > motion.A[0]
    ends = _ends(layers, p, total)
    for order in ([0, 1], [1, 0]):
        turn = np.flatnonzero(swapped == (order == [1, 0]))
        for some in (turn[i : i + _BLOCK] for i in range(0, len(turn), _BLOCK)):
            own = {name: np.broadcast_to(p[name], total)[some] for name in layers.names}
            moving = _Moving(motion.c[some], *motion.A[order][:, some], *omega[order][:, some])
            sums = np.zeros((5, 6 + count, len(some)))
            for memory in layers.memories:
                sums += _Excursions(layers, memory, moving, own, nodes).sums()
            columns = [0, 1, *(2 + i for i in order), *range(4, 4 + count), *(4 + count + i for i in order)]
            whole = np.empty_like(sums)
            whole[:, columns] = sums[[0, *(1 + i for i in order), *(3 + i for i in order)]]
            whole[..., ~ends[some]] = math.nan
            out[0][..., some] = whole[:3]
            for i in range(2):
                A, w = motion.A[i, some], omega[i, some]
                damping = whole[3 + i] / (w * A)
                damping[2 + i] -= damping[0] / A
                damping[4 + count + i] -= damping[0] / w
                out[1, 1 + i][..., some] = damping
    return out


def _ends(layers: Layers, p: Values, total: int) -> NDArray[np.bool_]:
    """Return where each layer ends above where it begins, and below where those before it end."""
    ends = [layers.place(level, p)[0] for level in layers.levels]
    begins = list(ends)
    for memory in layers.memories:
        ends[memory.level] = layers.place(memory.end, p)[0]
    good = np.ones(total, dtype=bool)
    for i, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        good &= end >= begin
        if i:
            good &= (end <= ends[i - 1]) & (begin <= begins[i - 1])
    return good


class _Moving(NamedTuple):
    """The motion of some pixels: mean gap, larger and smaller amplitude, their rates; shape (pixel,) each."""

    c: Floats
    a: Floats
    b: Floats
    fast: Floats
    slow: Floats


class _Turns(NamedTuple):
    """Turns of the larger amplitude, shape (turn,), with derivatives in a first axis."""

    pixel: NDArray[np.intp]
    beta: Floats
    moved: Floats  # derivatives of beta, (variable, turn)
    weight: Floats
    heavier: Floats  # derivatives of the weight


class _Excursions:
    """The excursions of some pixels above one level. Variables are mean gap, amplitudes, parameters, and rates."""

    def __init__(self, layers: Layers, memory: Memory, moving: _Moving, p: Values, nodes: Nodes) -> None:
        self.layers, self.memory, self.p, self.nodes = layers, memory, p, nodes
        self.c, self.a, self.b, self.fast, self.slow = moving
        self.ratio = self.slow / self.fast
        count, total = len(layers.names), len(self.c)
        self.variables = 5 + count
        begin, end = layers.place(layers.levels[memory.level], p), layers.place(memory.end, p)
        self.levels = np.broadcast_to(np.array([begin[0], end[0]]), (2, total))
        self.lifted = np.zeros((2, self.variables, total))  # derivatives of the levels
        for lifted, level in zip(self.lifted, (begin, end), strict=True):
            lifted[3 : 3 + count] = np.array(level[1:]).reshape(count, total)
        self.faster = np.zeros((self.variables, total))  # derivatives of the ratio
        self.faster[-2:] = [-self.ratio / self.fast, 1.0 / self.fast]

    def sums(self) -> Floats:
        """Means of the force, and of it times cosine and sine of each phase, shape (5, 1 + variable, pixel)."""
        out = np.zeros((5, 1 + self.variables, len(self.c)))
        reach, far = self.c - self.a - self.b, self.c + self.a + self.b
        idle = (reach >= self.levels[0]) | (far <= self.levels[0])
        clear = self.c + self.a - self.b > self.levels[1]
        out[..., ~(idle | clear)] = math.nan
        some = np.flatnonzero(clear & ~idle)
        if not len(some):
            return out
        order, beta, moved = self.cuts(some)
        for cuts in np.unique(order):
            mine = order == cuts
            turns = self.turns(some[mine], beta[:cuts, mine], moved[:cuts][:, :, mine])
            self.add(turns, out)
        return out

    def cuts(self, some: NDArray[np.intp]) -> tuple[NDArray[np.intp], Floats, Floats]:
        """Where the gap turns at a level: how many beta a pixel has, those in order, and their derivatives."""
        c, a, b, r = (one[some] for one in (self.c, self.a, self.b, self.ratio))
        found, moved = [], []
        for level, lifted in zip(self.levels[:, some], self.lifted[..., some], strict=True):
            gap = level - c
            square, rest = a**2 * (1.0 - r**-2), gap**2 + (a / r) ** 2 - b**2
            root = np.sqrt((gap * a) ** 2 - square * rest)  # NaN where there is none
            one = gap * a + np.where(gap < 0.0, -root, root)
            for x in (one / square, rest / one):
                for sign in (1.0, -1.0):
                    sine = sign * np.sqrt(1.0 - x**2)
                    phi = np.arctan2(sine, x) % (2.0 * np.pi)
                    other = -a * sine / (b * r)
                    psi = np.arctan2(other, (gap - a * x) / b)
                    slope = -lifted
                    slope[0] += 1.0
                    slope[1] += x
                    slope[2] += np.cos(psi)
                    found.append((psi - r * phi) % (2.0 * np.pi))
                    moved.append(slope / (b * other) - phi * self.faster[:, some])
        beta, slopes = np.array(found), np.array(moved)
        good = np.isfinite(beta) & np.isfinite(slopes).all(1)
        beta[~good] = np.inf
        order = np.argsort(beta, axis=0)
        return good.sum(0), np.take_along_axis(beta, order, 0), np.take_along_axis(slopes, order[:, None], 0)

    def turns(self, pixels: NDArray[np.intp], beta: Floats, moved: Floats) -> _Turns:
        """The turns over which a mean is taken: some between two beta at which excursions come and go."""
        count = len(pixels)
        if not len(beta):
            each = _WHOLE * self.nodes.outer
            even = np.tile(2.0 * np.pi * np.arange(each) / each, count)
            still = np.zeros((self.variables, len(even)))
            return _Turns(np.repeat(pixels, each), even, still, np.full(len(even), 2.0 * np.pi / each), still)
        theta, weight = _half_turn(_PIECE * self.nodes.outer)
        begin, end = beta.T[..., None], np.concatenate([beta[1:], beta[:1] + 2.0 * np.pi]).T[..., None]
        begins, ends = (one.transpose(1, 2, 0)[..., None] for one in (moved, np.roll(moved, -1, axis=0)))
        cosine, share = np.cos(theta), np.sin(theta) * weight
        values = [
            0.5 * (begin + end) - 0.5 * (end - begin) * cosine,
            0.5 * (end - begin) * share,
        ]
        slopes = [
            0.5 * (begins + ends) - 0.5 * (ends - begins) * cosine,
            0.5 * (ends - begins) * share,
        ]
        pixel = np.repeat(pixels, values[0][0].size)
        at, wide = (one.ravel() for one in values)
        shifted, wider = (one.reshape(self.variables, -1) for one in slopes)
        return _Turns(pixel, at, shifted, wide, wider)

    def gap(self, phi: Floats, turn: tuple[Floats, ...]) -> tuple[Floats, Floats]:
        """The gap at phases of turns, and its derivative along the phase."""
        c, a, b, r, beta = turn
        psi = beta + r * phi
        return c + a * np.cos(phi) + b * np.cos(psi), -a * np.sin(phi) - r * b * np.sin(psi)

    def crossings(self, turns: _Turns) -> tuple[NDArray[np.intp], Floats, NDArray[np.intp]]:
        """Crossings of both levels in order: which turn each is of, its phase, its kind."""
        at = turns.pixel
        turn = (self.c[at], self.a[at], self.b[at], self.ratio[at], turns.beta)
        wide = tuple(one[:, None] for one in turn)
        start = np.arccos(np.clip((self.levels[1, at] - turn[0] + turn[2]) / turn[1], -1.0, 1.0))
        span = 2.0 * (np.pi - start)
        places = _LEAST + math.ceil(_PLACES * float((span * np.maximum(1.0, turn[3])).max()) / (2.0 * np.pi))
        grid = start[:, None] + span[:, None] * np.linspace(0.0, 1.0, places + 1)
        rate = self.gap(grid, wide)[1]
        phases = np.empty((len(at), 2 * places + 1))
        phases[:, ::2], phases[:, 1::2] = grid, 0.5 * (grid[:, 1:] + grid[:, :-1])
        which, cell = np.nonzero(rate[:, 1:] * rate[:, :-1] < 0.0)
        own = tuple(one[which] for one in turn)

        def turning(phi: Floats) -> tuple[Floats, Floats]:
            psi = own[4] + own[3] * phi
            return self.gap(phi, own)[1], -own[1] * np.cos(phi) - own[3] ** 2 * own[2] * np.cos(psi)

        phases[which, 2 * cell + 1] = _root(turning, grid[which, cell], grid[which, cell + 1])
        D = self.gap(phases, wide)[0]
        found = []
        for level, kinds in zip(self.levels[:, at], ((_UP, _DOWN), (_END, -1)), strict=True):
            below = level[:, None] > D
            which, cell = np.nonzero(below[:, 1:] != below[:, :-1])
            own, height = tuple(one[which] for one in turn), level[which]

            def passing(phi: Floats, own: tuple[Floats, ...] = own, height: Floats = height) -> tuple[Floats, Floats]:
                D, slope = self.gap(phi, own)
                return D - height, slope

            phi = _root(passing, phases[which, cell], phases[which, cell + 1])
            found.append((which, phi, np.where(below[which, cell], *kinds)))
        which, phi, kind = (np.concatenate(parts) for parts in zip(*found, strict=True))
        order = np.lexsort((phi, which))
        order = order[kind[order] >= 0]
        return which[order], phi[order], kind[order]

    def add(self, turns: _Turns, out: Floats) -> None:
        """Add the sums of the excursions of some turns."""
        which, phi, kind = self.crossings(turns)
        begins = np.flatnonzero(kind == _UP)
        follows = np.minimum(begins + 1, len(kind) - 1)
        good = (follows > begins) & (which[follows] == which[begins]) & (kind[follows] != _UP)
        out[..., turns.pixel[which[begins[~good]]]] = math.nan
        begins, follows = begins[good], follows[good]
        if not len(begins):
            return
        turn = which[begins]
        first, begun = self.moved(turns, turn, phi[begins], kind[begins])
        last, ended = self.moved(turns, turn, phi[follows], kind[follows])
        theta, share = _half_turn(self.nodes.contact)
        half, halved = 0.5 * (last - first)[:, None], 0.5 * (ended - begun)[..., None]
        angle = 0.5 * (first + last)[:, None] - half * np.cos(theta)
        shifted = 0.5 * (begun + ended)[..., None] - halved * np.cos(theta)
        weight, share = turns.weight[turn][:, None], np.sin(theta) * share / (4.0 * np.pi**2)
        wide = (half * weight + np.zeros_like(angle)) * share
        wider = (halved * weight + half * turns.heavier[:, turn][..., None]) * share
        at = turns.pixel[turn]
        psi = turns.beta[turn][:, None] + self.ratio[at][:, None] * angle
        turned = turns.moved[:, turn][..., None] + angle * self.faster[:, at][..., None]
        turned = turned + self.ratio[at][:, None] * shifted
        force, slopes = self.force(at, (angle, shifted), (psi, turned))
        carried, carries = force * wide, slopes * wide + force * wider
        shares = [(np.ones_like(angle), np.zeros_like(shifted))]
        shares += [(np.cos(one), -np.sin(one) * by) for one, by in ((angle, shifted), (psi, turned))]
        shares += [(np.sin(one), np.cos(one) * by) for one, by in ((angle, shifted), (psi, turned))]
        starts = np.flatnonzero(np.diff(at, prepend=-1))
        for i, (one, by) in enumerate(shares):
            rows = np.concatenate([(carried * one)[None], carries * one + carried * by]).sum(-1)
            out[i][:, at[starts]] += np.add.reduceat(rows, starts, axis=-1)

    def moved(
        self, turns: _Turns, turn: NDArray[np.intp], phi: Floats, kind: NDArray[np.intp]
    ) -> tuple[Floats, Floats]:
        """Phases of crossings, and their derivatives."""
        at, level = turns.pixel[turn], (kind == _END).astype(int)
        own = (self.c[at], self.a[at], self.b[at], self.ratio[at], turns.beta[turn])
        psi = own[4] + own[3] * phi
        lacks = self.lifted[level, :, at].T.copy()
        lacks[0] -= 1.0
        lacks[1] -= np.cos(phi)
        lacks[2] -= np.cos(psi)
        lacks += own[2] * np.sin(psi) * (turns.moved[:, turn] + phi * self.faster[:, at])
        return phi, lacks / self.gap(phi, own)[1]

    def force(
        self, at: NDArray[np.intp], phi: tuple[Floats, Floats], psi: tuple[Floats, Floats]
    ) -> tuple[Floats, Floats]:
        """The force at nodes, each phase with its derivatives."""
        c, a, b, fast, slow = (one[at][:, None] for one in (self.c, self.a, self.b, self.fast, self.slow))
        (angle, shifted), (other, turned) = phi, psi
        cosines, sines = (np.cos(angle), np.cos(other)), (np.sin(angle), np.sin(other))
        D = c + a * cosines[0] + b * cosines[1]
        raised = -a * sines[0] * shifted - b * sines[1] * turned
        for i, one in enumerate((1.0, *cosines)):
            raised[i] += one
        (force, slope, *along), (damping, damps, *damped) = self.layers.values(
            self.memory.force, D, {name: value[at][:, None] for name, value in self.p.items()}
        )
        slopes = slope * raised
        slopes[3:-2] += np.array(along).reshape(len(along), *D.shape)
        if not damping.any():
            return force, slopes
        V = -fast * a * sines[0] - slow * b * sines[1]
        quickened = -fast * a * cosines[0] * shifted - slow * b * cosines[1] * turned
        for i, one in ((1, fast * sines[0]), (2, slow * sines[1]), (-2, a * sines[0]), (-1, b * sines[1])):
            quickened[i] -= one
        slopes -= damping * quickened + damps * raised * V
        slopes[3:-2] -= np.array(damped).reshape(len(along), *D.shape) * V
        return force - damping * V, slopes


def _root(function: Callable[[Floats], tuple[Floats, Floats]], low: Floats, high: Floats) -> Floats:
    """Return where functions that a bracket holds are 0: Newton's method, and halves where it would leave."""
    low, high = low.copy(), high.copy()
    rising = function(high)[0] >= 0.0
    x = 0.5 * (low + high)
    for _ in range(_STEPS):
        value, slope = function(x)
        upper = (value >= 0.0) == rising
        high, low = np.where(upper, x, high), np.where(upper, low, x)
        new = x - value / slope
        new = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        done = np.abs(new - x) <= _EXACT * np.abs(x)
        x = new
        if done.all():
            break
    return x


def _half_turn(count: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre nodes and weights from 0 to pi."""
    roots, weights = np.polynomial.legendre.leggauss(count)
    return np.pi / 2 * (roots + 1.0), np.pi / 2 * weights

"""The text of a step of many lanes by the exact flow of a mode's linear part, in its modal coordinates.

The rest of the field acts as kicks at the three nodes of Gauss's rule, as in `saltus.system.writing.linear_split`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy

from saltus.ensemble.labels import AT_STROBE, CHANGES, GOES_ON, HUGE
from saltus.system.expansion import expanded
from saltus.system.writing.linear_split import NODES, WEIGHTS

if TYPE_CHECKING:
    from saltus.ensemble.lane_kinds import Pool
    from saltus.ensemble.lane_text import LaneText
    from saltus.system.writing.linear_split import Split

__all__ = ["exact_step"]

_KEPT = 0.3  # least part of an event function's value that a step leaves: the nodes see no nearer pole
_WAIT = 40.0  # Taylor steps of a motion, where the rest was too strong, before exact steps are tried again

# Error of Gauss's rule for 1/(1 - r s)^2 on [-1, 1]: _QUADRATURE v^3/(1 - v)^2, within a fifth for r from 0.4 to 0.8.
# v is the second difference at the nodes over the largest value there. The sixth roots of this error and of that by
# turning add up (M. Abramowitz, I. Stegun, Handbook of Mathematical Functions, 25.4.29).
_QUADRATURE = 0.0054
_FIRST = 0.375  # part of the first difference's square that v is at least
_ROTATION = 1.0 / 2016000.0  # error by turning, over the sixth power of the angle by which a modal coordinate turns


def exact_step(lane: LaneText, pool: Pool) -> tuple[list[str], list[str]]:
    """Return the statements of a step by the exact flow of a mode's linear part; none is in parameters alone."""
    return [], _ExactStep(lane, pool).lines()


class _ExactStep:
    """The statements of one lane's step: how far it goes, the linear flow, the rest's kicks, what is reported."""

    def __init__(self, lane: LaneText, pool: Pool) -> None:
        assert pool.split is not None
        self.lane, self.pool, self.split, self.pairs = lane, pool, pool.split, pool.pairs
        self.name = f"far{pool.mode}_"
        self.rest = _Rest(lane, pool.split)
        self.kind = "short" if self.rest.expressions else "circular"

    def lines(self) -> list[str]:
        lane, rest, n = self.lane, self.rest, self.lane.n_states
        lines = [f"z{i} = {lane.load(i)}" for i in range(n)]
        lines += [f"t = {lane.load('t')}", f"itol = {lane.load('itol')}"]
        lines += self.turns("a", "t") + self.state("a", "z") + self.length() + self.rotations()
        lines += _turn(lane, "y", "z", "m", self.pool)
        if rest.expressions:
            lines += _turn(lane, "f", "y", "f", self.pool) + _turn(lane, "b", "y", "b", self.pool)
            lines += self.turns("half", "half") + self.turns("near", "near") + self.phasors("m", "a", "half")
            lines += self.phasors("b", "m", "near", "-") + self.phasors("f", "m", "near")
            lines += self.state("b", "b") + self.state("m", "y") + self.state("f", "f")
            lines += _kicks(lane, self.name, self.pool, rest)
            lines += rest.error(self.number("weight"), self.number("swiftest"))
        else:
            lines += ["too_far = False", f"next = {HUGE}"]
        lines += _turn(lane, "n", "y", "m", self.pool)
        return [
            *lines,
            "stays = leaves | too_far",
            *(lane.store(i, f"z{i} if stays else n{i}") for i in range(n)),
            lane.store("t", "t if stays else t + h"),
            lane.store("cap", f"{HUGE} if leaves | (strobe & (not too_far)) else next"),
            f"too_fast = too_far & (next < {self.number('shortest')})",
            lane.store("wait", f"{_WAIT} if too_fast else 0.0"),
            "leaves = leaves | too_fast",
            "strobe = strobe & (not too_far)",
            "leaves = leaves | (nears & (not stays) & (not strobe))",
            lane.store("flag", f"{CHANGES} if leaves else ({AT_STROBE} if strobe else {GOES_ON})"),
            lane.store("count", f"{lane.load('count')} + 1.0"),
        ]

    def number(self, key: str) -> str:
        return self.lane.number(f"{self.name}{key}")

    def row(self, key: str, at: str, z: str) -> str:
        """A function that is linear in the modal coordinates and the phasors."""
        terms = [f"{self.number(f'{key}_{i}')}, {z}{i}" for i in range(self.lane.n_states)]
        for j in self.split.harmonics:
            terms += [f"{self.number(f'{key}_c{j}')}, {at}cos{j}", f"{self.number(f'{key}_s{j}')}, {at}sin{j}"]
        return f"products({', '.join(terms)}) + {self.number(f'{key}_constant')}"

    def turns(self, of: str, time: str) -> list[str]:
        """Phasors of an angle: that of a time since phase 0, or of part of a step."""
        if not self.split.harmonics:
            return []
        kind = "circular" if of == "a" else self.kind
        lines = [f"th = {self.lane.number('rate')}*({time})"]
        for j in self.split.harmonics:
            lines += [f"{of}{part}{j} = {kind}_{part}({float(j)!r}*th)" for part in ("cos", "sin")]
        return lines

    def phasors(self, at: str, of: str, by: str, sense: str = "") -> list[str]:
        """Phasors at a time after (or, where `sense` is a minus, before) that of others."""
        lines = []
        for j in self.split.harmonics:
            c, s = f"{by}cos{j}", f"({sense}{by}sin{j})"
            lines += [
                f"{at}cos{j} = {of}cos{j}*{c} - {of}sin{j}*{s}",
                f"{at}sin{j} = {of}sin{j}*{c} + {of}cos{j}*{s}",
            ]
        return lines

    def state(self, at: str, z: str) -> list[str]:
        """What the rest needs, and the rest there."""
        return [
            *(f"{at}gap{j} = {self.row(f'h{j}', at, z)}" for j in self.rest.gaps),
            *(f"{at}x{e} = {self.row(f'x{e}', at, z)}" for e in self.rest.needed),
            *self.rest.lines(at),
        ]

    def length(self) -> list[str]:
        """How far no surface comes near, and the rest does not turn too fast; whether the lane leaves for others."""
        lane, pairs, number = self.lane, self.pairs, self.number
        sizes = [f"math.sqrt(z{2 * i}*z{2 * i} + z{2 * i + 1}*z{2 * i + 1})" for i in range(pairs)]
        sizes += [f"abs(z{i})" for i in range(2 * pairs, lane.n_states)]
        lines = [f"size{i} = {value}" for i, value in enumerate(sizes)]
        lines += [
            f"cap = {lane.load('cap')}",
            f"h = min(cap, {number('longest')})",
            "leaves = False",
            "nears = False",
        ]
        for j, transition in enumerate(lane.events[self.pool.mode]):
            lines += self.reach(j, lane.side_of(j, transition), len(sizes))
            lines += [
                f"leaves = leaves | (b < {number('in')}) | (reach < {number('shortest')})",
                f"nears = nears | (reach < min(h, {number('close')}))",
                "h = min(h, reach)",
            ]
            if self.rest.expressions:
                lines.append("h = min(h, b/(abs(d) + 1e-30))")
        return [*lines, f"left = {lane.number('period')} - t", "strobe = h >= left", "h = left if strobe else h"]

    def reach(self, j: int, side: str, sizes: int) -> list[str]:
        """How long an event function surely keeps a part of its value b, from its slope d and bounds on its bend."""
        rest, pairs, number = self.rest, self.pairs, self.number
        pushed = [f"{number(f'p{j}_{f}')}*ag{g}" for f, g in rest.source.items()]
        bends = [f"{number(f'm{j}_{i}')}*size{i}" for i in range(sizes)]
        kicked = [f"2.0*abs({number(f'b{j}_{f}')}*ag{g})" for f, g in rest.source.items()]
        lines = [
            f"b = {side}*({self.row(f'h{j}', 'a', 'z') if j not in rest.gaps else f'agap{j}'})",
            f"d = {side}*({' + '.join([self.row(f'd{j}', 'a', 'z'), *pushed])})",
            f"level = max({number('in')}, {_KEPT if rest.expressions else 0.0}*b)",
            f"m0 = {' + '.join([*bends[: min(pairs, 1)], *bends[pairs:], number(f'm{j}'), *kicked])}",
            *(f"m{i} = m{i - 1} + {bends[i]}" for i in range(1, pairs)),
            f"low, slope, bend = b - level, d, m{max(pairs, 1) - 1}",
            "slow, slows = low, d",
        ]
        for pair in range(pairs - 1, 0, -1):
            lines += self.without(j, pair, side)
        return [*lines, "reach = (slope + math.sqrt(max(slope*slope + 2.0*bend*low, 0.0)))/bend"]

    def without(self, j: int, pair: int, side: str) -> list[str]:
        """Count a fast pair with the most that it can take away, not with slope and bend, where that leaves more."""
        at = [f"{self.number(f'{key}{j}_{i}')}, z{i}" for key in "hd" for i in (2 * pair, 2 * pair + 1)]
        return [
            f"slow = slow - {side}*products({', '.join(at[:2])}) - {self.number(f'a{j}_{pair}')}*size{pair}",
            f"slows = slows - {side}*products({', '.join(at[2:])})",
            f"better = slow*bend > low*m{pair - 1}",
            "low = slow if better else low",
            "slope = slows if better else slope",
            f"bend = m{pair - 1} if better else bend",
        ]

    def rotations(self) -> list[str]:
        """What half a step, and the way from its middle to a node, make of each modal coordinate."""
        kind = self.kind
        lines = ["half = 0.5*h", f"near = {2.0 * (NODES[2] - 0.5)!r}*half"]
        for i in range(self.pairs):
            lr, li = self.number(f"lr{i}"), self.number(f"li{i}")
            lines += [
                f"e = grown({lr}*half)", f"c = {kind}_cos({li}*half)", f"s = {kind}_sin({li}*half)",
                f"mc{i} = e*c", f"ms{i} = e*s",
            ]  # fmt: skip
            if self.rest.expressions:
                lines += [
                    f"e = grown({lr}*near)", "i = 1.0/e", f"c = {kind}_cos({li}*near)", f"s = {kind}_sin({li}*near)",
                    f"fc{i} = e*c", f"fs{i} = e*s", f"bc{i} = i*c", f"bs{i} = -i*s",
                ]  # fmt: skip
        for i in range(2 * self.pairs, self.lane.n_states):
            lr = self.number(f"lr{i}")
            lines.append(f"mr{i} = grown({lr}*half)")
            if self.rest.expressions:
                lines += [f"fr{i} = grown({lr}*near)", f"br{i} = 1.0/fr{i}"]
        return lines


def _turn(lane: LaneText, to: str, of: str, by: str, pool: Pool) -> list[str]:
    """Modal coordinates after a time."""
    lines = []
    for i in range(pool.pairs):
        re, im = f"{of}{2 * i}", f"{of}{2 * i + 1}"
        lines += [
            f"{to}{2 * i} = {by}c{i}*{re} - {by}s{i}*{im}",
            f"{to}{2 * i + 1} = {by}s{i}*{re} + {by}c{i}*{im}",
        ]
    return lines + [f"{to}{i} = {by}r{i}*{of}{i}" for i in range(2 * pool.pairs, lane.n_states)]


def _kicks(lane: LaneText, name: str, pool: Pool, rest: _Rest) -> list[str]:
    """The rest at the nodes, as kicks to the modal coordinates at the middle."""
    counts, lines = range(len(rest.expressions)), []
    for at, weight in zip("bmf", WEIGHTS, strict=True):
        lines += [f"k{at}g{g} = {weight!r}*h*{at}g{g}" for g in counts]
    for i in range(lane.n_states):
        parts = [[f"{lane.number(f'{name}l{i}_{f}')}" for f, g in rest.source.items() if g == h] for h in counts]
        lines += [f"c{g} = {' + '.join(part)}" for g, part in zip(counts, parts, strict=True)]
        lines += [f"k{at}{i} = {' + '.join(f'c{g}*k{at}g{g}' for g in counts)}" for at in "bmf"]
    for i in range(pool.pairs):
        re, im = 2 * i, 2 * i + 1
        lines += [
            f"y{re} = y{re} + km{re} + fc{i}*kb{re} - fs{i}*kb{im} + bc{i}*kf{re} - bs{i}*kf{im}",
            f"y{im} = y{im} + km{im} + fs{i}*kb{re} + fc{i}*kb{im} + bs{i}*kf{re} + bc{i}*kf{im}",
        ]
    for i in range(2 * pool.pairs, lane.n_states):
        lines.append(f"y{i} = y{i} + km{i} + fr{i}*kb{i} + br{i}*kf{i}")
    return lines


class _Rest:
    """What is not linear in a mode's field, and what its values at the nodes say of the error of a step."""

    def __init__(self, writer: LaneText, split: Split) -> None:
        self.writer, self.split = writer, split
        self.expressions = list(dict.fromkeys(split.rest.values()))
        self.source = {f: self.expressions.index(g) for f, g in split.rest.items()}
        self.symbols = [sympy.Dummy() for _ in split.events]
        self.inverses: dict[sympy.Expr, sympy.Dummy] = {}
        slopes = [[sympy.diff(g, split.symbols[e]) for e in range(split.n)] for g in self.expressions]
        self.slopes = [{e: self._cheap(slope) for e, slope in enumerate(row) if slope != 0} for row in slopes]
        self.expressions = [self._cheap(g) for g in self.expressions]
        used = [*self.expressions, *(slope for row in self.slopes for slope in row.values()), *self.inverses]
        symbols = set().union(*(g.free_symbols for g in used))
        self.needed = [e for e in range(split.n) if split.symbols[e] in symbols]
        self.moving = sorted({e for row in self.slopes for e in row})
        self.gaps = [j for j, symbol in enumerate(self.symbols) if symbol in symbols]

    def _cheap(self, expression: sympy.Expr) -> sympy.Expr:
        """The expression with event functions in the place of sums that they differ from by constants, and inverses."""
        varying = set(self.split.symbols)
        sums = [sympy.Add(*(c * x for c, x in zip(row, self.split.symbols, strict=True))) for row in self.split.events]

        def by_gap(total: sympy.Expr) -> sympy.Expr:
            for symbol, event in zip(self.symbols, sums, strict=True):
                for sign in (1, -1):
                    if not (constant := expanded(total - sign * event)).free_symbols & varying:
                        return sign * symbol + constant
            return total

        def by_inverse(base: sympy.Expr, power: sympy.Expr) -> sympy.Expr:
            if not (power.is_Integer and power < 0 and base.free_symbols & {*varying, *self.symbols}):
                return base**power
            return self.inverses.setdefault(base, sympy.Dummy()) ** -power

        return expression.replace(lambda e: e.is_Add, by_gap).replace(sympy.Pow, by_inverse)

    def lines(self, at: str) -> list[str]:
        """The rest where states are ``{at}x{e}``, event functions ``{at}gap{j}``, phasors ``{at}cos{j}`` and so on."""
        names = self._names(at)
        return [
            *(f"{names[symbol]} = 1.0/({self.writer.text_of(base, names)})" for base, symbol in self.inverses.items()),
            *(f"{at}g{i} = {self.writer.text_of(g, names)}" for i, g in enumerate(self.expressions)),
        ]

    def error(self, weight: str, swiftest: str) -> list[str]:
        """Whether a step was too long, and how long the next may be.

        The three nodes miss what varies fast, or turns fast with the modal coordinates; and the rest is taken where the
        linear flow leads, not where the kicks of the step itself move the states that it depends on.
        """
        lines = [f"turned = {_ROTATION ** (1.0 / 6.0)!r}*{swiftest}*h", "error = 0.0"]
        for i in range(len(self.expressions)):
            a, b, c = (f"{at}g{i}" for at in "bmf")
            lines += [
                f"d{i} = max(abs({a}), max(abs({b}), abs({c}))) + 1e-30",
                f"i = 1.0/d{i}",
                f"u = ({c} - {a})*i",
                f"v = max(abs({a} - 2.0*{b} + {c})*i, {_FIRST!r}*u*u)",
                f"v = {_QUADRATURE ** (1.0 / 6.0)!r}*math.sqrt(v)*(1.0 + v*(0.33 + 0.3*v)) + turned",
                "v = v*v*v",
                f"error = max(error, v*v*d{i})",
            ]
        lines += [f"moved{e} = {self._moved(e)}" for e in self.moving]
        for row in self.slopes:
            for e, slope in row.items():
                b, f = (self.writer.text_of(slope, self._names(at)) for at in "bf")
                lines.append(f"error = error + max(abs({b}), abs({f}))*moved{e}")
        return [
            *lines,
            f"error = error*h*{weight}*itol + 1e-12",
            "too_far = error > 4.0",
            "next = h*max(0.9*root(error, 6.0), 0.2)",
        ]

    def _moved(self, e: int) -> str:
        """How far the kicks move a state within a step."""
        terms = []
        for f, i in self.source.items():
            if e == f:
                terms.append(f"h*d{i}")
            elif (entry := self.split.matrix[e][f]) != 0:
                terms.append(f"0.5*h*h*abs({self.writer.text_of(entry)})*d{i}")
        return " + ".join(terms) or "0.0"

    def _names(self, at: str) -> dict[sympy.Expr, str]:
        names = {self.split.symbols[e]: f"{at}x{e}" for e in self.needed}
        names |= {symbol: f"{at}gap{j}" for j, symbol in enumerate(self.symbols)}
        names |= {symbol: f"{at}inverse{i}" for i, symbol in enumerate(self.inverses.values())}
        for i, j in enumerate(self.split.harmonics):
            place = self.split.n + 2 * i
            names |= {self.split.symbols[place]: f"{at}cos{j}", self.split.symbols[place + 1]: f"{at}sin{j}"}
        return names

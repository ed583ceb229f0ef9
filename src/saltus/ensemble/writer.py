"""The generated text that follows many motions at once: the steps of one lane, which a loop or a GPU runs side by side.

A lane is a motion under way: its state, the time since phase 0, and what its next step needs. Lanes that take the same
kind of step stand together in a pool. Each mode has a pool with Taylor steps: in time, or in sigma where the mode is
regularised (`saltus.system.writing.regularise`). A mode with a linear part has a second pool, with steps by the exact
flow of that part (`saltus.system.writing.linear_split`). Steps have no branches. Events, phase 0 and a change of pool
are flagged by the step, and done one lane at a time. See docs/theory/lanes.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy

from saltus.ensemble.exact_step import exact_step
from saltus.ensemble.labels import ADDRESSED, CHANGES, EVENT, GONE, HARD, HUGE, STUCK
from saltus.ensemble.lane_kinds import Pool
from saltus.ensemble.lane_text import LaneText
from saltus.ensemble.taylor_step import taylor_step
from saltus.scales.doubles import EPS
from saltus.system.expansion import expanded, proportional
from saltus.system.own_states import absent_states
from saltus.system.parts import at_phases
from saltus.system.writing.rounding import rounding_lines

if TYPE_CHECKING:
    from collections.abc import Iterator

    from saltus.system.writing.linear_split import Split

__all__ = ["LaneWriter"]

_CLEAR = 1e-12  # rate of an event function, over its terms, above which its sign is no rounding
_NOISE = 256.0 * EPS  # distance from 0, in roundings of 1, at which an event function is clear of them
_SOON = 1e-6  # periods after which that is soon
_CLOSE = 1e-6  # event function at a landing, over its size, at most

_HEAD = """
from numba import float64, int64, types

from saltus.ensemble.kernels.lanes import FAST, SCALAR, circular_cos, circular_sin, grown, halley, ld, polynomial
from saltus.ensemble.kernels.lanes import products, rises_again, root, short_cos, short_sin, st
from saltus.ensemble.labels import NL
from saltus.system.numba_tools.machine_code import Addressed, shared

P = types.CPointer(float64)
inner = dict(no_cpython_wrapper=True)
LANE = {"fastmath": FAST, **SCALAR}
lane = shared(**LANE, **inner)
scalar = shared(**SCALAR, **inner)
CALL = int64, P, int64, P, P
"""


class LaneWriter(LaneText):
    """Text of the steps of lanes, and of what is done between them; see `LaneText`."""

    def functions(self) -> Iterator[str]:
        """Texts of the module: a step for each pool, what is done between steps, and the loop over all."""
        texts = [self._step(k, pool) for k, pool in enumerate(self.pools)]
        texts += [self.in_lane(text) for text in (self._entries(), self._begin(), self._turned(), self._read())]
        texts += [self._steps(), self._move()]  # when it is known which numbers a lane has of its own
        self.numbers |= {
            "N": self.n_states,
            "NF": self.n_fields + len(self.own_numbers),
            "OWN": tuple(self.own_numbers),
            "POOLS": len(self.pools),
            "MODE_OF": tuple(pool.mode for pool in self.pools),
            "QUANTITIES": tuple(self.lane_numbers),
        }
        yield _HEAD
        yield from texts
        yield "\n\n"
        yield from (f"{name}_at = Addressed({name}, CALL)\n" for name in ADDRESSED)
        yield from (f"step_{k}_at = Addressed(step_{k}, CALL)\n" for k in range(len(self.pools)))

    def _step(self, k: int, pool: Pool) -> str:
        """The text of a pool's steps: a loop over lanes around statements without branches."""
        self._hoisted = {}
        constants, body = exact_step(self, pool) if pool.split is not None else taylor_step(self, pool)
        if self.own:
            constants, body = [], [*constants, *body]
        body = [line.replace("math.sin(", "circular_sin(").replace("math.cos(", "circular_cos(") for line in body]
        once, each, body = self.reads(body)
        head = [*constants, *once]
        return "\n".join(
            [
                "\n\n@lane",
                f"def step_{k}(k, S, n, p, q):",
                *(f"    {line}" for line in head),
                "    for l in range(n):",
                *(f"        {line}" for line in [*each, *body]),
                "    return 0",
                "",
            ]
        )

    # ---- one lane at a time ----

    def _steps(self) -> str:
        """The function that makes the step of pool k on a graphics card, which calls none by address."""
        lines = ["\n\n@scalar", "def step(k, S, n, p, q):"]
        for k in range(len(self.pools)):
            lines += [f"    {'elif' if k else 'if'} k == {k}:", f"        step_{k}(k, S, n, p, q)"]
        return "\n".join([*lines, "    return 0"]) + "\n"

    def _move(self) -> str:
        """A lane's fields, into lane m of Q: in a loop the compiler would gather and scatter them, which is slower."""
        lines = [f"    st(Q, {i}*NL, m, ld(S, {i}*NL, l))" for i in range(self.n_fields + len(self.own_numbers))]
        return "\n".join(["\n\n@scalar", "def move(m, S, l, Q, q):", *lines, "    return 0"]) + "\n"

    def _state_names(self) -> dict[sympy.Expr, str]:
        return {symbol: ("theta" if i == self.n_states else f"x{i}") for i, symbol in enumerate(self.system.x)}

    def _state_lines(self) -> list[str]:
        lines = [f"x{i} = {self.load(i)}" for i in range(self.n_states)]
        if self.has_phase:
            lines.append(f"theta = {self.place('rate')}*{self.load('t')}")
        return lines

    def _entries(self) -> str:
        """Functions that enter a mode: `on` is the bits of the events whose surface the motion starts on.

        A further bit, `same_mode`, tells that the motion was in the mode before.
        """
        s, names, texts = self.system, self._state_names(), []
        for mode in range(len(s.field)):
            pool = self.pools[mode]
            lines = ["\n\n@scalar", f"def enter_{mode}(S, l, on, p, q):", *(f"    {x}" for x in self._state_lines())]
            lines += [f"    {self.store('w', '0.0')}", f"    {self.store('cap', HUGE)}"]
            lines += [f"    {self.store(self.on(j), '0.0')}" for j in range(self.n_events)]
            for j, k in enumerate(self.events[mode]):
                direction = s.system.transitions[k].direction
                about = pool.form is not None and pool.form.transition == k
                value, rate = self.text_of(s.event[k], names), self.text_of(s.rate[k], names)
                lines += [f"    if on & {1 << j}:"]
                if about:
                    lines.append("        pass")
                else:
                    lines.append(f"        {self.store(self.on(j), self._on_value(j, k))}")
                    if not direction or k in self.two_sided:
                        # a side that rounding decides is the event-driven flow's to tell
                        lines += [
                            f"        if not abs({rate}) > {_CLEAR!r}*({self._size_of_terms(s.rate[k], names)}):",
                            f"            return {HARD}",
                            f"        {self.store(self.side(j), f'math.copysign(1.0, {rate})')}",
                        ]
                lines += ["    else:", f"        value = {value}"]
                if direction and k not in self.two_sided:
                    lines.append(f"        value = {-float(direction)!r}*value")
                else:
                    if direction and not (self.comes_round(k) or self.is_counted(k)):
                        # beyond it a motion lands only where the condition fails
                        passed = f"{float(direction)!r}*value > 0.0 and {self.text_of(s.when[k], names)} > 0.0"
                        lines += [f"        if not on & {self.same_mode} and {passed}:", f"            return {HARD}"]
                    lines.append(f"        {self.store(self.side(j), 'math.copysign(1.0, value)')}")
                    lines.append("        value = abs(value)")
                lines += ["        if not value > 0.0:", f"            return {HARD}"]
                if about:
                    lines.append(f"        {self.store('w', 'math.sqrt(value)')}")
            lines.append(f"    return {mode}")
            texts.append("\n".join(lines) + "\n")
        return "".join(texts)

    @property
    def same_mode(self) -> int:
        """Bit behind those of the events in the argument of functions that enter a mode."""
        return 1 << 2 * self.n_events

    def _on_value(self, j: int, k: int) -> str:
        """Text of what a lane's field `on` holds of event j of a mode, transition k, on whose surface it starts."""
        return f"(2.0 if on & {1 << (j + self.n_events)} else 1.0)" if k in self.touches else "1.0"

    def _size_of_terms(self, expression: sympy.Expr, names: dict[sympy.Expr, str]) -> str:
        """Text of the size of the terms that an expression sums up, from its slopes."""
        slopes = [(sympy.diff(expression, symbol), symbol) for symbol in self.system.x]
        terms = [f"abs(({self.text_of(slope, names)})*{names[symbol]})" for slope, symbol in slopes if slope != 0]
        return " + ".join(terms) or "0.0"

    def _begin(self) -> str:
        """The pool of a motion at phase 0: its mode's, by default the first that its state allows.

        A motion that starts on a surface is left to `saltus.flow.starting.starting_mode`.
        """
        s, names = self.system, self._state_names()
        lines = ["\n\n@scalar", "def begin(mode, S, l, p, q):", *(f"    {x}" for x in self._state_lines())]
        for mode in range(len(s.field)):
            surfaces: list[str] = []
            conditions = [f"x{i} == 0.0" for i in absent_states(s.system, mode)]
            conditions += [f"{self.text_of(s.domain[mode], names)} > 0.0"] if s.domain[mode] != 1 else []
            for k in self.events[mode]:
                transition = s.system.transitions[k]
                if (
                    transition.target == transition.source
                    or not transition.direction
                    or at_phases(s.system, transition)
                ):
                    continue
                value = self.text_of(s.event[k], names)
                surfaces.append(f"({value}) == 0.0")
                passed = f"{float(transition.direction)!r}*({value}) > 0.0"
                if s.when[k] != 1:
                    passed = f"({passed} and {self.text_of(s.when[k], names)} > 0.0)"
                conditions.append(f"not {passed}")
            if surfaces:
                lines += [f"    if mode < 0 and ({' or '.join(surfaces)}):", f"        return {HARD}"]
            lines += [
                f"    if mode == {mode} or (mode < 0 and {' and '.join(conditions) or 'True'}):",
                f"        return enter_{mode}(S, l, 0, p, q)",
            ]
        return "\n".join([*lines, f"    return {HARD}"]) + "\n"

    def _turned(self) -> str:
        """The function called after a flagged step; it returns the pool in which the lane goes on, HARD or GONE."""
        lines = [
            "\n\n@scalar",
            "def turned(k, S, l, p, q):",
            f"    flag = {self.load('flag')}",
            f"    if flag == {STUCK!r}:",
            "        for i in range(N):",
            f"            if not abs(ld(S, i*NL, l)) < 0.5*{self.place('limit')}:",
            f"                return {GONE}",
            "        return k",
        ]
        for k, pool in enumerate(self.pools):
            body = self._exact_left(k, pool) if pool.split is not None else self._taylor_left(pool)
            lines += [f"    {'if' if k == 0 else 'elif'} k == {k}:", *(f"        {line}" for line in body)]
        return "\n".join([*lines, f"    return {HARD}"]) + "\n"

    def _taylor_left(self, pool: Pool) -> list[str]:
        s, names = self.system, self._state_names()
        lines = self._state_lines()
        k = next((k for k, p in enumerate(self.pools) if p.split is not None and p.mode == pool.mode), None)
        if k is not None:
            lines += [f"if flag == {CHANGES!r}:", *(f"    {line}" for line in self._to_modal(k))]
        for j, transition in enumerate(self.events[pool.mode]):
            lines.append(f"if flag == {EVENT + j!r}:")
            if s.event[transition].has(sympy.atan2, sympy.sign):
                # series go on past a jump of the function, to a zero that it does not have
                value = self.text_of(s.event[transition], names)
                lines += [
                    f"    if not abs({value})*{self.place(f'escale{transition}')} < {_CLOSE!r}:",
                    f"        return {HARD}",
                ]
            lines += [f"    {line}" for line in self._unclear(transition, names)]
            lines += [f"    {line}" for line in self._met(pool, transition, names)]
        return lines

    def _unclear(self, transition: int, names: dict[sympy.Expr, str]) -> list[str]:
        """Statements that leave a landing to the event-driven flow, where rounding may have made the event.

        It is clear where the function is above its rounding soon before and soon after.
        """
        s = self.system
        errors = {symbol: f"abs({names[symbol]})" for symbol in s.x}
        lines, _, rounding = rounding_lines(s.event[transition], lambda e: self.text_of(e, names), errors)
        rate = self.text_of(s.rate[transition], names)
        return [
            *lines,
            f"if not {_NOISE!r}*({rounding or '0.0'}) < {_SOON!r}*{self.place('period')}*abs({rate}):",
            f"    return {HARD}",
        ]

    def _met(self, pool: Pool, transition: int, names: dict[sympy.Expr, str]) -> list[str]:
        """Statements of a lane on the surface of a transition: the first that happens there is taken.

        Where none happens the motion passes the surface, if all of these transitions may be passed.
        """
        s, lines, on, passes = self.system, list[str](), self.same_mode, True
        for j, k in enumerate(self.events[pool.mode]):
            if k != transition and not self._vanishes_with(s.event[k], s.event[transition]):
                continue
            on |= 1 << j
            happens, direction = self._happening(k, names), s.system.transitions[k].direction
            if k in self.two_sided:
                happens = [f"if {self.load(self.side(j))} == {-float(direction)!r}:", *(f"    {x}" for x in happens)]
            lines += happens
            about = pool.form is not None and pool.form.transition == k
            passes = passes and (k in self.two_sided or (not direction and s.when[k] != 1 and not about))
        return [*lines, f"return enter_{pool.mode}(S, l, {on}, p, q)" if passes else f"return {HARD}"]

    def _happening(self, transition: int, names: dict[sympy.Expr, str]) -> list[str]:
        """Statements by which a lane takes a transition, if its condition holds."""
        s = self.system
        lines = [
            self.store(i, self.text_of(value, names))
            for i, (value, symbol) in enumerate(zip(s.reset[transition][: self.n_states], s.x, strict=False))
            if value != symbol
        ]
        if self.own:
            lines.append(self.store("taken", f"{transition + 1.0!r}"))
        target = list(s.system.modes).index(s.system.transitions[transition].target)
        bits = self._surfaces(transition, target)
        if follows := self._follows(transition, target, bits, names):
            lines = [f"if {' or '.join(follows)}:", f"    return {HARD}", *lines]
        lines.append(f"return enter_{target}(S, l, {bits}, p, q)")
        if s.when[transition] == 1:
            return lines
        return [f"if {self.text_of(s.when[transition], names)} > 0.0:", *(f"    {line}" for line in lines)]

    def _follows(self, transition: int, target: int, bits: int, names: dict[sympy.Expr, str]) -> list[str]:
        """Conditions for an event to happen at once where a transition has led; see docs/theory/flow.md, Sides."""
        s, found = self.system, list[str]()
        moved = dict(zip(s.x, s.reset[transition], strict=True))
        stays = target == s.source[transition]
        for j, k in enumerate(self.events[target]):
            if not bits & 1 << j or bits & 1 << (j + self.n_events):
                continue
            direction, rate = s.system.transitions[k].direction, s.rate[k].xreplace(moved)
            holds = [s.when[k].xreplace(moved)] if s.when[k] != 1 else []
            if k == transition:
                if (direction and k not in self.two_sided) or self._repeats_nothing(k, moved):
                    continue
                before = f"{float(direction)!r}" if direction else f"-{self.load(self.side(j))}"
                changed = [x for x in s.x[: len(s.system.states)] if moved[x] != x]
                texts = [f"{before}*({self.text_of(rate, names)}) > 0.0"]
                if len(changed) == 1:  # a reset that turns no rate back is a threshold's
                    turn = -sympy.diff(s.rate[k], changed[0]) * sympy.diff(rate, changed[0])
                    texts.append(f"{self.text_of(turn, names)} > 0.0")
                found.append(" and ".join(texts))
            elif direction or stays:
                holds += [direction * rate] if direction else []
                found.append(" and ".join(f"{self.text_of(value, names)} > 0.0" for value in holds) or "True")
        return found

    def _repeats_nothing(self, transition: int, moved: dict[sympy.Expr, sympy.Expr]) -> bool:
        """Whether a reset changes neither the event function of its transition nor the rate of the event function."""
        s = self.system
        return all(expanded(value.xreplace(moved) - value) == 0 for value in (s.event[transition], s.rate[transition]))

    def _surfaces(self, transition: int, target: int) -> int:
        """Bits of the events of the target mode that vanish on the surface of a transition, after its reset."""
        s = self.system
        moved = dict(zip(s.x, s.reset[transition], strict=True))
        bits = 0
        for j, k in enumerate(self.events[target]):
            if self._vanishes_with(s.event[k].xreplace(moved), s.event[transition]):
                bits |= 1 << j
            if transition in self.touches.get(k, ()):
                bits |= 1 << j | 1 << (j + self.n_events)
        return bits

    def _vanishes_with(self, event: sympy.Expr, other: sympy.Expr) -> bool:
        """Whether an event function is 0, or another one times what knows no state."""
        if event == 0 or any(expanded(event + sign * other) == 0 for sign in (-1, 1)):
            return True
        return proportional(event, other, set(self.system.x))

    def _to_modal(self, k: int) -> list[str]:
        n, split = self.n_states, self.pools[k].split
        assert split is not None
        name = f"far{self.pools[k].mode}_"
        lines = [f"{part}{j} = circular_{part}({float(j)!r}*theta)" for j in split.harmonics for part in ("cos", "sin")]
        for i in range(n):
            terms = [f"{self.place(f'{name}z{i}_{e}')}*x{e}" for e in range(n)]
            for j in split.harmonics:
                terms += [f"{self.place(f'{name}z{i}_c{j}')}*cos{j}", f"{self.place(f'{name}z{i}_s{j}')}*sin{j}"]
            lines.append(self.store(i, f"{' + '.join(terms)} + {self.place(f'{name}z{i}_constant')}"))
        return [*lines, self.store("cap", HUGE), f"return {k}"]

    def _exact_left(self, k: int, pool: Pool) -> list[str]:
        assert pool.split is not None
        theta = [f"theta = {self.place('rate')}*{self.load('t')}"] if self.has_phase else []
        return [*theta, *self._from_modal(k, pool.split), f"return enter_{pool.mode}(S, l, {self.same_mode}, p, q)"]

    def _from_modal(self, k: int, split: Split, to: str = "st(S, {}*NL, l, {})") -> list[str]:
        n, name = self.n_states, f"far{self.pools[k].mode}_"
        lines = [f"{part}{j} = circular_{part}({float(j)!r}*theta)" for j in split.harmonics for part in ("cos", "sin")]
        lines += [f"z{i} = {self.load(i)}" for i in range(n)]
        for e in range(n):
            terms = [f"{self.place(f'{name}x{e}_{i}')}*z{i}" for i in range(n)]
            for j in split.harmonics:
                terms += [f"{self.place(f'{name}x{e}_c{j}')}*cos{j}", f"{self.place(f'{name}x{e}_s{j}')}*sin{j}"]
            lines.append(to.format(e, f"{' + '.join(terms)} + {self.place(f'{name}x{e}_constant')}"))
        return lines

    def _read(self) -> str:
        """The state of a lane at phase 0, into x."""
        lines = ["\n\n@scalar", "def read(k, S, l, x, q):"]
        for k, pool in enumerate(self.pools):
            if pool.split is not None:
                body = ["theta = 0.0", *self._from_modal(k, pool.split, "x[{}] = {}"), "return 0"]
                lines += [f"    if k == {k}:", *(f"        {line}" for line in body)]
        return "\n".join([*lines, "    for i in range(N):", "        x[i] = ld(S, i*NL, l)", "    return 0"]) + "\n"

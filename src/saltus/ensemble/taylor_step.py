"""The text of a Taylor step of many lanes: statements without branches, from a lane's state to that after the step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import sympy

from saltus.ensemble.labels import AT_STROBE, CHANGES, EVENT, GOES_ON, HUGE, STUCK
from saltus.ensemble.lane_kinds import domain_to_check
from saltus.system.writing.taylor import series_of_mode

if TYPE_CHECKING:
    from saltus.ensemble.lane_kinds import Pool
    from saltus.ensemble.lane_text import LaneText
    from saltus.system.writing.regularise import Regularised
    from saltus.system.writing.taylor import Series

__all__ = ["taylor_step"]

_LANDED = 1e-4  # last change of a landing, over the step, up to which it has converged: its cube is the error
_AT_PHASE_ZERO = 1e-13  # time left to phase 0, in periods, that is none
_RATIO = 0.9  # largest ratio of a step's last two terms
_TAIL = 12.0  # weight of the geometric series behind the last term, which is left out, in a step's error
_APPROACH = 0.75  # part of the way to a surface that a step goes at most, where a weak rest may grow near the surface
_SIGMA_WEIGHT = 0.3  # share of a step's error in sigma that counts: the whole makes labels and maps no better
_SIGMA_STEP = 4.0  # longest step in sigma
_MORE_IN_SIGMA = 2  # further coefficients of the series in sigma


def taylor_step(lane: LaneText, pool: Pool) -> tuple[list[str], list[str]]:
    """Return the statements of a Taylor step: those in parameters alone, and those of one lane."""
    n, form = lane.n_states, pool.form
    order = lane.order + (_MORE_IN_SIGMA if form is not None else 0)
    names = [f"x{i}" for i in range(n)] + (["theta"] if lane.has_phase else []) + ["w"]
    solved = form.solved(lane.system) if form is not None else None
    series = series_of_mode(lane.system, pool.mode, order, lane.text_of, form, names.__getitem__, solved)
    lines = [f"x{i} = {lane.load(i)}" for i in range(n)]
    lines.append(f"t = {lane.load('t')}")
    if lane.has_phase:
        lines.append(f"theta = {lane.number('rate')}*t")
    if form is not None:
        lines.append(f"w = {lane.load('w')}")
    lines += series.lines
    columns, transitions = series.columns, lane.events[pool.mode]
    about = -1 if form is None else transitions.index(form.transition)
    states = [i for i in range(n) if solved is None or i != solved[0]]
    moving, columns = columns[: len(states)], columns[len(states) :]
    (w, time), events = (columns[:2], columns[2:]) if form is not None else (("", ""), columns)
    lines.append(f"itol = {lane.load('itol')}")
    bent = [(j, e) for j, e in enumerate(lane.events[pool.mode]) if j != about and not _is_linear(lane, e)]
    for k in (order, order - 1, order - 2):
        sizes = [f"abs({name}_{k})*{lane.weight(i)}" for i, name in zip(states, moving, strict=True)]
        sizes += [f"abs({w}_{k})"] if form is not None else []
        sizes += [f"abs({events[j]}_{k})*{lane.event_weight(e)}" for j, e in bent]
        weight = "" if form is None else f"{_SIGMA_WEIGHT!r}*"
        least = "1e-30" if form is not None else lane.number(f"least{k}")  # what lets a step be as long as it may
        lines.append(f"e{k} = {_largest(sizes)}*({weight}itol) + {least}")
    lines += [
        f"h = min(root(e{order}, {float(order)!r}), root(e{order - 1}, {float(order - 1)!r}))",
        f"ratio = math.sqrt(e{order}/e{order - 2})",
        f"h = min(h, {_RATIO!r}/ratio)",
        "ratio = ratio*h",
        f"h = h*root(max({_TAIL!r}*ratio/(1.0 - ratio), 1.0), {float(order)!r})",
        f"h = min(min(h, {lane.load('cap')}), {_SIGMA_STEP if form is not None else lane.number('longest')})",
        *(f"h = min(h, root({' + '.join(ways)} + 1e-30, {float(k)!r}))" for k, ways in enumerate(series.ways, 1)),
        f"flag = {GOES_ON}",
    ]
    if any(p.split is not None and p.split.rest and p.mode == pool.mode for p in lane.pools):
        for j, k in enumerate(transitions):
            near, side = lane.number(f"far{pool.mode}_in"), lane.side_of(j, k)
            lines += [
                f"b, d = {side}*{events[j]}_0, {side}*{events[j]}_1",
                f"h = min(h, -{_APPROACH!r}*b/d) if (b > {near}) & (d < 0.0) else h",
            ]
    if form is None:
        lines += [f"left = {lane.number('period')} - t", "strobe = h >= left", "h = left if strobe else h"]
    else:
        lines += _landing_on_w(order, w, about)
    lines += ["is_stuck = False"] if form is None else []
    for j, k in enumerate(transitions):
        if j != about:
            lines += _landing(lane, order, events[j], j, k)
    if form is not None:
        lines += _strobe_in_sigma(lane, order, time)
    else:
        lines += [f"strobe = strobe & (flag == {GOES_ON})", "tn = t + h"]
    lines += [f"n{i} = {_value(name, order, 'h')}" for i, name in zip(states, moving, strict=True)]
    lines += [f"flag = {AT_STROBE} if strobe else flag"]
    if form is not None:
        lines += [f"nw = {_value(w, order, 'h')}", f"nw = 0.0 if flag == {EVENT + about} else nw"]
    if form is not None and solved is not None:
        lines += _without_series(lane, order, series, form, states, *solved)
    lines += _checked(lane, pool)
    lines += [
        *(lane.store(i, f"x{i} if is_stuck else n{i}") for i in range(n)),
        *([lane.store("w", "w if is_stuck else nw")] if form is not None else []),
        lane.store("t", "t if is_stuck else tn"),
        lane.store("flag", f"{STUCK} if is_stuck else flag"),
        lane.store("cap", f"0.5*h if is_stuck else {HUGE}"),
        lane.store("count", f"{lane.load('count')} + 1.0"),
        *(lane.store(lane.on(j), f"{lane.load(lane.on(j))} if is_stuck else 0.0") for j in range(lane.n_events)),
    ]
    return series.constants, lines


def _without_series(
    lane: LaneText, order: int, series: Series, form: Regularised, states: list[int], i: int, value: sympy.Expr
) -> list[str]:
    """State i at the end of a step, where it follows from the other states, w and the phase."""
    names: dict[sympy.Expr, str] = {form.w: "nw", **{lane.system.x[j]: f"n{j}" for j in states}}
    lines, waves = [], {}
    for j, (wave, name) in enumerate(series.phasors.items()):
        waves[wave] = sympy.Dummy()
        names[waves[wave]] = f"wave{j}"
        lines.append(f"wave{j} = {_value(name, order, 'h')}")
    return [*lines, f"n{i} = {lane.text_of(value.xreplace(waves), names)}"]


def _landing_on_w(order: int, w: str, j: int) -> list[str]:
    """A crossing is w changing sign; past it the series runs back along the mirrored orbit."""
    return [
        f"wh = {_value(w, order, 'h')}",
        "lands = wh < 0.0",
        f"c = (wh - {w}_0 - h*{w}_1)/(h*h)",
        f"s = math.sqrt(max({w}_1*{w}_1 - 4.0*c*{w}_0, 0.0))",
        f"g = 2.0*{w}_0/(s - {w}_1) if {w}_1 < 0.0 else ({w}_1 + s)/(-2.0*c)",
        "g = g if lands else h",
        _halley(w, order),
        f"ok = (abs(dg) < {_LANDED!r}*h) & (g > 0.0) & (g <= h)",
        "is_stuck = lands & (not ok)",
        "ok = lands & ok",
        f"flag = {EVENT + j} if ok else flag",
        "h = g if ok else h",
    ]


def _strobe_in_sigma(lane: LaneText, order: int, t: str) -> list[str]:
    """Where a step would pass phase 0 it ends just before it instead, and the next two or three come there."""
    return [
        f"tn = t + {_value(t, order, 'h')}",
        f"left = {lane.number('period')} - t",
        "passes = tn >= t + left",
        f"c = (tn - t - {t}_1*h)/(h*h)",
        f"g = 2.0*left/({t}_1 + math.sqrt(max({t}_1*{t}_1 + 4.0*c*left, 0.0)))",
        f"tg = {_value(t, order, 'g')}",
        f"strobe = passes & (abs(tg - left) < {_AT_PHASE_ZERO!r}*{lane.number('period')})",
        "ok = strobe | ((g > 0.0) & (g <= h) & (tg < left))",
        "is_stuck = is_stuck | (passes & (not ok))",
        f"flag = {GOES_ON} if passes else flag",
        "h = g if passes else h",
        "tn = t + tg if passes else tn",
    ]


def _landing(lane: LaneText, order: int, event: str, j: int, transition: int) -> list[str]:
    """The one crossing of an event function within the step: Bernstein's coefficients have one change of sign.

    On the surface the first of them is 0, and the others have the signs of those of the function over the time since.
    Where a motion touches the surface as it begins, the first two are 0.
    """
    side = lane.side_of(j, transition)
    touches = transition in lane.touches
    lines = [f"on = {lane.load(lane.on(j))} > 0.5", f"c0 = 0.0 if on else {side}*{event}_0", "u = h"]
    for i in range(1, order + 1):
        lines.append(f"c{i} = {side}*{event}_{i}*u")
        if i == 1 and touches:
            lines += [f"twice = {lane.load(lane.on(j))} > 1.5", "c1 = 0.0 if twice else c1"]
        if i < order:
            lines.append("u = u*h")
    for i in range(order + 1):
        terms = ", ".join(f"{math.comb(i, m) / math.comb(order, m)!r}, c{m}" for m in range(i + 1))
        lines.append(f"b{i} = products({terms})" if i else "b0 = c0")
    lines += [
        f"v{j} = b{order}",
        f"r{j} = {float(order)!r}*(b{order} - b{order - 1})/h",
        *([f"b1 = {0.5 * (order - 1)!r}*b2 if twice else b1"] if touches else []),
        f"b0 = {float(order)!r}*b1 if on else b0",
        f"rises = (not (b0 > 0.0)) | rises_again({', '.join(f'b{i}' for i in range(1, order + 1))})",
        f"lands = (not rises) & (b{order} <= 0.0)",
        f"g = b0/(b0 - b{order}) if lands else 1.0",
        _halley("c", order, sep=""),
        f"ok = (abs(dg) < {_LANDED!r}*(g if on else 1.0)) & (dy < 0.0) & (g > 0.0) & (g <= 1.0)",
        "is_stuck = is_stuck | rises | (lands & (not ok))",
        "ok = lands & ok",
        f"flag = {EVENT + j} if ok else flag",
        "h = h*g if ok else h",
    ]
    return lines


def _is_linear(lane: LaneText, transition: int) -> bool:
    """Whether an event function is linear in the states and knows no phase: then its series ends as theirs do."""
    event, states = lane.system.event[transition], lane.system.x[: lane.n_states]
    variables = set(lane.system.x)
    return not event.free_symbols & (variables - set(states)) and all(
        not event.diff(x).free_symbols & variables for x in states
    )


def _checked(lane: LaneText, pool: Pool) -> list[str]:
    """A state that is no number, or huge, is looked at; one far from all events may change to the exact flow."""
    size = _largest([f"abs(n{i})" for i in range(lane.n_states)])
    lines = [f"is_stuck = is_stuck | (not ({size} < {lane.number('limit')}))"]
    if (domain := domain_to_check(lane.system, pool.mode)) is not None:
        names = {symbol: f"n{i}" for i, symbol in enumerate(lane.system.x)}
        if lane.has_phase:
            lines.insert(0, f"n_theta = {lane.number('rate')}*tn")
            names[lane.system.x[-1]] = "n_theta"
        lines.append(f"is_stuck = is_stuck | (not ({lane.text_of(domain, names)} > 0.0))")
    if all(p.split is None or p.mode != pool.mode for p in lane.pools):
        return lines
    name = f"far{pool.mode}_"
    tests = [
        f"wait = {lane.load('wait')}",
        lane.store("wait", "wait - 1.0"),
        f"away = (flag == {GOES_ON}) & (wait < 0.5)",
    ]
    tests += [
        f"away = away & (v{j} > {lane.number(f'{name}out')})"
        f" & (v{j} + {lane.number(f'{name}ahead')}*r{j} > {lane.number(f'{name}in')})"
        for j in range(len(lane.events[pool.mode]))
    ]
    return [*lines, *tests, f"flag = {CHANGES} if away else flag"]


def _largest(terms: list[str]) -> str:
    value = terms[0]
    for term in terms[1:]:
        value = f"max({value}, {term})"
    return value


def _value(name: str, order: int, h: str) -> str:
    return f"polynomial({h}, {_coefficients(name, order)})"


def _halley(name: str, order: int, sep: str = "_") -> str:
    """Halley's iterations from g, into g, for a series to vanish; ``dg`` is the last change, ``dy`` a slope."""
    return f"g, dg, dy = halley(g, {_coefficients(name, order, sep)})"


def _coefficients(name: str, order: int, sep: str = "_") -> str:
    return ", ".join(f"{name}{sep}{k}" for k in range(order + 1))

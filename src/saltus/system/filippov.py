"""Filippov systems: from the fields on both sides of surfaces, a hybrid system with sliding modes.

docs/theory/filippov.md derives the sliding field and the conditions of the transitions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from saltus.errors import DefinitionError, nearest
from saltus.system.expressions import Names, parse, text_of
from saltus.system.hybrid import HybridSystem
from saltus.system.intersections import ABOVE, BELOW, ON, fields_at_intersections, rates_at, short, with_sign
from saltus.system.parts import (
    NO_FIELD,
    NO_WAY,
    NOWHERE,
    Mode,
    Transition,
    clean_phase,
    mapping_of,
    names_of,
    not_negative,
    sequence_of,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import sympy

__all__ = ["filippov", "lines_of"]

_NAMES = {ABOVE: "above", BELOW: "below", ON: "sliding"}  # modes where there is one surface
_SWITCHED = 1e300  # makes a positive number of doubles 1 or more, of which the lesser is a factor 1
_MOST = 4  # surfaces: there are 2**4 fields then


def filippov(
    states: Sequence[str],
    parameters: Mapping[str, float],
    *,
    surface: Any = None,
    above: Mapping[str, Any] | None = None,
    below: Mapping[str, Any] | None = None,
    surfaces: Sequence[Any] = (),
    fields: Mapping[str, Mapping[str, Any]] | None = None,
    phase: tuple[str, Any] | None = None,
    pull: Any = None,
    outputs: Mapping[str, Any] | None = None,
    groups: Mapping[str, Sequence[str]] | None = None,
    positive: Iterable[str] = (),
    parameter_bounds: Mapping[str, tuple[float, float]] | None = None,
    let: Mapping[str, Any] | None = None,
    angles: Iterable[str] = (),
    name: str = "",
) -> HybridSystem:
    """Return the hybrid system of a field that jumps on a surface, with its sliding motions.

    Motions cross the surface where both fields lead to the same side. They slide along it where both lead to it, by
    Filippov's convex combination of the fields. The modes are ``above``, ``below`` and ``sliding``.

    Parameters
    ----------
    states : sequence of str
        Names of the states, the phase excepted.
    parameters : mapping of str to float
        Parameters and their default values.
    surface : expression
        Function of state, phase and parameters that is zero on the surface.
    above, below : mapping of str to expression
        The field where `surface` is positive, and where it is negative.
    surfaces : sequence of expression, optional
        Several surfaces, up to 4, in place of `surface`.
    fields : mapping of str to mapping, optional
        The field of each region, in place of `above` and `below`. A region is a text of signs, one for each surface, as
        ``"+-"``. Regions that do not exist are left out. A sliding mode has ``0`` in the place of its surface.
    phase : (str, expression), optional
        Name and rate of an angle, as in `HybridSystem`.
    pull : expression of parameters, optional
        Rate at which a sliding mode takes a state that rounding has moved off the surface back to it. No motion on the
        surface depends on it. By default the rate of the phase, or 1.
    outputs, groups, positive, parameter_bounds, let, angles, name : optional
        As in `HybridSystem`.

    Returns
    -------
    HybridSystem
        Its `Mode.surface` tells sliding modes from others.

    Raises
    ------
    DefinitionError
        The fields are not given for both sides; they agree on a surface, so that none slides; neither crosses it.

    Notes
    -----
    With the surface h = 0 and the rates L+ and L- of h along both fields, the sliding field is
    (L- f+ - L+ f-)/(L- - L+). A motion slides where L+ < 0 < L- (Filippov 1988, section 4). Where L+ > 0 > L-, motions
    leave the surface to either side, so none is continued: a start there is refused.

    Where a motion that slides along one surface meets another surface, it goes on in the one way that there is: along
    either of them, into a region, or along both. Along both (mode ``"00"``) there is one way where the jumps at the two
    add up, and the rates at each know nothing of the other. So it is for frictions of two bodies, each of its own
    velocity. A motion ends with an error where there are several ways, or none.

    References
    ----------
    A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, Kluwer 1988.

    Examples
    --------
    >>> stick = filippov(
    ...     ("x", "v"), {"F": 0.4, "u": 0.3, "w": 0.6}, surface="v - u",
    ...     above={"x": "v", "v": "cos(theta) - x - F"}, below={"x": "v", "v": "cos(theta) - x + F"},
    ...     phase=("theta", "w"),
    ... )
    >>> stick.modes["sliding"]
    Mode(x' = v, v' = -w*(-u + v); domain 2*F > 0; surface -u + v = 0)
    """
    words, rates = _regions(surface, above, below, surfaces, fields)
    listed = names_of(states, "states")
    let = mapping_of(let, "let", "of names to expressions")
    phase = clean_phase(phase, (*listed, *parameters), let)
    every = (*listed, phase[0]) if phase else listed
    names = Names((*every, *parameters)).with_let(let)
    reader = _Reader(listed, phase, names)
    heights = [reader.read(text, f"surface {text!r}") for text in words]
    known = {word: reader.field(field, f"field {word!r}" if fields else _NAMES[word]) for word, field in rates.items()}
    if pull is None:
        pull = 1 if phase is None else phase[1]
    back = reader.read(pull, "pull")
    parts = _Parts(reader, heights, known, back)
    system = HybridSystem(
        listed, parameters, parts.modes(), parts.transitions(), phase=phase, outputs=outputs, groups=groups,
        positive=positive, parameter_bounds=parameter_bounds, let=let, angles=angles, name=name,
    )  # fmt: skip
    values = {symbol: system.parameters[symbol.name] for symbol in back.free_symbols}
    if (rate := back.subs(values)).is_negative:
        raise DefinitionError("pull", str(pull), f"0 or more, and it is {rate:.6g}", "motions leave the surface by it")
    return system


def lines_of(system: HybridSystem, mode: int, surface: str) -> str:
    """Return the call of `filippov` that says what signs and moduli in a field say; empty where there is none.

    Parameters
    ----------
    system : HybridSystem
        A system of one mode without transitions.
    mode : int
        Index of the mode.
    surface : str
        Argument of the signs and moduli.
    """
    import sympy

    if len(system.modes) > 1 or system.transitions:
        return ""
    names = (*system.all_states, *system.parameters)
    h = parse(surface, names, "surface")
    field = system.modes[system.mode_names[mode]].field
    sides = []
    for sign in (1, -1):
        known = {sympy.sign(h): sign, sympy.Abs(h): sign * h}
        rates = {key: parse(text, names, "field").subs(known) for key, text in field.items()}
        sides.append({key: text_of(rate, "field", names) for key, rate in rates.items()})
    named = system.mode_names[mode]
    outputs = {key: by_mode[named] for key, by_mode in system.outputs.items()}
    kept: dict[str, Any] = {
        "phase": system.phase,
        "outputs": outputs,
        "groups": dict(system.groups),
        "positive": system.positive,
    }
    kept |= {"parameter_bounds": dict(system.parameter_bounds), "angles": system.angles, "name": system.name}
    further = "".join(f", {key}={value!r}" for key, value in kept.items() if value)
    return (
        f"saltus.filippov({system.states!r}, {system.parameters!r}, surface={surface!r}, above={sides[0]!r}, "
        f"below={sides[1]!r}{further})"
    )


def _regions(
    surface: Any, above: Any, below: Any, surfaces: Any, fields: Any
) -> tuple[tuple[Any, ...], dict[str, Mapping[str, Any]]]:
    """Return the surfaces, and the field of each region by its signs."""
    single, several = (surface, above, below), (surfaces or None, fields)
    if all(part is not None for part in single) and all(part is None for part in several):
        return (surface,), {ABOVE: above, BELOW: below}
    if all(part is None for part in single) and all(part is not None for part in several):
        listed = sequence_of(surfaces, "surfaces", "of expressions")
        if len(listed) > _MOST:
            raise DefinitionError("surfaces", len(listed), f"at most {_MOST} surfaces")
        given = dict(mapping_of(fields, "fields", "of signs to fields"))
        for word in given:
            if not isinstance(word, str) or len(word) != len(listed) or set(word) - {ABOVE, BELOW}:
                wanted = f"a text of {len(listed)} signs, one for each surface, as {'+-+-'[: len(listed)]!r}"
                raise DefinitionError("fields", word, wanted)
        if not any(_flipped(word, i) in given for word in given for i in range(len(listed))):
            raise DefinitionError("fields", list(given), "of regions on both sides of a surface")
        return listed, given
    wanted = "surface=, above= and below= given for one surface, or surfaces= and fields= for several"
    raise DefinitionError("surface", surface if surface is not None else list(surfaces), wanted)


def _flipped(word: str, i: int) -> str:
    """Return the region on the other side of a surface."""
    return with_sign(word, i, BELOW if word[i] == ABOVE else ABOVE)


class _Reader:
    """Expressions of a definition as SymPy's, and back."""

    def __init__(self, states: tuple[str, ...], phase: tuple[str, str] | None, names: Names) -> None:
        import sympy

        self.states, self.names = states, names
        self.x = [sympy.Symbol(name, real=True) for name in states]
        self.rate = None if phase is None else self.read(phase[1], "phase")
        self.theta = None if phase is None else sympy.Symbol(phase[0], real=True)

    def read(self, expression: Any, where: str) -> sympy.Expr:
        return parse(text_of(expression, where, self.names), self.names, where)

    def field(self, field: Any, where: str) -> list[sympy.Expr]:
        given = mapping_of(field, where, "of states to rates")
        if missing := [name for name in self.states if name not in given]:
            wanted = f"an equation for each of {', '.join(self.states)}"
            raise DefinitionError(where, list(given), wanted, f"{missing[0]!r} is missing")
        if extra := [name for name in given if name not in self.states]:
            raise DefinitionError(where, extra[0], f"a state: {', '.join(self.states)}", nearest(extra[0], self.states))
        return [self.read(given[name], where) for name in self.states]

    def along(self, height: sympy.Expr, field: list[sympy.Expr]) -> sympy.Expr:
        """Return the rate of a function along a field."""
        import sympy

        rate = sum(sympy.diff(height, symbol) * f for symbol, f in zip(self.x, field, strict=True))
        return rate if self.theta is None else rate + sympy.diff(height, self.theta) * self.rate


@dataclass
class _Parts:
    """Modes and transitions of the regions and of sliding along each of their borders."""

    reader: _Reader
    heights: list[sympy.Expr]
    known: dict[str, list[sympy.Expr]]
    pull: sympy.Expr

    def __post_init__(self) -> None:
        self.sliding: dict[str, list[sympy.Expr]] = {}
        agreeing = None
        for word in self.known:
            for i in range(len(word)):
                if word[i] == ABOVE and _flipped(word, i) in self.known:
                    slide = self._slide(word, i)
                    if isinstance(slide, DefinitionError):
                        agreeing = slide
                    else:
                        self.sliding[with_sign(word, i, ON)] = slide
        if agreeing is not None and not self.sliding:
            raise agreeing
        self.stuck = fields_at_intersections(
            self.heights, self.known, self.sliding, self.reader.x, self.reader.along, self.pull
        )
        self.fields = {**self.known, **self.sliding, **self.stuck}
        self._made = [way for way in self._all_ways() if self._varies(way[2]) and not way[4].is_nonpositive]

    def rates(self, word: str) -> tuple[sympy.Expr, sympy.Expr]:
        """Return the rates of a sliding mode's surface along the fields above and below it."""
        i = word.index(ON)
        return tuple(self.reader.along(self.heights[i], self.known[with_sign(word, i, s)]) for s in (ABOVE, BELOW))

    def _slide(self, word: str, i: int) -> list[sympy.Expr] | DefinitionError:
        """Return the sliding field along surface i; an error, not raised, where both fields agree."""
        import sympy

        up, down = self.known[word], self.known[_flipped(word, i)]
        h = self.heights[i]
        rise, fall = self.rates(with_sign(word, i, ON))
        gradient = [sympy.diff(h, symbol) for symbol in self.reader.x]
        where = f"surface {h}"
        if not h.free_symbols & set(self.reader.x):
            raise DefinitionError("surface", str(h), "a function of the state")
        if sympy.expand(fall - rise) == 0:
            wanted = "crossed by the two fields at different rates"
            hint = "the fields agree on it, so nothing slides: two modes and a transition say the same"
            return DefinitionError(where, str(h), wanted, hint if sympy.expand(rise) != 0 else "no field crosses it")
        steep = sum(part**2 for part in gradient)
        back = [self.pull * h * part / steep for part in gradient]
        weight = short(fall / (fall - rise))
        found = []
        for a, b, off in zip(up, down, back, strict=True):
            slide = b if sympy.expand(a - b) == 0 else b + weight * (a - b)
            found.append(short(slide) - off)
        return found

    def _meeting(self, word: str, j: int) -> list[tuple[str, str, sympy.Expr, int, sympy.Expr]]:
        """Return the transitions where a sliding motion meets surface j: the one way on, or none.

        Each way has conditions: it leads off to the new side of surface j, and stays where it is. Its transition asks
        for all of them, and that no other way has all of its own.
        """
        import sympy

        from saltus.system.choices import Min

        i, along = word.index(ON), self.reader.along
        side = 1 if word[j] == ABOVE else -1
        beyond = _flipped(word, j)
        ways: dict[str, list[sympy.Expr]] = {}
        if beyond in self.sliding:
            rise, fall = self.rates(beyond)
            ways[beyond] = [-rise, fall, -side * along(self.heights[j], self.sliding[beyond])]
        for sign, up in ((ABOVE, 1), (BELOW, -1)):
            region = with_sign(beyond, i, sign)
            if region in self.known:
                field = self.known[region]
                ways[region] = [up * along(self.heights[i], field), -side * along(self.heights[j], field)]
            other = with_sign(with_sign(word, i, sign), j, ON)
            if other in self.sliding:
                rise, fall = self.rates(other)
                ways[other] = [-rise, fall, up * along(self.heights[i], self.sliding[other])]
        event, way = self.heights[j], -side
        if (both := with_sign(word, j, ON)) in self.stuck:
            ways[both] = self._held(both)
        least = {target: Min(*conditions) for target, conditions in ways.items()}
        made = [
            (word, target, event, way, Min(value, *(-least[other] for other in ways if other != target)))
            for target, value in least.items()
        ]
        return [*made, (word, NO_WAY, event, way, sympy.S.One)]

    def _held(self, word: str) -> list[sympy.Expr]:
        """Return what is positive where a motion slides along all surfaces of an intersection."""
        on = (i for i, sign in enumerate(word) if sign == ON)
        pairs = [rates_at(word, i, self.heights, self.known, self.reader.along) for i in on]
        return [value for rise, fall in pairs for value in (-rise, fall)]

    def _leaving(self, word: str, i: int) -> Iterator[tuple[str, str, sympy.Expr, int, sympy.Expr]]:
        """Go through the transitions from an intersection to either side of surface i."""
        rise, fall = rates_at(word, i, self.heights, self.known, self.reader.along)
        yield word, with_sign(word, i, ABOVE), rise, 1, fall
        yield word, with_sign(word, i, BELOW), fall, -1, -rise

    def _stuck_meeting(self, word: str, j: int) -> Iterator[tuple[str, str, sympy.Expr, int, sympy.Expr]]:
        """Go through the transitions where a motion at an intersection meets surface j: along it too, beyond, none."""
        import sympy

        from saltus.system.choices import Min

        side, event = 1 if word[j] == ABOVE else -1, self.heights[j]
        if (more := with_sign(word, j, ON)) in self.stuck:
            yield word, more, event, -side, Min(*self._held(more))
        if (beyond := _flipped(word, j)) in self.stuck:
            off = -side * self.reader.along(event, self.stuck[beyond])
            yield word, beyond, event, -side, Min(off, *self._held(beyond))
        yield word, NO_WAY, event, -side, sympy.S.One

    def name(self, word: str) -> str:
        return _NAMES.get(word, word)

    def modes(self) -> dict[str, Mode]:
        """Return the modes, regions first."""
        made = {}
        for word, field in self.fields.items():
            on = [h for h, sign in zip(self.heights, word, strict=True) if sign == ON]
            surface = None if not on else on[0] if len(on) == 1 else sum(abs(h) for h in on)
            domain = self._domain(word) if ON in word else None
            made[self.name(word)] = Mode(dict(zip(self.reader.states, field, strict=True)), domain, surface)
        for name in {NO_WAY, NO_FIELD} & {target for _, target, *_ in self._made}:
            made[name] = Mode(dict.fromkeys(self.reader.states, "0"), NOWHERE)
        return made

    def _domain(self, word: str) -> sympy.Expr | str | None:
        """Return the domain of a sliding mode, positive where a motion slides or has passed an event of the mode.

        Where fall - rise is not positive, both fields lead away from the surface, or one crosses it faster than the
        other. A rate that does not vary has no event: it is a factor of 0 or 1.
        """
        import sympy

        from saltus.system.choices import Max, Min

        conditions = []
        for i in (i for i, sign in enumerate(word) if sign == ON):
            rise, fall = rates_at(word, i, self.heights, self.known, self.reader.along)
            conditions.append(sympy.expand(fall - rise))
            conditions += [self._not_negative(rate) for rate in (-rise, fall) if not self._varies(rate)]
        if any(condition.is_nonpositive for condition in conditions):
            return NOWHERE
        unknown = [condition for condition in conditions if not condition.is_positive]
        varying = [condition for condition in unknown if self._varies(condition)]
        fixed = [condition for condition in unknown if condition not in varying]
        if not varying:
            return Min(*fixed) if fixed else None
        # a domain is smooth: a motion leaves it where the first of them vanishes
        least = sympy.Mul(*varying)
        return least * Max(sympy.S.Zero, Min(sympy.S.One, *(_SWITCHED * part for part in fixed))) if fixed else least

    def _not_negative(self, rate: sympy.Expr) -> sympy.Expr:
        """Return a condition that is positive where a rate is 0 or positive: a field along the surface slides, too."""
        import sympy

        if rate.is_negative or rate.is_nonnegative:
            return sympy.S.Zero if rate.is_negative else sympy.S.One
        return self.reader.read(not_negative(str(rate)), "rate")

    def _varies(self, value: sympy.Expr) -> bool:
        """Return whether an expression knows a state or the phase."""
        return bool(value.free_symbols & {*self.reader.x, self.reader.theta})

    def transitions(self) -> list[Transition]:
        """Return the transitions: from regions into sliding and across, out of sliding, and where surfaces meet."""
        made = [Transition(self.name(a), self.name(b), h, way, when=None if when.is_positive else when)
                for a, b, h, way, when in self._made]  # fmt: skip
        names = [one.name for one in made]  # of three surfaces a motion meets two from one side
        return [replace(one, name=f"{one.name} at {one.event}") if names.count(one.name) > 1 else one for one in made]

    def _all_ways(self) -> Iterator[tuple[str, str, sympy.Expr, int, sympy.Expr]]:
        """Go through sources, targets, events, directions and conditions of all transitions."""
        import sympy

        for word in self.known:
            for i, sign in enumerate(word):
                h, way = self.heights[i], -1 if sign == ABOVE else 1
                if (other := _flipped(word, i)) not in self.known:
                    yield word, NO_FIELD, h, way, sympy.S.One
                    continue
                beyond = -way * self.reader.along(h, self.known[other])
                if (slides := with_sign(word, i, ON)) in self.sliding:
                    yield word, slides, h, way, self._not_negative(beyond)
                yield word, other, h, way, -beyond
        for word in self.sliding:
            i = word.index(ON)
            rise, fall = self.rates(word)
            yield word, with_sign(word, i, ABOVE), rise, 1, fall
            yield word, with_sign(word, i, BELOW), fall, -1, -rise
            for j in range(len(word)):
                if j != i:
                    yield from self._meeting(word, j)
        for word in self.stuck:
            for i, sign in enumerate(word):
                yield from self._leaving(word, i) if sign == ON else self._stuck_meeting(word, i)

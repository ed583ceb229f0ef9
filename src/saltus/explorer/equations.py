"""Systems as text: what a system prints is read back, so that it can be typed and changed in the browser.

docs/explorer.md, "Equations as text", describes the lines.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from saltus.errors import DefinitionError, InputError, nearest
from saltus.system import HybridSystem, Map, Mode, Piece, Transition
from saltus.system.grammar import syntax_tree
from saltus.system.parts import not_negative

if TYPE_CHECKING:
    from saltus.system.definition import Definition

__all__ = ["LONGEST", "equations_of", "read_equations"]

LONGEST = 100_000  # characters of a text
_SMOOTH = "smooth"  # mode of equations before the first mode
_DIRECTIONS = {"falls": -1, "passes": 0, "rises": 1}
_EQUATION = re.compile(r"(\w+)\s*(?:'|′)\s*=\s*(.+)")
_IMAGE = re.compile(r"(\w+)\s*->\s*(.+)")
_PHASE = re.compile(r"(\w+)\s*'\s*=\s*(.+?)(?:,\s*modulo 2 pi)?")
_TRANSITION = re.compile(
    r"(?:(\w+)\s*:\s*)?(\w+)\s*->\s*(\w+)\s+when\s+(.+?)\s+(falls|rises|passes)\s+through\s+0"
    r"(?:\s+and\s+(.+?)\s*(>=?)\s*0)?((?:\s*,\s*\w+\s*:=\s*.+)?)"
)
_NAMED = re.compile(r"(HybridSystem|Map)(?:\s+(?:'([^']*)'|\"([^\"]*)\"))?")
_BOUNDS = re.compile(r"(\w+)\s+from\s+(\S+)\s+to\s+(\S+)")


@dataclass
class _Read:
    """What has been read so far."""

    kind: str = ""
    name: str = ""
    states: list[str] = field(default_factory=list)
    angles: list[str] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    phase: tuple[str, str] | None = None
    modes: dict[str, dict[str, Any]] = field(default_factory=dict)  # fields, domains and surfaces
    pieces: dict[str, dict[str, Any]] = field(default_factory=dict)  # images and conditions
    transitions: list[dict[str, Any]] = field(default_factory=list)
    outputs: dict[str, Any] = field(default_factory=dict)
    positive: list[str] = field(default_factory=list)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    part: str = ""  # the mode or piece to which equations belong
    expressions: list[tuple[int, str, str]] = field(default_factory=list)  # line, place and text of each


def read_equations(text: str) -> HybridSystem | Map:
    r"""Return the system or the map that a text describes, as `equations_of` and ``print(system)`` write it.

    Parameters
    ----------
    text : str
        One statement a line; ``#`` begins a comment.

    Raises
    ------
    DefinitionError
        A line that cannot be read, or an expression outside the grammar: the message begins with the line's number.

    Examples
    --------
    >>> print(read_equations("parameters k = 2, c = 0.1\nx' = v\nv' = -k*x - c*v"))
    HybridSystem
      states      x, v
      parameters  k = 2.0, c = 0.1
      mode smooth
        x' = v
        v' = -k*x - c*v
    >>> read_equations("x' = v\nv' = -sin(y)")
    Traceback (most recent call last):
        ...
    saltus.errors.DefinitionError: line 2, v' = '-sin(y)': must be in x, v and pi, but 'y' is unknown
    """
    if len(text) > LONGEST:
        raise DefinitionError("text", f"{len(text)} characters", f"of at most {LONGEST} characters")
    read = _Read()
    for number, line in _lines(text):
        try:
            _take(read, number, line)
        except InputError as error:
            raise _at(number, error) from None
    _check_expressions(read)
    try:
        return _built(read)
    except DefinitionError as error:
        raise _at(_line_of(read, error), error) from None


def equations_of(system: Definition) -> str:
    """Return a system as text: what it prints, and what parameters may be.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> print(equations_of(HybridSystem.smooth({"x": "-a*x"}, {"a": 1.0}, positive=["a"])))
    HybridSystem
      states      x
      parameters  a = 1.0
      mode smooth
        x' = -a*x
      positive    a
    """
    lines = [str(system)]
    if system.positive:
        lines.append(f"  positive    {', '.join(system.positive)}")
    lines += [f"  bounds      {name} from {low!r} to {high!r}" for name, (low, high) in system.parameter_bounds.items()]
    return "\n".join(lines)


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Go through the lines that say something, with their numbers."""
    for number, line in enumerate(text.splitlines(), 1):
        stripped = line.partition("#")[0].strip()
        if stripped:
            yield number, stripped


def _at(number: int, error: InputError) -> DefinitionError:
    """Return an error with the number of the line where it is."""
    name, value, allowed, hint = error.args
    return DefinitionError(f"line {number}, {name}" if number else name, value, allowed, hint)


def _take(read: _Read, number: int, line: str) -> None:
    """Take in one line."""
    if found := _EQUATION.fullmatch(line):
        _add_equation(read, number, *found.groups())
        return
    word, _, rest = line.partition(" ")
    if word in _STATEMENTS:
        _STATEMENTS[word](read, number, rest.strip())
    elif found := _IMAGE.fullmatch(line):
        _add_image(read, number, *found.groups())
    elif found := _NAMED.fullmatch(line):
        read.kind, read.name = found[1], found[2] or found[3] or ""
    else:
        known = [*_STATEMENTS, "x' = ...", "x -> ..."]
        raise DefinitionError("statement", line, f"one of {', '.join(known)}", nearest(word, _STATEMENTS))


def _expression(read: _Read, number: int, where: str, text: str) -> str:
    """Keep an expression for the check that follows when all names are known."""
    read.expressions.append((number, where, text))
    return text


def _once(where: str, text: str, known: bool) -> None:
    """Raise `DefinitionError` where something was written before: of two the last would hold without a word."""
    if known:
        raise DefinitionError(where, text, "written once", "it stands in a line before, or twice in this one")


def _add_equation(read: _Read, number: int, state: str, text: str) -> None:
    part = read.modes.setdefault(read.part or _SMOOTH, {"field": {}})
    _once(f"{state}'", text, state in part["field"])
    part["field"][state] = _expression(read, number, f"{state}'", text)


def _add_image(read: _Read, number: int, state: str, text: str) -> None:
    part = read.pieces.setdefault(read.part or "map", {"image": {}, "where": []})
    _once(f"{state} ->", text, state in part["image"])
    part["image"][state] = _expression(read, number, f"{state} ->", text)


def _states(read: _Read, number: int, rest: str) -> None:
    read.states += _split(rest)


def _angles(read: _Read, number: int, rest: str) -> None:
    read.angles += _split(rest.removesuffix("modulo 2 pi").rstrip(", "))


def _positive(read: _Read, number: int, rest: str) -> None:
    read.positive += _split(rest)


def _parameters(read: _Read, number: int, rest: str) -> None:
    for part in _split(rest):
        name, equals, value = part.partition("=")
        if not equals:
            raise DefinitionError("parameters", part, "a name and a number, as a = 1.5")
        _once("parameters", part, name.strip() in read.parameters)
        read.parameters[name.strip()] = _number(name.strip(), value)


def _bounds(read: _Read, number: int, rest: str) -> None:
    found = _matched(_BOUNDS, "bounds", rest, "a from 0 to 1")
    _once("bounds", rest, found[1] in read.bounds)
    read.bounds[found[1]] = _number(found[1], found[2]), _number(found[1], found[3])


def _phase(read: _Read, number: int, rest: str) -> None:
    found = _matched(_PHASE, "phase", rest, "theta' = w")
    _once("phase", rest, read.phase is not None)
    read.phase = found[1], _expression(read, number, f"phase {found[1]}'", found[2])


def _part(read: _Read, kind: str, rest: str) -> tuple[str, list[str]]:
    """Return the name of the mode or piece that begins here, and its conditions."""
    name, *conditions = _split(rest) or [""]
    if not name:
        raise DefinitionError(kind, rest, f"with a name, as {kind} free")
    read.part = name
    return name, conditions


def _mode(read: _Read, number: int, rest: str) -> None:
    name, conditions = _part(read, "mode", rest)
    made = read.modes.setdefault(name, {"field": {}})
    for condition in conditions:
        kind, _, text = condition.partition(" ")
        key, between = {"where": ("domain", ">"), "on": ("surface", "=")}.get(kind, ("", ">"))
        left, sign, zero = text.rpartition(between)
        if not key or not sign or zero.strip() != "0":
            raise DefinitionError(f"mode {name!r}", condition, "where EXPRESSION > 0, or on EXPRESSION = 0")
        _once(f"mode {name!r}", condition, key in made)
        made[key] = _expression(read, number, f"mode {name!r}", left.strip())


def _piece(read: _Read, number: int, rest: str) -> None:
    name, conditions = _part(read, "piece", rest)
    texts = [text for each in conditions for text in each.removeprefix("where ").split(" and ")]
    made = read.pieces.setdefault(name, {"image": {}, "where": []})
    for text in texts:
        left, sign, zero = text.rpartition(">")
        if not sign or zero.strip() != "0":
            raise DefinitionError(f"piece {name!r}", text, "where EXPRESSION > 0 and EXPRESSION > 0")
        made["where"].append(_expression(read, number, f"piece {name!r}", left.strip()))


def _transition(read: _Read, number: int, rest: str) -> None:
    found = _matched(_TRANSITION, "transition", rest, "NAME: A -> B when EXPRESSION falls through 0, x := EXPRESSION")
    name, source, target, event, way, when, sign, resets = found.groups()
    where = f"transition {name or f'{source}_to_{target}'!r}"
    _expression(read, number, where, event)
    reset = {}
    for part in _split(resets.lstrip(" ,")):
        state, assigned, text = part.partition(":=")
        if not assigned:
            raise DefinitionError(where, part, "x := EXPRESSION")
        _once(where, part, state.strip() in reset)
        reset[state.strip()] = _expression(read, number, where, text.strip())
    made: dict[str, Any] = {
        "source": source, "target": target, "event": event, "direction": _DIRECTIONS[way], "reset": reset,
    }  # fmt: skip
    if when is not None:
        _expression(read, number, where, when)
        made["when"] = not_negative(when) if sign == ">=" else when
    read.transitions.append(made | ({"name": name} if name else {}))


def _output(read: _Read, number: int, rest: str) -> None:
    name, equals, text = (part.strip() for part in rest.partition("="))
    if not equals or not name or not text:
        raise DefinitionError("output", rest, "NAME = EXPRESSION, or NAME = EXPRESSION in MODE; EXPRESSION in MODE")
    _once(f"output {name!r}", text, name in read.outputs)
    by_mode = [part.strip().rpartition(" in ") for part in text.split(";")]
    if all(mode for _, mode, _ in by_mode):
        modes = [mode for _, _, mode in by_mode]
        _once(f"output {name!r}", text, len({*modes}) < len(modes))
        read.outputs[name] = {mode: _expression(read, number, f"output {name!r}", each) for each, _, mode in by_mode}
    else:
        read.outputs[name] = _expression(read, number, f"output {name!r}", text)


_STATEMENTS: Mapping[str, Callable[[_Read, int, str], None]] = {
    "states": _states, "phase": _phase, "angles": _angles, "parameters": _parameters, "mode": _mode,
    "transition": _transition, "piece": _piece, "output": _output, "positive": _positive, "bounds": _bounds,
}  # fmt: skip


def _split(text: str) -> list[str]:
    """Return the parts between commas that stand in no brackets."""
    parts, depth = [""], 0
    for sign in text:
        depth += (sign == "(") - (sign == ")")
        if sign == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts if part.strip()]


def _matched(form: re.Pattern[str], where: str, text: str, example: str) -> re.Match[str]:
    found = form.fullmatch(text)
    if found is None:
        raise DefinitionError(where, text, f"as {example}")
    return found


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise DefinitionError(name, text.strip(), "a number") from None


def _check_expressions(read: _Read) -> None:
    """Raise `DefinitionError` at the line of the first expression outside the grammar."""
    states = read.states or _states_of(read)
    clock = [read.phase[0]] if read.phase is not None else []
    for number, where, text in read.expressions:
        try:
            syntax_tree(text, [*states, *clock, *read.parameters], where)
        except InputError as error:
            raise _at(number, error) from None


def _states_of(read: _Read) -> list[str]:
    """Return the states of which there are equations, in their order."""
    parts = [made["field"] for made in read.modes.values()] + [made["image"] for made in read.pieces.values()]
    return [*dict.fromkeys(name for part in parts for name in part)]


def _built(read: _Read) -> HybridSystem | Map:
    states = read.states or _states_of(read)
    shared: dict[str, Any] = {
        "outputs": read.outputs, "positive": read.positive, "parameter_bounds": read.bounds, "angles": read.angles,
        "name": read.name,
    }  # fmt: skip
    if read.pieces and (read.modes or read.transitions or read.phase is not None):
        raise DefinitionError("text", "x' = and x ->", "equations of one kind: of a flow, or of a map")
    if read.pieces or read.kind == "Map":
        pieces = {name: Piece(made["image"], where=made["where"]) for name, made in read.pieces.items()}
        return Map(states, read.parameters, pieces=pieces, **shared)
    if not read.modes:
        raise DefinitionError("text", "without equations", "one with equations, as x' = -a*x, or x -> a*x*(1 - x)")
    modes = {name: _made_mode(made, states) for name, made in read.modes.items()}
    transitions = [Transition(**made) for made in read.transitions]
    return HybridSystem(states, read.parameters, modes, transitions, phase=read.phase, **shared)


def _made_mode(made: dict[str, Any], states: list[str]) -> Mode:
    """Return a mode; one that lacks equations of some states lacks these states."""
    own = [name for name in states if name in made["field"]]
    lacks = {} if len(own) == len(states) or not own else {"states": own}
    return Mode(made["field"], domain=made.get("domain"), surface=made.get("surface"), **lacks)


def _line_of(read: _Read, error: DefinitionError) -> int:
    """Return the line that an error of the whole definition is about, 0 where none is found."""
    name, value = str(error.args[0]), str(error.args[1])
    for number, where, text in read.expressions:
        if text == value or (where.startswith(("mode", "transition", "output", "piece")) and name.startswith(where)):
            return number
    return 0

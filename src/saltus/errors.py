"""The exceptions of saltus: each says what is wrong, the value, and what is allowed."""

from __future__ import annotations

import difflib
import math
import reprlib
from collections.abc import Iterable
from itertools import islice
from typing import Any

__all__ = [
    "ChatteringError",
    "ConvergenceError",
    "DefinitionError",
    "DivergenceError",
    "InputError",
    "MapDivergenceError",
    "SaltusError",
    "StickingError",
    "StiffnessError",
    "UnknownNameError",
    "nearest",
    "shortened",
    "shown",
]

_LONGEST_NAME = 60  # characters of a message that name the argument, at most
_LONGEST_VALUE = 120  # characters of a message that show the value, at most
_LONGEST_HINT = 90  # characters of the hint, at most, where the message as a whole is too long
_LONGEST_STATE = 140  # characters of a message that show a state, at most: some seven components with all digits
_SHORTEST_STATE = 40  # characters that a state has in any case: two components
_LONGEST = 299  # characters of a message, at most
_LONGEST_TEXT = 1000  # characters of the longest text for which a similar name is sought


class SaltusError(Exception):
    """Any error that saltus raises on purpose.

    Examples
    --------
    >>> from saltus import InputError, SaltusError
    >>> issubclass(InputError, SaltusError)
    True
    """


class InputError(SaltusError, ValueError):
    """An argument that cannot be used.

    Parameters
    ----------
    name : str
        The argument.
    value : object
        The value given.
    allowed : str
        What is allowed, to be read after "must be".
    hint : str, optional
        What to do about it.

    Examples
    --------
    >>> print(InputError("parameter", "Omga", "one of the system's parameters", "did you mean 'Omega'?"))
    parameter = 'Omga': must be one of the system's parameters; did you mean 'Omega'?
    """

    def __init__(self, name: str, value: object, allowed: str, hint: str = "") -> None:
        super().__init__(name, value, allowed, hint)

    def __str__(self) -> str:
        name, value, allowed, hint = self.args
        name, value = shortened(name, _LONGEST_NAME), shown(value)
        room = _LONGEST - len(f"{name} = {value}: must be ")
        if hint and len(allowed) + len(hint) + 2 > room:
            hint = shortened(hint, max(_LONGEST_HINT, room - len(allowed) - 2))
        allowed = shortened(allowed, room - (len(hint) + 2 if hint else 0))
        return f"{name} = {value}: must be {allowed}" + (f"; {hint}" if hint else "")

    def __reduce__(self) -> tuple[Any, ...]:
        name, value, allowed, hint = self.args
        plain = value is None or type(value) in (str, int, float, bool)
        return type(self), (name, value if plain else _Told(shown(value)), allowed, hint), self.__dict__ or None


class UnknownNameError(InputError, KeyError):
    """A name under which a mapping of a result holds nothing.

    Examples
    --------
    >>> print(UnknownNameError("parameter", "Omga", "one of Omega, ybar", "did you mean 'Omega'?"))
    parameter = 'Omga': must be one of Omega, ybar; did you mean 'Omega'?
    """


class _Told(str):
    """How a value was shown, in an error that came from another process: the value itself may not travel."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


class DefinitionError(InputError):
    """A part of a system's definition that cannot be used; `name` says which mode or transition.

    Examples
    --------
    >>> print(DefinitionError("mode 'smooth'", "-k*x", "in x and pi, but 'k' is unknown"))
    mode 'smooth' = '-k*x': must be in x and pi, but 'k' is unknown
    """


class _MotionError(SaltusError):
    """A motion that ends early: when, where, and further arguments of the message."""

    def __init__(self, time: float, state: Iterable[float], mode: str, *further: object) -> None:
        super().__init__(time, tuple(float(x) for x in state), mode, *further)

    @property
    def time(self) -> float:
        """Time reached."""
        return float(self.args[0])

    @property
    def state(self) -> tuple[float, ...]:
        """State reached."""
        return tuple(self.args[1])

    @property
    def mode(self) -> str:
        """Mode at that time."""
        return str(self.args[2])


class ChatteringError(_MotionError):
    """Events accumulate: infinitely many in finite time (Zeno behaviour).

    Parameters
    ----------
    time, state, mode : float, sequence of float, str
        Where the motion ended.
    transition : str, optional
        The last event.

    Examples
    --------
    >>> ChatteringError(2.5, [0.0, 1e-9], "flight", "impact").transition
    'impact'
    """

    @property
    def transition(self) -> str:
        """The last event; empty where none is known."""
        return str(self.args[3]) if len(self.args) > 3 else ""

    def __str__(self) -> str:
        state = shortened(str(list(self.state)), _LONGEST_STATE)
        last = f", last event {shortened(self.transition, _LONGEST_NAME)!r}" if self.transition else ""
        return (
            f"chattering: events accumulate at t = {self.time:.12g} in mode {self.mode!r}, "
            f"state {state}{last}; the motion slides or rests there: add a mode for it"
        )


class StickingError(ChatteringError):
    """A motion is held where the field jumps, as by ``sign(v)`` at v = 0: both sides lead back to it.

    Parameters
    ----------
    time, state, mode : float, sequence of float, str
        Where the motion ended.
    surface : str
        Expression that vanishes where the field jumps.
    lines : str, optional
        The call by which the system is defined with a sliding mode.

    Examples
    --------
    >>> StickingError(1.0, [0.2, 0.0], "smooth", "v").surface
    'v'
    """

    def __init__(self, time: float, state: Iterable[float], mode: str, surface: str, lines: str = "") -> None:
        super().__init__(time, state, mode, surface)
        self.args = (*self.args, lines)

    @property
    def transition(self) -> str:
        """Nothing: no event happens."""
        return ""

    @property
    def surface(self) -> str:
        """Expression that vanishes where the field jumps."""
        return str(self.args[3])

    def __str__(self) -> str:
        return (
            f"sticking: the field of mode {self.mode!r} jumps at {self.surface} = 0 and holds the motion there from "
            f"t = {self.time:.12g} on, state {list(self.state)}; "
            + (f"define it as {self.args[4]}" if self.args[4] else "give each side a mode, and the surface one")
        )


class StiffnessError(_MotionError):
    """A motion takes more steps than are allowed for what was asked.

    Parameters
    ----------
    time, state, mode : float, sequence of float, str
        Where the motion ended.
    steps : int
        Steps spent.
    hint : str, optional
        What to try.
    stiff : bool, optional
        Whether stability, not accuracy, holds the steps. Without it the limit of work is all that is told.

    Examples
    --------
    >>> StiffnessError(0.5, [1.0], "smooth", 1000).steps
    1000
    """

    def __init__(
        self, time: float, state: Iterable[float], mode: str, steps: int, hint: str = "", stiff: bool = False
    ) -> None:
        super().__init__(time, state, mode, steps, hint, stiff)

    @property
    def stiff(self) -> bool:
        """Whether stability, not accuracy, holds the steps."""
        return bool(self.args[5])

    @property
    def steps(self) -> int:
        """Steps spent."""
        return int(self.args[3])

    def __str__(self) -> str:
        time, state, mode, steps, hint, stiff = self.args
        held = "it is stiff there: stability holds its steps, not accuracy"
        if not stiff:
            held = "a limit of work: its fastest time scale is very short against what is asked"
        text = f"{steps} steps took the motion only to t = {time:.6g}, mode {mode!r}, state {list(state)}: {held}"
        return text + (f"; {hint}" if hint else "")


class ConvergenceError(SaltusError):
    """A search did not converge, as Newton's method does from too far away.

    Parameters
    ----------
    what : str
        What was sought.
    residual : float
        Norm of the residual reached; 0, infinite or NaN where another reason than the residual is in the hint.
    iterations : int
        Iterations spent; 0 where none were.
    hint : str, optional
        What to try.
    unit : str, optional
        What `iterations` counts.

    Examples
    --------
    >>> print(ConvergenceError("periodic attractor", 0.02, 5311, unit="forcing periods"))
    periodic attractor: no convergence, residual 0.02 after 5311 forcing periods
    """

    def __init__(
        self, what: str, residual: float, iterations: int, hint: str = "", *, unit: str = "iterations"
    ) -> None:
        super().__init__(what, residual, iterations, hint)
        self.unit = unit  # an attribute, so that pickling keeps it beside the plain arguments

    @property
    def residual(self) -> float:
        """Norm of the residual reached."""
        return float(self.args[1])

    @property
    def iterations(self) -> int:
        """Iterations spent."""
        return int(self.args[2])

    def __str__(self) -> str:
        what, residual, iterations, hint = self.args
        failed = residual != 0.0 and math.isfinite(residual)  # else no residual says why
        text = f"{what}: no convergence, residual {residual:.3g}" if failed else f"{what}: not found"
        text += f" after {iterations} {self.unit}" if iterations else ""
        return shortened(text + (f"; {hint}" if hint else ""), _LONGEST)


class NotAnalyticError(SaltusError):
    """A definition has no Taylor series: it uses the sign or absolute value of what varies, or too high a power."""


class DivergenceError(_MotionError):
    """A trajectory leaves every bound.

    Parameters
    ----------
    time, state, mode : float, sequence of float, str
        Where the motion ended.
    reason : str
        What was seen.

    Examples
    --------
    >>> DivergenceError(1.0, [1e9], "smooth", "a state is beyond every bound").time
    1.0
    """

    def __init__(self, time: float, state: Iterable[float], mode: str, reason: str) -> None:
        super().__init__(time, state, mode, reason)

    def __str__(self) -> str:
        what = "motion ends" if (reason := self.args[3]).startswith("it comes to ") else "trajectory diverges"
        return _ended(f"the {what} at t = {self.time:.12g} in mode {self.mode!r}, state ", self.state, reason)


class MapDivergenceError(DivergenceError):
    """A motion of a map leaves every bound.

    Parameters
    ----------
    step, state, reason : int, sequence of float, str
        Iterations made, the state there, what was seen.

    Examples
    --------
    >>> MapDivergenceError(1024, [1e300], "a state is beyond every bound").step
    1024
    """

    def __init__(self, step: int, state: Iterable[float], reason: str) -> None:
        SaltusError.__init__(self, int(step), tuple(float(x) for x in state), reason)

    @property
    def step(self) -> int:
        """Iterations made."""
        return int(self.args[0])

    @property
    def mode(self) -> str:
        """Nothing: a diverged state is in no piece."""
        return ""

    def __str__(self) -> str:
        step, state, reason = self.args
        return _ended(f"the motion diverges at iteration {step}, state ", state, reason)


def _ended(where: str, state: Iterable[float], reason: str) -> str:
    """Return the message of a motion that ended: the state gives way before the reason, which names formulas."""
    room = _LONGEST - len(where) - len(reason) - 2
    told = shortened(str(list(state)), min(_LONGEST_STATE, max(room, _SHORTEST_STATE)))
    return shortened(f"{where}{told}: {reason}", _LONGEST)


class _Short(reprlib.Repr):
    """Representations of which no part is much longer than what is shown of a value."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 4
        self.maxtuple = self.maxlist = self.maxarray = self.maxdict = 30
        self.maxset = self.maxfrozenset = self.maxdeque = 30
        self.maxstring = self.maxlong = self.maxother = 2 * _LONGEST_VALUE

    def repr_dict(self, x: dict[Any, Any], level: int) -> str:
        """Return entries in their own order."""
        if level <= 0 and x:
            return "{...}"
        entries = [
            f"{self.repr1(k, level - 1)}: {self.repr1(v, level - 1)}" for k, v in islice(x.items(), self.maxdict)
        ]
        return f"{{{', '.join(entries + ['...'] * (len(x) > self.maxdict))}}}"

    def repr_int(self, x: int, level: int) -> str:
        """Return the size of an integer of which Python does not give all digits."""
        return repr(x) if x.bit_length() < 1000 else f"an integer of {x.bit_length()} bits"

    def repr_instance(self, x: object, level: int) -> str:
        """Return the name of the type where the object's own representation fails."""
        try:
            return shortened(repr(x), self.maxother)
        except Exception:  # whatever a representation raises, the message is about something else
            return f"<{type(x).__name__}>"

    repr_bytes = reprlib.Repr.repr_str  # cut before it is represented


_SHORT = _Short()


def shown(value: object) -> str:
    """Return the representation of a value on one short line, whatever the value.

    Examples
    --------
    >>> shown({"d": [1.0, None]}), shown(10**5000)
    ("{'d': [1.0, None]}", 'an integer of 16610 bits')
    >>> len(shown("long " * 1000)) <= 120
    True
    """
    try:
        text = _SHORT.repr(value)
    except Exception:  # as a type that only bears the name of a container may raise
        text = f"<{type(value).__name__}>"
    return shortened(" ".join(text.split()), _LONGEST_VALUE)


def shortened(text: str, most: int) -> str:
    """Return a text of at most `most` characters, its middle left out where it is longer.

    Whole words are left out, but of words that are longer than half of what is shown.

    Examples
    --------
    >>> shortened("one of alpha, beta, gamma, delta", 20)
    'one of ... delta'
    """
    text = str(text)
    if len(text) <= most:
        return text
    end = (most - 3) // 2
    head, tail = text[: most - 3 - end], text[len(text) - end :]
    if not text[len(head)].isspace() and head.rfind(" ") >= len(head) // 2:
        head = head[: head.rfind(" ") + 1]
    if not text[len(text) - end - 1].isspace() and 0 <= tail.find(" ") <= len(tail) // 2:
        tail = tail[tail.find(" ") :]
    return f"{head}...{tail}"


def nearest(name: object, names: Iterable[str]) -> str:
    """Return a hint naming the entry of `names` nearest to `name`, or an empty string; so for what is no text.

    Examples
    --------
    >>> nearest("Omga", ["Omega", "ybar"])
    "did you mean 'Omega'?"
    """
    known = list(names) if isinstance(name, str) and len(name) <= _LONGEST_TEXT else []
    found = [other for other in known if other.casefold() == str(name).casefold()]
    found = found or (difflib.get_close_matches(str(name), known, n=1, cutoff=0.5) if known else [])
    return f"did you mean {found[0]!r}?" if found else ""

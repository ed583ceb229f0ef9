"""The exceptions of saltus: each says what is wrong, the value, and what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = [
    "ChatteringError",
    "ConvergenceError",
    "DefinitionError",
    "DivergenceError",
    "InputError",
    "SaltusError",
    "nearest",
]


class SaltusError(Exception):
    """Any error that saltus raises on purpose."""


class InputError(SaltusError, ValueError):
    """An argument that cannot be used.

    Parameters
    ----------
    name : str
        The argument.
    value : object
        What was given.
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
        return f"{name} = {value!r}: must be {allowed}" + (f"; {hint}" if hint else "")


class DefinitionError(InputError):
    """A part of a system's definition that cannot be used; `name` says which mode or transition."""


class ChatteringError(SaltusError):
    """Events accumulate: infinitely many in finite time (Zeno behaviour).

    Parameters
    ----------
    time : float
        Time reached.
    state : sequence of float
        State there.
    mode : str
        Mode there.
    """

    def __init__(self, time: float, state: Iterable[float], mode: str) -> None:
        super().__init__(time, tuple(float(x) for x in state), mode)

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

    def __str__(self) -> str:
        return (
            f"chattering: events accumulate at t = {self.time:.12g} in mode {self.mode!r}, "
            f"state {list(self.state)}; the motion slides or rests there: add a mode for it"
        )


class ConvergenceError(SaltusError):
    """A search did not converge, as Newton's method does from too far away.

    Parameters
    ----------
    what : str
        What was sought.
    residual : float
        Norm of the residual reached.
    iterations : int
        Iterations spent.
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
        text = f"{what}: no convergence, residual {residual:.3g} after {iterations} {self.unit}"
        return text + (f"; {hint}" if hint else "")


class DivergenceError(SaltusError):
    """A trajectory leaves every bound.

    Parameters
    ----------
    time : float
        Time reached.
    state : sequence of float
        State there.
    mode : str
        Mode there.
    reason : str
        What was seen.
    """

    def __init__(self, time: float, state: Iterable[float], mode: str, reason: str) -> None:
        super().__init__(time, tuple(float(x) for x in state), mode, reason)

    def __str__(self) -> str:
        time, state, mode, reason = self.args
        return f"the trajectory diverges at t = {time:.12g} in mode {mode!r}, state {list(state)}: {reason}"


def nearest(name: str, names: Iterable[str]) -> str:
    """Return a hint naming the entry of `names` nearest to `name`, or an empty string.

    Examples
    --------
    >>> nearest("Omga", ["Omega", "ybar"])
    "did you mean 'Omega'?"
    """
    found = difflib.get_close_matches(name, list(names), n=1, cutoff=0.5)
    return f"did you mean {found[0]!r}?" if found else ""

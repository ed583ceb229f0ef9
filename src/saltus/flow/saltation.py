"""The saltation matrix: how a perturbation of the state passes an event."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.system.own_states import absent_states

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["saltation_at", "saltation_matrix"]


def saltation_matrix(
    system: HybridSystem,
    parameters: Mapping[str, float] | None,
    transition: str,
    x_before: ArrayLike,
) -> NDArray[np.float64]:
    """Return the saltation matrix of a transition, shape (all states, all states).

    With the event function h, the reset g, and the fields f1 before and f2 after the event,
    ``S = Dg + (f2(g(x)) - Dg f1(x)) dh / (dh f1(x))``: a perturbation of the state before the event, carried to the
    time of the unperturbed event, becomes S times it after. A phase is one of the states, so that no further terms in
    time are needed.

    Parameters
    ----------
    system : HybridSystem
        The system of the transition.
    parameters : mapping of str to float, or None
        Values that differ from the defaults.
    transition : str
        Name of the transition.
    x_before : array_like, shape (states,) or (all states,)
        State just before the event, on its surface.

    Returns
    -------
    ndarray, shape (all states, all states)
        Of modes with states of their own: (states of the target, states of the source).

    Raises
    ------
    InputError
        An unknown transition, or one that is grazed: ``dh f1 = 0``.

    References
    ----------
    M. A. Aizerman, F. R. Gantmakher, On the stability of periodic motions, J. Appl. Math. Mech. 22 (1958) 1065-1078;
    M. di Bernardo, C. J. Budd, A. R. Champneys, P. Kowalczyk, Piecewise-smooth Dynamical Systems, Springer 2008,
    chapter 2.

    Examples
    --------
    >>> from saltus.system.hybrid import HybridSystem, Mode, Transition
    >>> ball = HybridSystem(
    ...     states=("z", "v"),
    ...     parameters={"g": 1.0, "e": 0.5},
    ...     modes={"flight": Mode({"z": "v", "v": "-g"})},
    ...     transitions=[Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="impact")],
    ... )
    >>> saltation_matrix(ball, None, "impact", [0.0, -1.0])
    array([[-0.5,  0. ],
           [ 1.5, -0.5]])
    """
    names = system.transition_names
    k = names.index(checks.chosen("transition", transition, names))
    x = system.full_state(x_before, "x_before", system.transitions[k].source)
    return saltation_at(system, system.compiled.extended(system.parameter_vector(parameters)), k, x)


def saltation_at(
    system: HybridSystem, extended: NDArray[np.float64], k: int, x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return `saltation_matrix` of a transition by its place, at a full state, with extended parameters."""
    compiled, n = system.compiled, system.compiled.n
    event, after, jacobian, f1, f2 = (np.empty(size) for size in (2 + 2 * n, n, n * n, n, n))
    compiled.call("event_x", k, 0, x, extended, event)
    compiled.call("reset", k, 0, x, extended, after)
    compiled.call("reset_x", k, 0, x, extended, jacobian)
    reset_x = jacobian.reshape(n, n)
    ends = (system.transitions[k].source, system.transitions[k].target)
    source, target = (system.mode_names.index(mode) for mode in ends)
    compiled.call("field", source, 0, x, extended, f1)
    compiled.call("field", target, 0, after, extended, f2)
    event_x = event[2 : 2 + n]
    rate = float(event_x @ f1)
    if abs(rate) <= 1e-14 * float(np.abs(event_x) @ np.abs(f1)):
        hint = "the motion grazes the surface, where no saltation matrix exists"
        raise InputError(
            f"normal velocity at transition {system.transition_names[k]!r}", rate, "different from 0", hint
        )
    full = np.asarray(reset_x + np.outer(f2 - reset_x @ f1, event_x) / rate)
    return np.delete(np.delete(full, absent_states(system, target), axis=0), absent_states(system, source), axis=1)

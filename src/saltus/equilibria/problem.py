"""Equilibria of one mode as the zeros of its field, with derivatives up to the third.

docs/theory/equilibria.md, "Equations", says how they are used.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import InputError
from saltus.flow.starting import negative_root
from saltus.scales import NEWTON_AT_ROUNDING, TERMS_FAINT
from saltus.system.integrals.laws import Leaf

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["EquilibriumProblem", "check_autonomous", "over_terms"]

_ROUNDING = 1e-12  # residual, over the sizes of the field's terms, that is rounding
_NEARBY = 0.1  # distance of a state nearby, in sizes of the states


@dataclass
class EquilibriumProblem:
    """The equations f(x, p) = 0 of an equilibrium; the unknowns are the state, then the active parameters."""

    system: HybridSystem  # an autonomous system
    mode: int  # the mode whose field vanishes
    p: NDArray[np.float64]  # shape (parameters,): all parameters; the active ones are overwritten by the unknowns
    active: Sequence[int] = ()  # parameters among the unknowns, growing
    # shape (active,): units of the active parameters
    scales: NDArray[np.float64] = field(default_factory=lambda: np.ones(0))
    # shape (laws,): totals that the system conserves; by default those of the first state that is looked at
    totals: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        self._kept: tuple[NDArray[np.int64], NDArray[np.float64]] | None = None
        self.n, self.period = len(self.system.states), 1
        self.circles = self.system.angle_places
        self.p = self.p.copy()
        self._active = np.array(self.active, dtype=np.int64)
        self.scales = np.array(self.scales, dtype=np.float64)
        self.compiled = self.system.compiled
        self.compiled.check_powers(self.system, [self.mode])

    def in_mode(self, mode: int) -> EquilibriumProblem:
        """Return the same equations for another mode."""
        return EquilibriumProblem(self.system, mode, self.p, self.active, self.scales, self.totals)

    def parameters_at(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all parameters, shape (parameters,), where the unknowns are `u`."""
        p = self.p.copy()
        p[self._active] = u[self.n :] * self.scales
        return p

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the field, shape (n,), and its derivatives in the unknowns, shape (n, n + active).

        Where the system has linear integrals, so many of the equations follow from the others. Of one state to each
        integral the rate by which the totals would return to the given ones is added; docs/theory/conserved.md.
        """
        from saltus.equilibria.kernels.field import field_at

        F, J = np.empty(self.n), np.empty((self.n, self.n + self._active.size))
        field_at(*self._arguments(u), F, J)
        if self.system.laws.names:
            self._keep_totals(u, F, J)
        return F, J

    def _keep_totals(self, u: NDArray[np.float64], F: NDArray[np.float64], J: NDArray[np.float64]) -> None:
        laws, x, p = self.system.laws, u[: self.n], self.parameters_at(u)
        if self.totals is None:
            self.totals = laws.totals(x, p)
        if self._kept is None:
            A = J[:, : self.n]
            leaf = Leaf(laws.matrix(p), np.abs(x))
            # the totals return as fast as the terms of that state's rate change it
            sizes = np.where(x != 0.0, np.abs(x), float(np.abs(x).max(initial=0.0)) or 1.0)
            rates = (np.abs(A[leaf.follow]) @ sizes) / sizes[leaf.follow]
            usual = float(rates.max()) if np.isfinite(rates).all() and rates.max() > 0.0 else 1.0
            rates = np.where(np.isfinite(rates) & (rates > 0.0), rates, usual)
            self._kept = leaf.follow, rates[:, None] * leaf.turn
        follow, turn = self._kept
        F[follow] -= turn @ (laws.matrix(p) @ x - self.totals)
        J[follow, : self.n] -= turn @ laws.matrix(p)
        for k, index in enumerate(self.active):
            J[follow, self.n + k] -= self.scales[k] * (turn @ (laws.matrix(p, index) @ x))

    def with_totals(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return unknowns that have the totals kept to the last digit, by the states that follow from the others."""
        if self._kept is None or self.totals is None:
            return u
        found, matrix = u.copy(), self.system.laws.matrix(self.parameters_at(u))
        follow = self._kept[0]
        found[follow] -= np.linalg.solve(matrix[:, follow], matrix @ u[: self.n] - self.totals)
        return found

    def within(self, u: NDArray[np.float64], A: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the field's derivative at given totals, of that in all states: its eigenvalues tell stability.

        u : ndarray, shape (n + active,); A : ndarray, shape (..., n, n).
        """
        if not self.system.laws.names:
            return A
        return Leaf(self.system.laws.matrix(self.parameters_at(u)), np.abs(u[: self.n])).within(A)

    def matrices(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return derivatives of the field at given totals at unknowns (places, n + active): see `within`."""
        from saltus.equilibria.kernels.field import matrices_at

        found = np.empty((len(places), self.n, self.n))
        matrices_at(*self._arguments(places), found)
        if not self.system.laws.names:
            return found
        return np.array([self.within(u, A) for u, A in zip(places, found, strict=True)])

    def _arguments(self, u: NDArray[np.float64]) -> tuple[Any, ...]:
        extended = np.zeros(self.p.size + self.compiled.n_constants)
        extended[: self.p.size] = self.p
        unknowns = np.ascontiguousarray(u, dtype=np.float64)
        return self.compiled.addresses, self.mode, unknowns, extended, self._active, self.scales

    def second(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the Jacobian in the unknowns along `v`, both shape (n, n + active)."""
        units = np.concatenate([np.ones(self.n), self.scales])
        p = self.parameters_at(u)
        found = np.asarray(self.system.second(tuple(self.active)).field(self.mode, u[: self.n], v * units, p) * units)
        if self.system.laws and self.active:
            if self._kept is None:
                self.evaluate(u)
            self._bend_totals(u, v, p, found)
        return found

    def _bend_totals(
        self, u: NDArray[np.float64], v: NDArray[np.float64], p: NDArray[np.float64], found: NDArray[np.float64]
    ) -> None:
        """Add the derivative along `v` of what `_keep_totals` adds to the Jacobian."""
        assert self._kept is not None
        (follow, turn), laws, n = self._kept, self.system.laws, self.n
        for k, index in enumerate(self.active):
            slopes = self.scales[k] * (turn @ laws.matrix(p, index))
            found[follow, :n] -= v[n + k] * slopes
            found[follow, n + k] -= slopes @ v[:n]
            for m, other in enumerate(self.active):
                twice = turn @ (laws.matrix(p, index, other) @ u[:n])
                found[follow, n + k] -= self.scales[k] * self.scales[m] * v[n + m] * twice

    def third(self, u: NDArray[np.float64], *directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the third derivative of the field in the state along three directions, shape (n,)."""
        return self.system.third.field(self.mode, u[: self.n], *directions, p=self.parameters_at(u))

    def event(self, transition: int, u: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return the event function of a transition and its gradient in the unknowns, shape (n + active,)."""
        n, p = self.n, self.compiled.extended(self.parameters_at(u))
        x, out, own = np.ascontiguousarray(u[:n]), np.empty(2 + 2 * n), np.empty(2)
        self.compiled.call("event_x", transition, 0, x, p, out)
        gradient = np.empty(n + self._active.size)
        gradient[:n] = out[2 : 2 + n]
        for k, (index, scale) in enumerate(zip(self.active, self.scales.tolist(), strict=True)):
            self.compiled.call("event_p", transition, int(index), x, p, own)
            gradient[n + k] = own[0] * scale
        return float(out[0]), gradient

    def guard(self, index: int, u: NDArray[np.float64]) -> float:
        """Return a guard: the domain function of a mode, or behind these the condition of a transition."""
        out = np.empty(1)
        p = self.compiled.extended(self.parameters_at(u))
        self.compiled.call("guard", index, 0, np.ascontiguousarray(u[: self.n]), p, out)
        return float(out[0])

    def negative_root(self, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> str:
        """Return in words which root of the field has a negative argument, beyond the errors of the states, if any."""
        errors = NEWTON_AT_ROUNDING * sizes
        return negative_root(self.system, self.mode, u[: self.n], self.parameters_at(u), errors)

    def reset(self, transition: int, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns behind the reset of a transition."""
        landed = u.copy()
        p = self.compiled.extended(self.parameters_at(u))
        x, out = np.ascontiguousarray(u[: self.n]), np.empty(self.n)
        self.compiled.call("reset", transition, 0, x, p, out)
        landed[: self.n] = out
        return landed

    @property
    def ways_out(self) -> list[int]:
        """Transitions that leave the mode."""
        name = self.system.mode_names[self.mode]
        return [k for k, transition in enumerate(self.system.transitions) if transition.source == name]

    def rounding(self, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]) -> float:
        """Return the largest component of the field over what the states' sizes make of its terms.

        Where terms cancel, as at a saddle-node, those of a state nearby are taken as well.
        """
        F = np.abs(self.evaluate(u)[0])
        found = over_terms(F, np.abs(J[:, : self.n]) @ sizes)
        if found <= _ROUNDING:
            return found
        nearby = u.copy()
        nearby[: self.n] += _NEARBY * sizes
        A = np.maximum(np.abs(J[:, : self.n]), np.abs(self.evaluate(nearby)[1][:, : self.n]))
        return min(found, over_terms(F, A @ sizes)) if np.isfinite(A).all() else found


def over_terms(F: NDArray[np.float64], terms: NDArray[np.float64]) -> float:
    """Return the largest of the equations' moduli F over their terms; one without terms is rounding of the others."""
    top = float(terms.max())
    return float((F / np.maximum(terms, TERMS_FAINT * top)).max()) if top > 0.0 else float(F.max())


def check_autonomous(system: HybridSystem) -> None:
    """Raise `InputError` where a system is forced: it has no equilibria."""
    if system.phase is not None:
        hint = "a forced system has periodic orbits in place of equilibria: find_orbit, continue_orbit"
        raise InputError("system", system.name or "a forced system", "autonomous, without a phase", hint)

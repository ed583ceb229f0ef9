"""Cages: sets of states from which no motion of a nearly linear mode ever meets an event, by a theorem.

Let the field of a mode be ``A x + forcing(t) + r``, with A stable and diagonalisable, and let its event functions be
affine in the state. In the coordinates ``zeta_i = l_i . (x - response(t))`` of the left eigenvectors of A about the
periodic response of the linear part,

    |zeta_i|' <= -alpha_i |zeta_i| + |l_i . r|,        alpha_i = -Re lambda_i > 0.

While an event function h, of gradient g, is at least d, let ``|r_f| <= R_f``. Then ``max(|zeta_i|, c_i)`` does not
grow, where ``c_i = sum_f |l_if| R_f / alpha_i``. Since ``h = h_response + sum_i gamma_i zeta_i``, gamma_i being g along
the i-th right eigenvector, the set

    sum_i |gamma_i| max(|zeta_i|, c_i) < h_min - d

keeps h above d, so that no motion ever leaves it: it is the cage. All motions in it converge to one periodic orbit
where ``sum_i |gamma_i| b_i / alpha_i < 1``, with ``b_i = sum_f |l_if| sup |dr_f / dh|``. docs/theory/basins.md, "Cages:
a theorem", has the proofs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.result import frozen

if TYPE_CHECKING:
    import sympy
    from numpy.typing import NDArray

    from saltus.ensemble.modal import LinearPart
    from saltus.system import HybridSystem
    from saltus.system.writing.linear_split import Split

__all__ = ["Cage", "cage_of"]

_FRACTIONS = np.linspace(0.005, 0.995, 199)  # distances from the events that are tried, over the linear response's own


@dataclass(frozen=True)
class Cage:
    """The set ``sum_i max(|rows_i . (x - centre)|, floors_i) < bound`` of states at phase 0 in one mode."""

    mode: int  # index of the mode
    centre: NDArray[np.float64]  # shape (n,): the linear response at phase 0
    # shape (coordinates, n): weighted left eigenvectors; one of each conjugate pair, with twice the weight
    rows: NDArray[np.complex128]
    # shape (coordinates,): bound c_i, weighted, up to which the rest of the field can drive each coordinate
    floors: NDArray[np.float64]
    bound: float
    distances: NDArray[np.float64]  # shape (events,): least value of each event function along motions in the cage
    rates: NDArray[np.float64]  # shape (coordinates,): decay rates alpha_i of the coordinates
    # ``sum_i |gamma_i| b_i / alpha_i`` of the convergence theorem; below 1 all motions converge to one orbit
    contraction: float

    def sizes(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``sum_i max(|rows_i . (x - centre)|, floors_i)`` at states, shape (m, n)."""
        moduli = np.abs((x - self.centre) @ self.rows.T)
        return np.asarray(np.maximum(moduli, self.floors).sum(axis=1))


def cage_of(
    system: HybridSystem, parameters: Mapping[str, float] | None, mode: str, fraction: float | None = None
) -> Cage | None:
    """Return the cage of a mode, or None where the theorem gives none.

    The theorem has five conditions. The field is linear, with harmonic forcing and a rest that is a rational function
    of one event function. The event functions are affine. The linear part is stable. Its periodic response meets no
    event. The rest is weak enough.

    Parameters
    ----------
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    fraction : float, optional
        Distance of motions from the events, over the least distance of the linear response; by default the one with the
        largest cage.

    Notes
    -----
    The rest's supremum over an interval of distances is taken at the two ends. The rest is monotonic between them: its
    derivative has no zero there, by Sturm's theorem in rational arithmetic.

    Examples
    --------
    >>> from saltus.system.hybrid import HybridSystem, Mode, Transition
    >>> stopped = HybridSystem(
    ...     ("x", "v"), {"w": 2.0, "A": 1.0}, {"free": Mode({"x": "v", "v": "-x - 0.2*v + A*cos(s)"})},
    ...     [Transition("free", "free", "x - 1", 1, {"v": "-0.8*v"}, name="impact")], phase=("s", "w"),
    ... )
    >>> cage = cage_of(stopped, {}, "free")
    >>> print(round(cage.bound, 3), cage.contraction)  # the response's amplitude is 1/sqrt(9 + 0.16)
    0.666 0.0
    """
    from saltus.ensemble.modal import linear_parts
    from saltus.system.derivatives import Symbolic
    from saltus.system.writing.linear_split import split_of_mode

    p, index = system.parameter_vector(parameters), system.mode_index(mode)
    x = system.full_state(np.zeros(len(system.states)))
    rate = float(system.compiled.field(index, x, p)[-1]) if system.phase is not None else 0.0
    part = linear_parts(system, p, rate, system.turn / rate if rate else math.inf).get(index)
    linear = None if part is None else _Linear.of(part)
    if linear is None:
        return None
    symbolic = Symbolic(system)
    split = split_of_mode(symbolic, index)
    values = dict(zip(symbolic.p, p.tolist(), strict=True))
    if split is None or not _domain_held(symbolic, index, linear, values):
        return None
    rests = [_Rest.of(split, f, expression, linear, values) for f, expression in split.rest.items()]
    known = [rest for rest in rests if rest is not None]
    if len(known) < len(rests):
        return None
    found = (_caged(index, linear, known, float(f)) for f in (_FRACTIONS if fraction is None else [fraction]))
    ranked = sorted((cage for cage in found if cage is not None), key=_extent, reverse=True)
    return next((cage for cage in ranked if all(rest.proven(linear, cage) for rest in known)), None)


@dataclass(frozen=True)
class _Linear:
    """The linear part in modal coordinates: rates, left eigenvectors, weights; event functions along its response.

    The signs of event functions make them positive along the response.
    """

    rates: NDArray[np.float64]
    left: NDArray[np.complex128]
    weights: NDArray[np.float64]
    centre: NDArray[np.float64]
    signs: NDArray[np.float64]
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]

    @property
    def unit(self) -> float:
        """The least distance from any event."""
        return float(self.lows.min())

    @classmethod
    def of(cls, part: LinearPart) -> _Linear | None:
        """Return the linear part about its response; None where it is unstable, or its response meets an event."""
        if not len(part.events) or not np.all(part.eigenvalues.real < 0.0):
            return None
        bounds = np.array(
            [
                _extremes(constant, np.hypot(cosines, sines))
                for constant, cosines, sines in zip(
                    part.event_constants, part.event_cosines, part.event_sines, strict=True
                )
            ]
        )
        signs = np.sign(bounds[:, 0])
        if not np.all(signs * bounds[:, 1] > 0.0):
            return None
        ends = np.sort(signs[:, None] * bounds, axis=1)
        kept = part.eigenvalues.imag >= 0.0
        twice = np.where(part.eigenvalues.imag > 0.0, 2.0, 1.0)[kept]
        shares = np.abs(part.events @ part.basis[:, kept]) / ends[:, :1]
        return cls(
            -part.eigenvalues.real[kept],
            np.linalg.inv(part.basis)[kept].astype(np.complex128),
            twice * shares.max(axis=0) * float(ends[:, 0].min()),
            part.constant + part.cosines.sum(axis=0),
            signs,
            ends[:, 0],
            ends[:, 1],
        )


def _extremes(constant: float, amplitudes: NDArray[np.float64]) -> tuple[float, float]:
    """Return lower and upper bounds of a trigonometric sum, exact for one harmonic."""
    swing = float(amplitudes.sum())
    return constant - swing, constant + swing


def _domain_held(symbolic: Any, mode: int, linear: _Linear, values: Mapping[sympy.Symbol, float]) -> bool:
    """Return whether the mode's domain contains all states before its events."""
    domain = symbolic.domain[mode]
    if not domain.free_symbols & set(symbolic.x):
        return bool(domain.subs(values) > 0)
    from saltus.system.expansion import expanded

    events = [symbolic.event[k] for k, source in enumerate(symbolic.source) if source == mode]
    beyond = [
        expanded(domain - int(sign) * event).subs(values) for event, sign in zip(events, linear.signs, strict=True)
    ]
    return any(more.is_number and more >= 0 for more in beyond)


class _Rest:
    """The rest in one state's equation as a function of one event function."""

    def __init__(self, state: int, event: int, expression: sympy.Expr, h: sympy.Symbol) -> None:
        import sympy

        self.state, self.event, self.h = state, event, h
        self.derivatives = [sympy.together(expression.diff(h, order)) for order in range(3)]
        self.functions: list[Callable[[float], float]] = [sympy.lambdify(h, e, "math") for e in self.derivatives]

    @classmethod
    def of(
        cls, split: Split, f: int, expression: sympy.Expr, linear: _Linear, values: Mapping[sympy.Symbol, float]
    ) -> _Rest | None:
        import sympy

        from saltus.system.expansion import expanded

        h = sympy.Dummy("h", real=True)  # no state of that name is meant
        numeric = sympy.nsimplify(expression.subs(values), rational=True)
        for k, row in enumerate(split.events):
            terms = [
                sympy.nsimplify(int(linear.signs[k]) * entry.subs(values), rational=True) * symbol
                for entry, symbol in zip(row, split.symbols, strict=True)
            ]
            pivot = next((s for s in split.symbols[: split.n] if numeric.has(s) and sympy.Add(*terms).has(s)), None)
            if pivot is None:
                continue
            solved = sympy.solve(sympy.Add(*terms) - h, pivot)[0]
            reduced = expanded(numeric.subs(pivot, solved))
            if not reduced.free_symbols <= {h}:
                reduced = sympy.simplify(reduced)
            if reduced.free_symbols <= {h} and reduced.is_rational_function(h):
                return cls(f, k, reduced, h)
        return None

    def supremum(self, order: int, low: float, high: float) -> float:
        """Return the largest modulus of a derivative on an interval, from its ends; see `proven`."""
        return max(abs(self.functions[order](low)), abs(self.functions[order](high)))

    def proven(self, linear: _Linear, cage: Cage) -> bool:
        """Return whether rest and slope are monotonic and without poles at all distances that occur in a cage."""
        import sympy

        low = sympy.Rational(float(cage.distances[self.event]))
        high = sympy.Rational(float(linear.highs[self.event] + linear.lows[self.event] - cage.distances[self.event]))
        for derivative in self.derivatives[1:]:
            top, bottom = sympy.fraction(derivative)
            for part in (top, bottom):
                if part.has(self.h) and sympy.Poly(part, self.h).count_roots(low, high):
                    return False
        return True


def _caged(mode: int, linear: _Linear, rests: list[_Rest], fraction: float) -> Cage | None:
    """Return the cage whose motions keep `fraction` of the response's distance from events; None without one."""
    bound = (1.0 - fraction) * linear.unit
    held = linear.weights * _pushed(linear, rests, 0, fraction) / linear.rates
    if not held.sum() < bound:
        return None
    # in the end motions keep the distance that their floors leave
    settled = 1.0 - float(held.sum()) / linear.unit
    coupling = float((linear.weights * _pushed(linear, rests, 1, settled) / linear.rates).sum())
    if not coupling < 1.0:
        return None
    return Cage(
        mode,
        frozen(linear.centre),
        frozen(linear.weights[:, None] * linear.left, np.complex128),
        frozen(held),
        bound,
        frozen(fraction * linear.lows),
        frozen(linear.rates),
        coupling,
    )


def _pushed(linear: _Linear, rests: list[_Rest], order: int, fraction: float) -> NDArray[np.float64]:
    """Return the bound of the rest, or of its slope by the weighted sum, in each modal coordinate."""
    total = np.zeros(linear.rates.size)
    for rest in rests:
        least = linear.lows[rest.event]
        supremum = rest.supremum(order, fraction * least, linear.highs[rest.event] + (1.0 - fraction) * least)
        # an event function changes by least / unit of the weighted sum, at the most
        total += np.abs(linear.left[:, rest.state]) * supremum * (least / linear.unit) ** order
    return total


def _extent(cage: Cage) -> float:
    """Return the logarithm of the product of the cage's extents along its coordinates, a measure of volume."""
    free = cage.bound - (cage.floors.sum() - cage.floors)
    return float(np.log(free).sum())

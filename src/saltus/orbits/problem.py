"""A periodic orbit of given signature as a zero problem: segment equations, their Jacobian, dense survey."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import ConvergenceError
from saltus.flow.shares import shares_of, with_shares
from saltus.orbits.coincidences import judged_together
from saltus.orbits.common_sizes import common_sizes, surface_rows
from saltus.orbits.discretisation import Dense, Discretised
from saltus.orbits.frames import lawson_steps
from saltus.orbits.landing.landed import on_surfaces
from saltus.orbits.meshes import adapted, crowding, decays, implicit_second, implicit_steps, joined
from saltus.orbits.plane import facings, further_planes, normal_across
from saltus.orbits.records import Orbit, events_of, room_for
from saltus.orbits.resting import at_rest, mark_driven, mark_moved, nearest_to_zero, sizes_nearby
from saltus.orbits.signature import CLOSED_END, COARSE, Survey
from saltus.scales import ABOVE_ROUNDING, EPS, FINEST, MOVES_NOTHING, NEAR_ZERO, RESTING, Scales
from saltus.system.integrals.kept import KeptTotals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.orbits.meshes import Decay
    from saltus.orbits.signature import Signature
    from saltus.system import HybridSystem

__all__ = ["OrbitProblem", "follow_from"]

_STEP = 1e-3  # change of the unknowns, over their sizes, in differences of Jacobians

_REMESHED = 12  # most times that the meshes of one orbit are moved
_NONE = np.empty(0)
_NO_STEPS = np.empty((0, 2))


@dataclass
class OrbitProblem(Discretised):
    """The equations F(u) = 0 of a periodic orbit.

    The unknowns are each segment's initial full state and duration, then the active parameters in their units.
    """

    system: HybridSystem
    signature: Signature  # modes, transitions and ends of the segments
    p: NDArray[np.float64]  # shape (parameters,): all parameters; the active ones are overwritten by the unknowns
    active: Sequence[int] = ()  # parameters among the unknowns
    # shape (active,): units of the active parameters
    scales: NDArray[np.float64] = field(default_factory=lambda: np.ones(0))
    tol: float = 1e-12  # relative tolerance of a step
    conserving: KeptTotals = None  # type: ignore[assignment] # totals that are kept: by default those of the first start

    def __post_init__(self) -> None:
        from saltus.orbits.kernels import (
            curve as curve_kernels,
            equation as equation_kernels,
            mesh as mesh_kernels,
            newton as newton_kernels,
            pencil as pencil_kernels,
            sizes as size_kernels,
            survey as survey_kernels,
        )

        self.signature.check(self.system)
        self.equations, self.pencils = equation_kernels, pencil_kernels
        self._meshes, self._surveys, self._curves = mesh_kernels, survey_kernels, curve_kernels
        self.newton, self._sizes = newton_kernels, size_kernels
        compiled = self.system.compiled
        self.n, self.segments = compiled.n, len(self.signature)
        self.size = self.segments * (self.n + 1)
        self._own_shares = shares_of(compiled, self.p)
        self._functions = np.append(with_shares(compiled.addresses, self._own_shares), 0)  # 0: no linear parts
        # nothing but a plane fixes where on the orbit the first segment starts
        self.slides = self.signature.kinds[0] == CLOSED_END
        self._slides = any(
            self.system.modes[self.system.mode_names[i]].surface is not None for i in self.signature.modes
        )
        compiled.check_powers(self.system, self.signature.modes)
        self.modes = np.array(self.signature.modes, dtype=np.int64)
        self.kinds = np.array(self.signature.rows, dtype=np.int64)
        self.transitions = np.array(self.signature.transitions, dtype=np.int64)
        self._active, self.scales = np.array(self.active, dtype=np.int64), np.array(self.scales, dtype=np.float64)
        self.extended = compiled.extended(self.p)
        # point and normal of the plane on which a closed curve starts, 2 n numbers, and of those of its pieces
        self.phase_plane = np.zeros(2 * self.n)
        self.begun_durations = self._shares = np.ones(self.segments)
        self.state_scale, self._atol = np.ones(self.n), self.tol
        self._nearest, self._worst = 1.0, 0.0
        self._surface_rows = np.zeros((2, 0, len(self.system.states)))
        self._common: tuple[NDArray[np.float64], ...] | None = None  # rows and sizes that common sizes are known of
        self.stiff, self._looked, self._rough, self._unsettled, self._unsteady = False, 0, False, 0, False
        self.linear, self.relaxes = None, False
        self._largest = np.zeros(len(self.system.states))
        self.bent = np.full(self.n, np.nan)  # sizes at which states at rest bend: 0 for none, NaN where unknown
        self._least, self.moved_by = np.zeros(self.n), np.ones((self.n, self.n), dtype=bool)
        self.conserving = self.conserving or KeptTotals(self.system)
        self._orbit = tuple(
            Orbit(
                functions=self._functions,
                n=self.n,
                p=self.extended,
                modes=self.modes,
                transitions=self.transitions,
                kinds=self.kinds,
                turns=self.signature.turns,
                turn=self.system.turn,
                rooted=compiled.limits.astype(np.int64),
                active=self._active,
                scales=self.scales,
                angles=self.system.angle_places,
                laws=self.conserving.terms,
                totals=self.conserving.wanted,
                implicit=np.zeros(4, dtype=np.int64),
            )
        )
        events = events_of(self.system)
        self._events, self._directions = tuple(events), events.directions
        self.mesh = np.zeros(0), np.zeros(self.segments + 1, dtype=np.int64)
        self._dense = self._seen = np.empty(0), np.empty(0)
        self._lasting = np.ones(self.segments)
        self._split = np.zeros(0), self._lasting, self.mesh
        self._explicit = self.mesh
        self._decays: list[float | Decay] = [0.0] * self.segments
        self._errors = np.zeros(0)

    @property
    def record(self) -> tuple[Any, ...]:
        """The fields of `Orbit`, for kernels."""
        if self.linear is not None:
            functions = np.append(self._functions[:-1], self.linear.addresses)
            return (functions, *self._orbit[1:-1], lawson_steps())
        return (*self._orbit[:-1], implicit_steps()) if self.stiff else self._orbit

    def parameters_at(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all parameters, shape (parameters,), where the unknowns are `u`."""
        p = self.p.copy()
        p[self._active] = u[self.size : self.size + self._active.size] * self.scales
        return p

    def named_at(self, u: NDArray[np.float64]) -> dict[str, float]:
        """Return `parameters_at` by name."""
        return dict(zip(self.system.parameter_names, self.parameters_at(u).tolist(), strict=True))

    def set_parameters(self, u: NDArray[np.float64]) -> None:
        """Take the active parameters from the unknowns."""
        self.equations.set_parameters(self._functions, u, self.size, self._active, self.scales, self.extended)

    def start(self, u: NDArray[np.float64], sizes: NDArray[np.float64] | None = None) -> int | None:
        """Make meshes, scales and the phase condition fit the orbit `u`; return a segment that cannot be followed.

        Its survey is kept in `begun`. sizes: (states,), of the orbits nearby, where `u` itself may be at rest.
        """
        if sizes is not None and np.max(sizes) > 0.0:
            self._largest = 100.0 * sizes  # of which `rescale` keeps a hundredth
        self.set_parameters(u)
        blocks = u[: self.size].reshape(self.segments, self.n + 1)
        self._find_least(blocks)
        reached = np.max(np.abs(blocks[:, : self.n]), axis=0)
        self.state_scale = np.fmax(np.maximum(np.maximum(reached, self._least), 1e-300), self.bent)
        self.state_scale[at_rest(self.state_scale, self.moved_by)] = self.state_scale.max()
        if self.system.phase is not None:
            self.state_scale[-1] = self.system.turn
        self.conserving.keep(blocks[0], self.parameters_at(u), self.state_scale)
        self._surface_rows = surface_rows(self.system, self.modes, blocks, self.extended, self.state_scale)
        self._set_absolute_tolerance()
        self.begun_durations = self._lasting = np.abs(blocks[:, self.n])
        self._decays = [*decays(self.system.compiled, self.modes, blocks, self.extended)]
        self.stiff, self.linear = False, None
        if (blocked := self._adapt(u)) is not None:
            return blocked
        self._shares = self.begun_durations / max(float(self.begun_durations.sum()), 1e-300)
        self.begun = survey = self.survey(u)
        self.rescale(survey)
        self.fix_phase(u, survey)
        if (nearby := sizes_nearby(self, u, survey, sizes)) is not None:
            return self.start(u, nearby)
        self._choose_frames(u, blocks)
        return None

    @property
    def meshed(self) -> bool:
        """Whether meshes have been made."""
        return bool(self.mesh[0].size)

    @property
    def common_scale(self) -> NDArray[np.float64]:
        """Sizes of the states, shape (n,), raised to those that they share where they meet surfaces together."""
        known = self._common
        if known is None or known[0] is not self._surface_rows or known[1].tobytes() != self.state_scale.tobytes():
            sizes = self.state_scale.copy()
            self._common = known = self._surface_rows, sizes, common_sizes(self._surface_rows, sizes)
        return known[2]

    def tighten(self) -> bool:
        """Go on by the finest tolerance; return whether it was looser. The next `start` makes meshes for it."""
        looser = self.tol > FINEST
        self.tol = min(self.tol, FINEST)
        self._set_absolute_tolerance()
        return looser

    @property
    def known(self) -> Scales:
        """What is known of the errors of the states."""
        return Scales(self.tol, np.full(self.n, self._atol), self.state_scale)

    def _set_absolute_tolerance(self) -> None:
        """Take the absolute tolerance from the states' sizes, next to equilibria above the field's rounding.

        A state that comes near 0 and keeps its sign grows again from what it is there, which must be exact.
        """
        least = float(self.state_scale.min())
        self._atol = self.tol * max(min(1.0, least), ABOVE_ROUNDING * least) * self._nearest

    def _adapt(self, u: NDArray[np.float64]) -> int | None:
        """Make meshes with steps as long as the tolerance allows, implicit ones where the flow is stiff.

        A segment that cannot be followed is returned.
        """
        blocks, tolerances = u[: self.size].reshape(self.segments, self.n + 1), (self.tol, self._atol)
        states = len(self.system.states)
        given = self._functions, self.modes, blocks, self.extended, tolerances
        found = adapted(self.system.compiled, *given, states, self.stiff)
        if isinstance(found, int):
            return found
        (places, starts), self.stiff = joined(found[0]), found[1]
        if not self.stiff and (crowded := crowding(places, starts, self._decays)):
            self.mesh = places, starts
            self.survey(u)
            self._follow_decays(u, crowded)
        self._use(places, starts)
        return None

    def fix_phase(self, u: NDArray[np.float64], survey: Survey, *, cuts: bool = False) -> None:
        """Lay the plane of `normal_across`, in units of the states' sizes, through the start of the orbit `u`.

        cuts: whether further pieces start on planes of their own, too, not at fixed shares of the period.
        """
        if not self.slides:
            return
        outwards = u[: self.n] - 0.5 * (survey.lows[: self.n] + survey.highs[: self.n])
        normal = normal_across(self.flow_at_start(u) / self.state_scale, outwards / self.state_scale)
        starts, flows = u[: self.size].reshape(self.segments, -1)[1:, : self.n], self.flows_at_starts(u)[1:]
        further = further_planes(starts, flows, self.state_scale) if cuts else _NONE
        self.phase_plane = np.concatenate([u[: self.n], normal / self.state_scale, further])

    def facing(self, u: NDArray[np.float64]) -> float:
        """Return how steeply the flow crosses the phase condition's plane, over that at its point; 1 without one."""
        return float(self.facings(u)[0]) if self.slides else 1.0

    def facings(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the same for each of the planes of a closed curve."""
        planes = self.phase_plane.reshape(-1, 2, self.n)
        flows = self.flow_at_start(u)[None, :] if len(planes) == 1 else self.flows_at_starts(u)
        return facings(planes, flows, self.state_scale)

    def event_sizes(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how much each segment's event function varies with the states' sizes, shape (segments,)."""
        self.set_parameters(u)
        blocks = u[: self.size].reshape(self.segments, self.n + 1)
        ends = np.roll(blocks[:, : self.n], -1, axis=0)
        given = zip(self.signature.transitions, ends, strict=True)
        return np.array([self.event_size(transition, x) if transition >= 0 else 0.0 for transition, x in given])

    def event_size(self, transition: int, x: NDArray[np.float64]) -> float:
        """Return how much an event function varies near a full state with the states' sizes."""
        gradient = np.empty(2 + 2 * self.n)
        self.system.compiled.call("event_x", transition, 0, np.ascontiguousarray(x), self.extended, gradient)
        return float(np.abs(gradient[2 : 2 + self.n]) @ self.state_scale)

    def flow_at_start(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the vector field where the first segment starts, shape (n,)."""
        slope = np.empty(self.n)
        given = self._functions, self.modes, u, self.size, self._active, self.scales, self.extended
        self.equations.starting_flow(*given, slope)
        return slope

    def flows_at_starts(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the vector field where each segment starts, shape (segments, n)."""
        self.set_parameters(u)
        starts = u[: self.size].reshape(self.segments, self.n + 1)[:, : self.n]
        slopes = np.empty((self.segments, self.n))
        for mode, x, slope in zip(self.modes.tolist(), starts, slopes, strict=True):
            self.system.compiled.call("field", mode, 0, np.ascontiguousarray(x), self.extended, slope)
        return slopes

    def _find_least(self, blocks: NDArray[np.float64]) -> None:
        """Find the sizes below which states are not resolved, and which states move which.

        The terms of a state's rate leave their rounding, over the period, in the state. A state is resolved if its size
        makes this rounding no more than the tolerance.
        """
        period, n = float(np.abs(blocks[:, self.n]).sum()), self.n
        terms = np.empty((n, n))
        self.equations.largest_terms(self._functions, self.modes, blocks.ravel(), n, self.extended, terms)
        self._least = EPS / self.tol * period * terms.sum(axis=1)
        self.moved_by = terms > MOVES_NOTHING
        mark_moved(self, self.moved_by, blocks)

    def rescale(self, survey: Survey) -> None:
        """Take the states' typical sizes from an orbit; none shrinks below a hundredth of what it was."""
        mark_driven(self, self.moved_by, survey.lows, np.maximum(np.abs(survey.lows), np.abs(survey.highs)))
        states = self._least, self.moved_by, self._largest, self.state_scale
        finite, near = self._sizes.resized(survey.lows, survey.highs, (RESTING, NEAR_ZERO), *states)
        if finite:
            self._nearest = nearest_to_zero(self, survey) if near else 1.0
            self._set_absolute_tolerance()

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the residual, shape (size,), and the Jacobian, shape (size, size + active).

        The meshes of a stiff flow are made anew for `u` where they do not fit it.
        """
        m = self.size
        if self.crowded:
            return np.full(m, np.nan), np.full((m, m + self._active.size), np.nan)
        F, J = np.empty(m), np.empty((m, m + self._active.size))
        self._evaluate(u, F, J)
        coarse = self.stiff and not self._worst <= self._meshes.FINEST
        if coarse and np.isfinite(u).all() and self._adapt(u) is None:
            self._evaluate(u, F, J)
        return F, J

    def _evaluate(self, u: NDArray[np.float64], F: NDArray[np.float64], J: NDArray[np.float64]) -> None:
        self.correct((_NONE, _NONE, _NONE), self.newton.evaluation(), (u, F, J, _NO_STEPS))

    def correct(self, plane: tuple[Any, ...], numbers: NDArray[np.float64], written: tuple[Any, ...]) -> int:
        """Call `saltus.orbits.kernels.newton.newton` on the meshes as they are; `written` are u, F, J and steps."""
        (u, F, J, steps), tolerances, phase = written, (self.tol, self._atol), (self.phase_plane, self._shares)
        given = self.record, self.mesh, phase, tolerances, plane, numbers
        told = self.newton.newton(*given, u, F, J, self._errors, steps)
        self._worst = float(numbers[self.newton.WORST])
        self._unsettled *= not self._worst <= self._meshes.FINEST
        return int(told)

    def resolve(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what `evaluate` does, on meshes moved until they are fine enough for the sensitivities, too.

        Meshes that `start` makes fit the state alone; at rest they say nothing of the sensitivities.
        """
        F, J = self.evaluate(u)
        for _ in range(_REMESHED):
            if self.refine():
                break
            F, J = self.evaluate(u)
        return F, J

    def second(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the Jacobian at the orbit `u` times a direction `v`, shape (size, size + active)."""
        from saltus.orbits.kernels import second as second_kernels

        if self.system.compiled.rooted[self.modes].any():
            return self._differences(u, v)
        self.set_parameters(u)
        compiled = self.system.second(tuple(self._active.tolist()))
        S = np.empty((self.size, self.size + self._active.size))
        p = np.empty(compiled.extended)
        steps = implicit_second() if self.stiff else 0
        with self.explicit_steps(u):
            second_kernels.second(self.record, self.mesh, compiled.addresses, steps, self.p.size, p, u, v, S)
        if self.conserving and self.active:
            place = self.size - self.n - 1, self.size
            self.conserving.bend(self.active, self.scales, place, self.parameters_at(u), u, v, S)
        return S

    def _differences(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the Jacobian times `v` by differences, where the field has roots."""
        sizes = np.append(np.tile(np.append(self.state_scale, np.inf), self.segments), np.ones(len(self.active)))
        step = _STEP / max(float(np.max(np.abs(v) / sizes)), 1e-300)
        near, far = (self.evaluate(u + k * step * v)[1] - self.evaluate(u - k * step * v)[1] for k in (1.0, 2.0))
        self.set_parameters(u)
        return np.asarray((8.0 * near - far) / (12.0 * step))

    def rate(self, u: NDArray[np.float64], segment: int) -> tuple[float, NDArray[np.float64]]:
        """Return the Lie derivative of a segment's event at its end, and its gradient, shape (size + active,)."""
        self.set_parameters(u)
        gradient = np.zeros(u.size)
        errors = np.empty_like(self._errors)
        value = self.equations.rate(self.record, self.mesh, segment, (self.tol, self._atol), u, gradient, errors)
        return float(value), gradient

    def distance(self, u: NDArray[np.float64], segment: int, transition: int) -> tuple[float, NDArray[np.float64]]:
        """Return how far a segment's start is from the surface of an event, and the gradient, shape (size + active,).

        The distance is positive before the event; it is the event function where either direction counts.
        """
        self.set_parameters(u)
        at, n = segment * (self.n + 1), self.n
        x, event, slope = np.ascontiguousarray(u[at : at + n]), np.empty(2 + 2 * n), np.empty(2)
        compiled = self.system.compiled
        compiled.call("event_x", transition, 0, x, self.extended, event)
        gradient = np.zeros(u.size)
        gradient[at : at + n] = event[2 : 2 + n]
        for k, index in enumerate(self._active.tolist()):
            compiled.call("event_p", transition, index, x, self.extended, slope)
            gradient[self.size + k] = slope[0] * self.scales[k]
        sign = -1.0 if self._directions[transition] > 0 else 1.0
        return sign * float(event[0]), sign * gradient

    def survey(self, u: NDArray[np.float64]) -> Survey:
        """Return what a dense look at the orbit `u` shows."""
        return on_surfaces(self, u, judged_together(self, u, self.glance(u)))

    def glance(self, u: NDArray[np.float64]) -> Survey:
        """Return `survey` without what is made of it at events."""
        quantities, transitions = self.n + self.system.compiled.n_outputs, len(self.system.transitions)
        if np.isfinite(u).all():
            self._lasting = np.abs(u[self.n : self.size : self.n + 1])
        found = room_for(self.n, quantities, self.segments, transitions)
        faults = self._surveys.survey(
            self.record, self._events, self.surveyed, self._curve(), (self.tol, self._atol), self.state_scale, u, found
        )
        self._seen = u.copy(), self.surveyed[0]
        values: Any = (int(faults) & ~COARSE, bool(faults & COARSE), *found, self.stiff)
        return Survey(*values)

    def dense(self) -> Dense:
        """Return the dense output that the last survey left."""
        (places, starts), (nodes, coefficients) = self.surveyed, self._followed()
        return places, starts, nodes.reshape(-1, self.n), coefficients.reshape(-1, 7, self.n)

    def state_on(self, segment: int, place: float) -> NDArray[np.float64]:
        """Return the full state at a clustered time of a segment, as last surveyed."""
        x = np.empty(self.n)
        self._curves.state_on(self.surveyed, self._followed(), segment, place, x)
        return x


def follow_from(problem: OrbitProblem, u: NDArray[np.float64], sizes: NDArray[np.float64] | None = None) -> None:
    """Call `OrbitProblem.start`; raise `ConvergenceError` where the flow of a segment cannot be followed."""
    blocked = problem.start(u, sizes)
    if blocked is not None:
        hint = "the field is singular or the state diverges there"
        raise ConvergenceError(f"flow of segment {blocked}", math.inf, 0, hint)

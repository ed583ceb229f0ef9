"""A periodic orbit as a result: segments, period, Floquet multipliers, stability, extremes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from saltus import checks
from saltus.contents import Contents, complex_of
from saltus.described import described
from saltus.errors import InputError
from saltus.flow.landings import Landing, landings_beyond
from saltus.flow.observables import Estimate, estimate, observe
from saltus.flow.stretch import Motion
from saltus.maps.spectrum import count_outside, multiplicity
from saltus.orbits.coincidences import names_at_once
from saltus.orbits.observables.faults import MOST_FAULTS, told_faults
from saltus.orbits.observables.outputs import sought
from saltus.orbits.observables.sampling import column_of, motion_of, sample_orbit
from saltus.orbits.observables.sensitivities import sensitivities
from saltus.orbits.problem import OrbitProblem, follow_from
from saltus.orbits.rounds import drive_text, repeats_of, rounds_of, winding_of
from saltus.orbits.signature import DURATION, Segment, Signature, Survey, events_between, path_of, signature_from
from saltus.orbits.stability.floquet import multipliers, multipliers_by_order, nontrivial, unstable_count
from saltus.orbits.stability.speedless import or_unknown
from saltus.orbits.unfolding import Fixed, read_fixed
from saltus.result import frozen
from saltus.solution import Solution
from saltus.system import HybridSystem
from saltus.system.plain import expect_values, held_parameters, held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["PeriodicOrbit", "orbit_at"]

TOLERANCES = (1e-16, 1.0)  # least and greatest relative tolerance of a flow in a file


@dataclass(frozen=True, eq=False, repr=False)
class PeriodicOrbit(Solution):
    """A periodic orbit of a hybrid system.

    Attributes
    ----------
    system, parameters : HybridSystem, mapping of str to float
        The system, and all its parameters.
    form : Signature
        Modes, transitions and ends as indices.
    states, durations : ndarray, shapes (pieces, all states) and (pieces,)
        Full state at the start of each piece, and its duration. A piece is a segment, or part of a sensitive one.
    multipliers : ndarray of complex, shape (states,)
        Floquet multipliers, largest first; an autonomous system's trivial one is last. NaN where an event has no speed.
    residual : float
        Largest residual of the equations: gap between two segments, or distance of a segment's end from its event.
    faults : int
        Bits of the reasons why the orbit is not admissible; see `reasons`.
    x0 : ndarray, shape (states,)
        State at phase 0; without a phase, the start of the first segment.
    lows, highs : ndarray, shape (all states + outputs,)
        Extremes over the period.
    tolerance : float
        Relative tolerance of the flow; 1e-12 where a looser one could not tell what the orbit is.
    fixed : Fixed or None
        The quantity that was fixed when the orbit was solved, and the parameter that was freed.
    implicit : bool
        Whether the flow is stiff, and was followed by implicit steps.

    Examples
    --------
    >>> import saltus
    >>> orbit = saltus.find_orbit(saltus.HybridSystem.smooth({"x": "v", "v": "(1 - x**2)*v - x"}), x0=[2.0, 0.0])
    >>> round(orbit.period, 8), orbit.stable
    (6.66328686, True)
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    form: Signature
    states: NDArray[np.float64]
    durations: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    residual: float
    faults: int
    x0: NDArray[np.float64]
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    tolerance: float
    fixed: Fixed | None = None
    implicit: bool = False

    noun = "an orbit"

    def __post_init__(self) -> None:
        for name in ("states", "durations", "x0", "lows", "highs"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "multipliers", frozen(self.multipliers, np.complex128))
        object.__setattr__(self, "parameters", checks.named_values("parameter", self.parameters))
        self.form.check(self.system)
        segments, full = len(self.form), len(self.system.all_states)  # compiled functions do not check shapes
        wanted = {"states": (segments, full), "durations": (segments,), "x0": (len(self.system.states),)}
        wanted |= dict.fromkeys(("lows", "highs"), (full + len(self.system.outputs),))
        for name, shape in wanted.items():
            if getattr(self, name).shape != shape:
                raise InputError(f"{name} of an orbit", getattr(self, name).shape, f"of shape {shape}")
        if self.multipliers.ndim != 1:
            raise InputError("multipliers of an orbit", self.multipliers.shape, "of one dimension")

    @property
    def period(self) -> float:
        """Period, the sum of the durations."""
        return abs(float(self.durations.sum()))  # that of a cycle shrunk to a point is rounding, of either sign

    @property
    def signature(self) -> tuple[tuple[str, str], ...]:
        """Names (mode, transition) of each segment, in cyclic order."""
        return self.form.names(self.system)

    @property
    def segments(self) -> tuple[Segment, ...]:
        """The smooth pieces, in order."""
        heads = self.form.heads
        durations = np.add.reduceat(self.durations, heads)
        rows = zip(self.signature, self.states[list(heads)], durations.tolist(), strict=True)
        return tuple(Segment(mode, transition, state, duration) for (mode, transition), state, duration in rows)

    @property
    def stable(self) -> bool:
        """Whether all multipliers but the trivial one lie inside the unit circle.

        Those of an orbit in a family at fixed parameters may lie on it, but for rounding.
        """
        inner = nontrivial(self.multipliers, autonomous=self.system.phase is None)
        return unstable_count(inner, neutral=bool(self.fixed and self.fixed.family)) == 0 and not np.isnan(inner).any()

    @property
    def unstable(self) -> int:
        """How many multipliers lie outside the unit circle, beyond rounding."""
        return count_outside(self.multipliers)

    @property
    def admissible(self) -> bool:
        """Whether the orbit is a motion of the system: `sound`. `reasons` says why it is not."""
        return self.sound

    def _held_value(self, name: str) -> float | None:
        """See `Solution._held_value`."""
        return self.fixed.value if self.fixed is not None and self.fixed.quantity == name else None

    def _multiplicity(self, type: str, varied: Sequence[str]) -> int:
        # the direction along a family has the multiplier 1 at all of its orbits
        along = type in ("SN", "BP") and self.fixed is not None and self.fixed.family
        return max(multiplicity(self.multipliers[: -1 if self.system.phase is None else None], type) - along, 1)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the orbit is not admissible; docs/theory/orbits.md, "Admissibility", lists the conditions."""
        return told_faults(self.faults, self.motion)

    @cached_property
    def rounds(self) -> int:
        """How many times the orbit repeats a shorter one; 1 for an orbit that `find_orbit` returns."""
        return rounds_of(self.problem(), self.unknowns)

    @cached_property
    def repeats(self) -> int:
        """How many times the states repeat themselves while the phase turns once, as driven by ``cos(2*s)``."""
        return repeats_of(self.system, self.form.turns, self.rounds) if self.system.drive_repeats > 1 else 1

    @cached_property
    def coincidences(self) -> tuple[tuple[str, ...], ...]:
        """Names of transitions that happen at one instant and do not depend on each other, as of equal neurons."""
        return names_at_once(problem := self.problem(), problem.survey(self.unknowns))

    @cached_property
    def orders(self) -> Mapping[tuple[str, ...], NDArray[np.complex128]]:
        """Multipliers by the order of the transitions, where events of one instant have several derivatives."""
        problem = self.problem()
        return multipliers_by_order(problem, self.unknowns, problem.resolve(self.unknowns)[1])

    @cached_property
    def winding(self) -> Mapping[str, int]:
        """How many turns each of the system's angles makes in a period: 0 where it swings, else it rotates."""
        return winding_of(self.problem(), self.unknowns)

    @cached_property
    def landings_beyond(self) -> tuple[Landing, ...]:
        """Transitions that lead beyond an event of their target mode; see `Trajectory.landings_beyond`."""
        sizes = np.maximum(np.abs(self.lows), np.abs(self.highs))[: len(self.system.all_states)]
        return landings_beyond(self.system, self.parameters, events_between(self.system, self.segments), sizes)

    @property
    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and greatest value of each state over the period."""
        return self.lows[: len(self.system.states)], self.highs[: len(self.system.states)]

    @cached_property
    def min(self) -> Mapping[str, float]:
        """Least value of every state and output over the period."""
        return checks.named_values("state or output", self._extremes(self._completed[0]))

    @cached_property
    def max(self) -> Mapping[str, float]:
        """Greatest value of every state and output over the period."""
        return checks.named_values("state or output", self._extremes(self._completed[1]))

    _completed = cached_property(sought)  # `lows` and `highs` with what outputs have between the places of a survey

    def _extremes(self, values: NDArray[np.float64]) -> dict[str, float]:
        named = zip((*self.system.all_states, *self.system.output_names), values, strict=True)
        return {name: float(value) for name, value in named if name != (self.system.phase or ("",))[0]}

    @property
    def unknowns(self) -> NDArray[np.float64]:
        """States and durations as the vector of unknowns of `OrbitProblem`."""
        return np.column_stack([self.states, self.durations]).ravel()

    def problem(self, active: str | Sequence[str] = (), scale: float = 1.0) -> OrbitProblem:
        """Return the orbit's equations, with meshes that fit the orbit.

        Parameters
        ----------
        active : str or sequence of str, optional
            Parameters that become unknowns.
        scale : float, optional
            Unit of these parameters.

        Returns
        -------
        OrbitProblem
            The equations; docs/theory/orbits.md derives them.

        Raises
        ------
        InputError
            There is no such parameter.
        """
        p, known = self.system.parameter_vector(self.parameters), self.system.parameter_names
        wanted = (active,) if isinstance(active, str) else checks.names("active", active, "names of parameters")
        index = [known.index(name if name in known else checks.chosen("active", name, known)) for name in wanted]
        scales = np.full(len(index), checks.positive("scale", scale))
        problem = OrbitProblem(self.system, self.form, p, index, scales, self.tolerance)
        follow_from(problem, np.append(self.unknowns, p[index] / scale))
        return problem

    @described
    def sample(self, points: int = 400) -> xr.Dataset:
        """Return the orbit over one period.

        Parameters
        ----------
        points : int, optional
            Number of times, about; both ends of every segment are among them.

        Returns
        -------
        xarray.Dataset
            States, outputs and the mode's index against ``t``, which is 0 at the first segment's start.

        Raises
        ------
        InputError
            `points` is no count.
        """
        return sample_orbit(self.problem(), self.unknowns, points)

    def _states_along(self, points: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        sampled = self.sample(points)
        states = [sampled[column_of(name)].to_numpy() for name in self.system.states]
        return sampled["t"].to_numpy(), np.column_stack([*states, np.empty((sampled.sizes["t"], 0))])

    def row(self) -> dict[str, Any]:
        """Return what a table says of the orbit: x0, extremes, period, stability, signature, whether admissible."""
        row: dict[str, Any] = {f"x0_{name}": v for name, v in zip(self.system.states, self.x0, strict=True)}
        row |= {f"{end}_{q}": v for end, each in (("min", self.min), ("max", self.max)) for q, v in each.items()}
        return row | {name: getattr(self, name) for name in ("period", "stable", "signature", "admissible")}

    def motion(self) -> Motion:
        """Return the orbit over one period as a `Motion`, from which observables are computed."""
        return replace(
            motion_of(self.problem(), self.unknowns), extremes={q: (a, self.max[q]) for q, a in self.min.items()}
        )

    @overload
    def observe(self, *names: str, errors: Literal[False] = False) -> dict[str, float]: ...

    @overload
    def observe(self, *names: str, errors: Literal[True]) -> dict[str, Estimate]: ...

    def observe(self, *names: str, errors: bool = False) -> dict[str, float] | dict[str, Estimate]:
        """Return observables over the period by name.

        Parameters
        ----------
        *names : str
            As ``"amplitude(z, 1)"`` or ``"fraction(contact)"``; `saltus.flow.observables` lists them. Without a phase,
            the angle of harmonics is 0 at the first segment's start and turns once in the period.
        errors : bool, optional
            Whether each value comes with an estimate of its error, as ``Estimate(value, error)``.

        Returns
        -------
        dict of str to float or Estimate
            In the order of the names. What does not converge is NaN, and a warning names it.

        Raises
        ------
        InputError
            A name is no observable.

        Examples
        --------
        >>> from saltus.orbits.find import find_orbit
        >>> driven = HybridSystem.smooth({"x": "cos(theta) - x"}, {"w": 1.0}, phase=("theta", "w"))
        >>> {q: round(a, 9) for q, a in find_orbit(driven, {}, [0.0]).observe("amplitude(x, 1)").items()}
        {'amplitude(x, 1)': 0.707106781}
        """
        return (estimate if errors else observe)(self.motion(), names)

    def sensitivity(self, names: Sequence[str], parameters: Sequence[str] | None = None) -> xr.Dataset:
        """Return exact derivatives of observables by parameters; docs/theory/sensitivities.md derives them.

        Parameters
        ----------
        names : sequence of str
            Observables as `observe` takes them, ``"period"``, ``"max_x"`` for ``"max(x)"``; ``"multipliers"``;
            ``"segments"`` for the segments' starts and durations.
        parameters : sequence of str, optional
            All parameters of the system by default.

        Returns
        -------
        xarray.Dataset
            A variable for each observable along ``parameter``, its attribute ``value`` the observable's value. Where no
            derivative exists it is NaN, and the attribute ``note`` says why. ``multiplier_re``, ``multiplier_im``,
            ``segment_state`` and ``segment_duration``, where they are asked for.

        Raises
        ------
        InputError
            A name is no observable, or no parameter. The orbit touches a surface, or its parameters do not determine
            it, as at a saddle-node.

        Examples
        --------
        >>> from saltus.orbits.find import find_orbit
        >>> driven = HybridSystem.smooth({"x": "cos(theta) - x"}, {"w": 1.0}, phase=("theta", "w"))
        >>> slopes = find_orbit(driven, {}, [0.0]).sensitivity(["amplitude(x, 1)", "period"])
        >>> print({name: round(float(slopes[name].sel(parameter="w")), 9) for name in ("amplitude(x, 1)", "period")})
        {'amplitude(x, 1)': -0.353553391, 'period': -6.283185307}
        """
        names = checks.names("names", names, "observables")
        known = self.system.parameter_names
        wanted = known if parameters is None else checks.names("parameters", parameters, "names of parameters")
        ordered = tuple(name for name in known if name in wanted) if set(wanted) <= set(known) else wanted
        problem = self.problem(ordered)
        u = np.append(self.unknowns, problem.p[list(problem.active)])
        found = sensitivities(problem, u, names).dataset(problem)
        return found if wanted == ordered else found.sel(parameter=list(wanted))

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return segments, multipliers, extremes and a sampled period as a Dataset."""
        named = self.form.names_of_pieces(self.system)
        dataset = self.sample().assign(
            segment_state=(("segment", "state"), self.states), segment_duration=("segment", self.durations),
            multiplier_re=("multiplier", self.multipliers.real), multiplier_im=("multiplier", self.multipliers.imag),
            x0=("own_state", self.x0), minimum=("quantity", self.lows), maximum=("quantity", self.highs),
        )  # fmt: skip
        dataset = dataset.assign_coords(
            state=list(self.system.all_states),
            own_state=list(self.system.states),
            quantity=[*self.system.all_states, *self.system.output_names],
            segment_mode=("segment", [mode for mode, _ in named]),
            segment_transition=("segment", [end for _, end in named]),
        )
        dataset.attrs |= {
            "definition": json.dumps(self.system.definition()), "parameters": json.dumps(dict(self.parameters)),
            "form": json.dumps(self.form.as_list(self.system)),
            **{name: getattr(self, name) for name in ("period", "residual", "faults", "tolerance")},
            **{name: int(getattr(self, name)) for name in ("stable", "admissible", "implicit")},
        }  # fmt: skip
        return dataset.assign_attrs({} if self.fixed is None else {"fixed": json.dumps(self.fixed.as_list())})

    @classmethod
    def _read(cls, held: Contents) -> PeriodicOrbit:
        system = held_system(held)
        held.names("state", system.all_states)
        held.names("own_state", system.states)
        held.names("quantity", (*system.all_states, *system.output_names))
        expect_values(held, system, "multiplier", 1.0)
        durations, faults = held.array("segment_duration", ("segment",)), held.count("faults", most=MOST_FAULTS)
        if not float(durations.sum()) > 0.0 and not faults & DURATION:  # of a cycle shrunk to a point it is rounding
            raise InputError("segment_duration", durations.tolist(), "durations of a positive sum, the period")
        return cls(
            system,
            held_parameters(held, system),
            signature_from(held.json("form", list), system),
            held.array("segment_state", ("segment", "state")),
            durations,
            complex_of(*(held.array(f"multiplier_{part}", ("multiplier",), finite=False) for part in ("re", "im"))),
            held.number("residual", finite=False),
            faults,
            held.array("x0", ("own_state",)),
            held.first_finite("minimum", ("quantity",), len(system.all_states)),
            held.first_finite("maximum", ("quantity",), len(system.all_states)),
            held.number("tolerance", *TOLERANCES),
            read_fixed(held, system),
            "implicit" in held.dataset.attrs and held.count("implicit", most=1) == 1,  # absent from earlier files
        )

    def __repr__(self) -> str:
        kind = "stable" if self.stable else "unstable"
        kind += f", not admissible ({'; '.join(self.reasons)})" * (not self.admissible)
        turns = f" = {self.form.turns} forcing period{'s' if self.form.turns > 1 else ''}" if self.form.turns else ""
        rounds = f", {self.rounds} times round an orbit of a shorter one" if self.rounds > 1 else ""
        faster = drive_text(self.system)
        fixed = f"  fixed       {self.fixed}\n" * (self.fixed is not None)
        at_once = "".join(f"  at once     {', '.join(names)}\n" for names in self.coincidences)
        fixed += "".join(f"  conserved   {name} = {value:.9g}\n" for name, value in self.conserved.items())
        fixed += "  flow        stiff, by implicit steps\n" if self.implicit else ""
        return (
            f"PeriodicOrbit of {self.system.name or 'a hybrid system'}: {kind}\n"
            f"  period      {self.period:.12g}{turns}{rounds}{faster}\n"
            f"  signature   {path_of(self.signature)}\n{at_once}{fixed}"
            f"  x0          [{', '.join(f'{value:.6g}' for value in self.x0)}]\n"
            f"  |multipliers| {', '.join(f'{abs(value):.6g}' for value in self.multipliers)}\n"
            f"  residual    {self.residual:.2g}" + "".join(f"\n  {landing}" for landing in self.landings_beyond[:1])
        )


def orbit_at(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], survey: Survey | None = None,
    values: NDArray[np.complex128] | None = None, fixed: Fixed | None = None,
) -> PeriodicOrbit:  # fmt: skip
    """Return the orbit that solves `problem` at `u`; survey and multipliers are computed unless given."""
    survey = problem.survey(u) if survey is None else survey
    values = or_unknown(problem, u, J, survey.rates[:, 0], multipliers(problem, u, J)) if values is None else values
    blocks = u[: problem.size].reshape(problem.segments, problem.n + 1)
    x0 = survey.x0[: len(problem.system.states)]
    return PeriodicOrbit(
        problem.system, problem.named_at(u), problem.signature, blocks[:, : problem.n], blocks[:, problem.n], values,
        survey.residual, survey.faults, x0, survey.lows, survey.highs, problem.tol, fixed, survey.implicit,
    )  # fmt: skip

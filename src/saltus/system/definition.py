"""The definition of a hybrid system, checked: states, parameters, modes, transitions, phase and named outputs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.checks.states import named_state, shapes_that_fit
from saltus.errors import DefinitionError, InputError, nearest
from saltus.system.expressions import Names, check_name, text_of
from saltus.system.grammar import chosen_among, clipped
from saltus.system.own_states import completed_mode, completed_transition
from saltus.system.parts import (
    ENDS,
    Mode,
    Transition,
    clean_bounds,
    clean_mode,
    clean_phase,
    clean_transitions,
    interval_text,
    kept_data,
    mapping_of,
    names_of,
    number_of,
    sequence_of,
    texts_of,
)
from saltus.system.structure import check_structure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike


__all__ = ["Definition"]


class Definition:
    """The checked data of a hybrid system or a map, as `saltus.HybridSystem` takes them; all expressions are texts."""

    unnamed = "a hybrid system"  # what a definition without a name is called
    part = "mode"  # what messages call a part of the definition with equations of its own
    smooth_cure = "a mode on either side, and a transition where the two are equal"  # of a field with a corner
    natural_returns = "returns to phase 0"  # what sweeps count without a section
    iteration: float | None = None  # time that an iteration takes; None where time is continuous
    span = "t = {:.8g}"  # a duration in words
    clock = "t"  # name of the axis along which a motion goes on
    time_unit = "unit of time"  # what durations are counted in
    rate_unit = "1 / time"  # unit of an exponent

    def __init__(
        self,
        states: Sequence[str],
        parameters: Mapping[str, float],
        modes: Mapping[str, Any],
        transitions: Iterable[Transition] = (),
        *,
        phase: tuple[str, Any] | None = None,
        outputs: Mapping[str, Any] | None = None,
        groups: Mapping[str, Sequence[str]] | None = None,
        positive: Iterable[str] = (),
        parameter_bounds: Mapping[str, tuple[float, float]] | None = None,
        regimes: Mapping[str, Sequence[str]] | None = None,
        let: Mapping[str, Any] | None = None,
        angles: Iterable[str] = (),
        made_of: Mapping[str, Any] | None = None,
        name: str = "",
    ) -> None:
        if not isinstance(name, str):
            raise DefinitionError("name", name, "text")
        self.name = str(name)
        self.states = names_of(states, "states")
        parameters = mapping_of(parameters, "parameters", "of names to numbers")
        self.parameters = {check_name(key, "parameters"): number_of(value, key) for key, value in parameters.items()}
        let = mapping_of(let, "let", "of names to expressions")
        self.phase = clean_phase(phase, (*self.states, *self.parameters), let)
        names = Names((*self.all_states, *self.parameters)).with_let(let)
        read = self._clean_modes(modes, names)
        self.modes = {key: completed_mode(key, mode, self.states, self.phase) for key, mode in read.items()}
        listed = sequence_of(transitions, "transitions", "of Transition")
        clock = None if self.phase is None else self.phase[0]
        self.transitions = tuple(
            clean for transition in listed for clean in clean_transitions(transition, names, clock)
        )  # fmt: skip
        if any(transition.rests is not None for transition in self.transitions):
            self._add_rests(names)
        self.outputs = self._clean_outputs(mapping_of(outputs, "outputs", "of names to expressions"), names)
        groups = mapping_of(groups, "groups", "of names to sequences of parameters")
        self.groups = {
            key: texts_of(members, f"group {key!r}", "names of parameters") for key, members in groups.items()
        }
        self.positive = texts_of(positive, "positive", "names of parameters")
        bounds = mapping_of(parameter_bounds, "parameter_bounds", "of parameters to intervals")
        self.parameter_bounds = {key: clean_bounds(key, interval) for key, interval in bounds.items()}
        regimes = mapping_of(regimes, "regimes", "of names to sequences of modes")
        self.regimes = {key: texts_of(visited, f"regime {key!r}", "names of modes") for key, visited in regimes.items()}
        self.made_of = kept_data(made_of, "made_of")
        check_structure(self, names.let)
        self.transitions = tuple(completed_transition(t, self.modes, self.states) for t in self.transitions)
        self._check_choices()
        self.parameter_vector({})
        self.angles = texts_of(angles, "angles", "names of states")
        self.angle_places = self._places_of_angles()
        self._prepare()

    def _prepare(self) -> None:
        """Do what a subclass needs once the data are checked."""

    def _add_rests(self, names: Names) -> None:
        """Add what motions need that come to rest behind impacts that accumulate."""
        from saltus.system.chatter import with_rests

        self.modes, self.transitions = with_rests(self.modes, self.transitions, self.states, names, self.phase)

    def _clean_modes(self, modes: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Mode]:
        """Return the modes with expressions that can be read."""
        given = mapping_of(modes, "modes", "of names to Mode")
        return {k: clean_mode(k, mode, names, states=self.all_states, phase=self.phase) for k, mode in given.items()}

    @property
    def conditions(self) -> dict[str, tuple[str, ...]]:
        """Conditions on the state by which a part is chosen, for each part that has some: those of a map's pieces."""
        return {}

    @property
    def all_states(self) -> tuple[str, ...]:
        """Names of the full state: the states, then the phase where there is one."""
        return self.states if self.phase is None else (*self.states, self.phase[0])

    @property
    def mode_names(self) -> tuple[str, ...]:
        """Names of the modes, in the order of definition."""
        return tuple(self.modes)

    @property
    def transition_names(self) -> tuple[str, ...]:
        """Names of the transitions, in the order of definition."""
        return tuple(transition.name for transition in self.transitions)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of definition."""
        return tuple(self.parameters)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs, in the order of definition."""
        return tuple(self.outputs)

    def definition(self) -> dict[str, Any]:
        """Return the definition as plain data, from which `from_definition` makes an equal system."""
        return {
            "name": self.name,
            "states": list(self.states),
            "parameters": dict(self.parameters),
            "phase": None if self.phase is None else list(self.phase),
            "modes": {
                key: {
                    "field": {name: mode.field[name] for name in mode.states or mode.field}, "domain": mode.domain,
                    **({} if mode.surface is None else {"surface": mode.surface}),
                    **({} if mode.states is None else {"states": list(mode.states)}),
                }
                for key, mode in self.modes.items()
            },
            "transitions": [
                {
                    "source": t.source, "target": t.target, "event": t.event, "direction": t.direction,
                    "reset": dict(t.reset), "when": t.when, "name": t.name, **({"sums": True} if t.sums else {}),
                }
                for t in self.transitions
            ],
            "outputs": {key: dict(value) for key, value in self.outputs.items()},
            "groups": {key: list(value) for key, value in self.groups.items()},
            "positive": list(self.positive),
            "parameter_bounds": {key: list(value) for key, value in self.parameter_bounds.items()},
            "regimes": {key: list(value) for key, value in self.regimes.items()},
            **({"angles": list(self.angles)} if self.angles else {}),
            **({"made_of": self.made_of} if self.made_of else {}),
        }  # fmt: skip

    @classmethod
    def from_definition(cls, definition: Mapping[str, Any]) -> Self:
        """Return the system that plain data describe.

        Parameters
        ----------
        definition : mapping
            As `definition` returns it.

        Returns
        -------
        HybridSystem or Map
            Equal to the one that returned the data.

        Raises
        ------
        DefinitionError
            The data are not of this form, or a name or an expression cannot be used.
        """
        data = dict(mapping_of(definition, "definition", "as HybridSystem.definition returns it"))
        try:
            modes = {key: Mode(**mode) for key, mode in data.pop("modes").items()}
            transitions = [Transition(**transition) for transition in data.pop("transitions")]
            return cls(modes=modes, transitions=transitions, **data)
        except (AttributeError, KeyError, TypeError) as error:
            hint = f"{type(error).__name__}: {error}"
            raise DefinitionError("definition", list(data), "as HybridSystem.definition returns it", hint) from error

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Definition) or type(other).part != type(self).part:
            return False
        return json.dumps(self.definition()) == json.dumps(other.definition())

    def __hash__(self) -> int:
        return hash((self.name, self.states, self.parameter_names, self.mode_names, self.transition_names))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self).from_definition, (self.definition(),)

    def resolve(self, parameters: Mapping[str, float] | None) -> dict[str, float]:
        """Return all parameters: the defaults with `parameters` over them, groups spread out.

        Parameters
        ----------
        parameters : mapping of str to float or None
            Values by name; a group sets all its members.

        Returns
        -------
        dict of str to float
            In the order of `parameter_names`.

        Raises
        ------
        InputError
            An unknown name, a value that is not finite, or one out of its bounds.
        """
        given = checks.mapping("parameters", parameters, "names to numbers, or None")
        values = dict(self.parameters)
        for key, value in given.items():
            if key not in values and key not in self.groups:
                checks.chosen("parameter", key, (*values, *self.groups))
            for member in self.groups.get(key, (key,)):
                values[member] = value
        for key, value in values.items():
            values[key] = self._checked(key, value)
        return values

    def _checked(self, key: str, value: object) -> float:
        number = checks.number(key, value)
        if key in self.positive and number <= 0.0:
            raise InputError(key, number, "> 0")
        low, high = self.parameter_bounds.get(key, (-math.inf, math.inf))
        if not low <= number <= high:
            raise InputError(key, number, interval_text(low, high))
        return number

    def allowed(self, parameter: str) -> tuple[float, float]:
        """Return the closed interval in which a parameter may lie; a positive one begins just above 0.

        Parameters
        ----------
        parameter : str
            Its name.

        Returns
        -------
        (float, float)
            Its ends, infinite where there is no bound.

        Raises
        ------
        InputError
            There is no such parameter.
        """
        checks.chosen("parameter", parameter, self.parameters)
        low, high = self.parameter_bounds.get(parameter, (-math.inf, math.inf))
        return (max(low, math.ulp(0.0)), high) if parameter in self.positive else (low, high)

    def parameter_vector(self, parameters: Mapping[str, float] | None) -> NDArray[np.float64]:
        """Return all parameters as a vector; see `resolve`.

        Parameters
        ----------
        parameters : mapping of str to float or None
            Values that differ from the defaults.

        Returns
        -------
        ndarray, shape (parameters,)
            In the order of `parameter_names`.

        Raises
        ------
        InputError
            An unknown name, a value that is not finite, or one out of its bounds.
        """
        return np.array(list(self.resolve(parameters).values()), dtype=np.float64)

    def full_state(self, x0: StateLike, name: str = "x0", mode: str | None = None) -> NDArray[np.float64]:
        """Return a state with the phase as its last component.

        Parameters
        ----------
        x0 : array_like, shape (states,) or (all states,), or mapping of str to float
            Without the phase it is at phase 0. A mapping names the states, and may name the phase.
        name : str, optional
            Name of the state in messages.
        mode : str, optional
            A mode, of whose own states alone `x0` may be.

        Returns
        -------
        ndarray, shape (all states,)
            A copy.

        Raises
        ------
        InputError
            Another length, or a value that is not finite.
        """
        n, phase = len(self.states), None if self.phase is None else self.phase[0]
        own = self.modes[mode].states if isinstance(mode, str) and mode in self.modes else None
        if isinstance(x0, Mapping):
            return named_state(x0, name, self.states, phase, own)
        x = checks.array(name, x0, f"numbers, one for each of {', '.join(self.states)}", finite=False)
        if own is not None and x.ndim == 1 and len(x) in (len(own), len(own) + 1):
            x = self._completed_state(x, own)
        if x.shape != (n,) and x.shape != (len(self.all_states),):
            raise InputError(name, x.tolist(), shapes_that_fit(self.states, phase, own, mode))
        if not np.isfinite(x).all():
            raise InputError(name, x.tolist(), "finite")
        return np.append(x, 0.0) if x.shape == (n,) and self.phase is not None else x

    def _completed_state(self, x: NDArray[np.float64], own: Sequence[str]) -> NDArray[np.float64]:
        """Return a state of a mode's own states, with or without the phase, with 0 for those that the mode lacks."""
        if len(x) in (len(self.states), len(self.all_states)) and len(x) != len(own):
            return x
        full = np.zeros(len(self.states))
        full[[self.states.index(name) for name in own]] = x[: len(own)]
        return np.append(full, x[len(own) :])

    def mode_index(self, mode: str) -> int:
        """Return the index of a mode.

        Parameters
        ----------
        mode : str
            Its name.

        Returns
        -------
        int
            Its place in `mode_names`.

        Raises
        ------
        InputError
            There is no mode of that name.
        """
        names = self.mode_names
        known = names if mode in names else [name for name in names if name not in ENDS]
        return names.index(checks.chosen(self.part, mode, known))

    def _clean_outputs(self, outputs: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, dict[str, str]]:
        clean: dict[str, dict[str, str]] = {}
        for key, value in outputs.items():
            where = f"output {key!r}"
            check_name(key, "outputs")
            by_mode = value if isinstance(value, Mapping) else dict.fromkeys(self.modes, value)
            by_mode = self._settling_outputs(by_mode)
            if set(by_mode) != set(self.modes):
                wanted = f"given for each of the {self.part}s {', '.join(self.modes)}"
                raise DefinitionError(where, list(by_mode), wanted)
            clean[key] = {mode: text_of(by_mode[mode], where, names) for mode in self.modes}
        return clean

    def _settling_outputs(self, by_mode: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return outputs by mode with those of modes for settling, which are the outputs of the impacting modes."""
        added = {t.target: by_mode[t.source] for t in self.transitions if t.sums and t.source in by_mode}
        return {**added, **by_mode}

    def _equations(self) -> Iterator[tuple[str, str]]:
        """The expressions that must be smooth, each with where it stands."""
        for key, mode in self.modes.items():
            yield from (
                (f"{self.part} {key!r}", text) for text in (*mode.field.values(), mode.domain, mode.surface) if text
            )
        for t in self.transitions:
            # of a condition only the sign counts, so that it may choose
            yield from ((f"transition {t.name!r}", text) for text in (t.event, *t.reset.values()) if text)
        for key, texts in self.conditions.items():
            yield from ((f"{self.part} {key!r}", text) for text in texts)

    def _check_choices(self) -> None:
        """Raise `DefinitionError` where the greater or less of two values that vary with the state is taken."""
        names = (*self.all_states, *self.parameters)
        for where, text in self._equations():
            for call, used in chosen_among(text, names).items():
                if used.intersection(self.all_states):
                    allowed = "of Max and Min of parameters alone, since it must be smooth in the state"
                    raise DefinitionError(where, clipped(call), allowed, self.smooth_cure)

    def _places_of_angles(self) -> NDArray[np.int64]:
        """Return the places of the angles among the states; raise `DefinitionError` where one is no state."""
        for name in self.angles:
            if name not in self.states:
                hint = "the phase is an angle already" if self.phase and name == self.phase[0] else ""
                wanted = f"names of states: {', '.join(self.states)}"
                raise DefinitionError("angles", name, wanted, hint or nearest(name, self.states))
        return np.array([i for i, name in enumerate(self.states) if name in self.angles], dtype=np.int64)

    def _circle(self) -> str:
        """Words for where the phase goes back to 0."""
        return "modulo 2 pi"

    def __str__(self) -> str:
        kind = type(self).__name__
        lines = [f"{kind} {self.name!r}" if self.name else kind]
        lines.append(f"  states      {', '.join(self.states)}")
        if self.phase is not None:
            lines.append(f"  phase       {self.phase[0]}' = {self.phase[1]}, {self._circle()}")
        if self.angles:
            lines.append(f"  angles      {', '.join(self.angles)}, modulo 2 pi")
        lines.append(f"  parameters  {', '.join(f'{key} = {value!r}' for key, value in self.parameters.items())}")
        for key, mode in ((key, mode) for key, mode in self.modes.items() if key not in ENDS):
            where = f", where {mode.domain} > 0" if mode.domain is not None else ""
            where += f", on {mode.surface} = 0" if mode.surface is not None else ""
            lines.append(f"  mode {key}{where}")
            lines += [f"    {name}' = {mode.field[name]}" for name in mode.states or mode.field]
        lines += [f"  transition {t.name}: {t._sentence()}" for t in self.transitions if t.target not in ENDS]
        lines += [f"  end, {t.target}: {t._sentence()}" for t in self.transitions if t.target in ENDS]
        for key, by_mode in self.outputs.items():
            texts = set(by_mode.values())
            shown = texts.pop() if len(texts) == 1 else "; ".join(f"{text} in {m}" for m, text in by_mode.items())
            lines.append(f"  output {key} = {shown}")
        return "\n".join(lines)

    __repr__ = __str__

"""A hybrid system: its definition, and the functions compiled from it."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

from saltus.system import compiled
from saltus.system.compiled_definition import CompiledDefinition
from saltus.system.integrals.finding import find_laws
from saltus.system.parts import Mode, Transition, mapping_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from saltus.system.compiled import (
        CompiledGradients,
        CompiledLinear,
        CompiledSeries,
        Formulas,
    )
    from saltus.system.integrals.laws import Laws

__all__ = ["HybridSystem", "Mode", "Transition"]


class HybridSystem(CompiledDefinition):
    """A piecewise-smooth dynamical system, defined once and symbolically.

    Parameters
    ----------
    states : sequence of str
        Names of the states, the phase excepted.
    parameters : mapping of str to float
        Parameters and their default values.
    modes : mapping of str to Mode
        Vector fields by name.
    transitions : iterable of Transition, optional
        Jumps between them.
    phase : (str, expression), optional
        Name and rate of an angle: ``theta' = w`` on the circle, in every mode. It is the last component of the full
        state; expressions must have the period 2 pi in it. Phase 0 is the natural section. ``theta`` goes back to 0 at
        2 pi. Where all expressions repeat k times in 2 pi, as for ``cos(2*theta)``, it does so at 2 pi / k.
    outputs : mapping of str to expression (or to a mapping of mode to expression), optional
        Named quantities that results record.
    groups : mapping of str to sequence of str, optional
        A name that sets several parameters at once.
    positive : iterable of str, optional
        Parameters that must be positive.
    parameter_bounds : mapping of str to (float, float), optional
        Closed interval in which a parameter must lie.
    regimes : mapping of str to sequence of str, optional
        Names for kinds of motion, each with the modes that a motion so named visits, exactly these.
    let : mapping of str to expression, optional
        Names of sub-expressions, for use in all expressions of the definition. Each may use those before it. They are
        written out when the system is made; a quantity to look at is an output.
    angles : iterable of str, optional
        States on a circle, in radians: expressions must have the period 2 pi in each, and orbits close modulo 2 pi.
    made_of : mapping of str to plain data, optional
        What the expressions were made of: numbers, texts, lists and mappings that are kept with the definition and in
        files. No motion depends on them.
    name : str, optional
        What the system is called in its `repr` and in files.

    Raises
    ------
    DefinitionError
        A name or an expression that cannot be used; the message names the mode or transition.

    Examples
    --------
    >>> ball = HybridSystem(
    ...     states=("z", "v"),
    ...     parameters={"g": 1.0, "e": 0.5},
    ...     modes={"flight": Mode({"z": "v", "v": "-g"})},
    ...     transitions=[Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="impact")],
    ...     name="bouncing ball",
    ... )
    >>> print(ball)
    HybridSystem 'bouncing ball'
      states      z, v
      parameters  g = 1.0, e = 0.5
      mode flight
        z' = v
        v' = -g
      transition impact: flight -> flight when z falls through 0, v := -e*v
    """

    @classmethod
    def smooth(
        cls,
        field: Mapping[str, Any] | Mode,
        parameters: Mapping[str, float] | None = None,
        *,
        phase: tuple[str, Any] | None = None,
        outputs: Mapping[str, Any] | None = None,
        positive: Iterable[str] = (),
        let: Mapping[str, Any] | None = None,
        angles: Iterable[str] = (),
        name: str = "",
    ) -> Self:
        """Return a system with one mode, ``smooth``, and no transitions.

        Parameters
        ----------
        field : mapping of str to expression, or Mode
            The states, in this order, and their time derivatives; or a mode that has them.
        parameters : mapping of str to float, optional
            Parameters and their default values.
        phase : (str, expression), optional
            Name and rate of an angle, as in `HybridSystem`.
        outputs : mapping of str to expression, optional
            Named quantities that results record.
        positive : iterable of str, optional
            Parameters that must be positive.
        let : mapping of str to expression, optional
            Names of sub-expressions, as in `HybridSystem`.
        angles : iterable of str, optional
            States on a circle, as in `HybridSystem`.
        name : str, optional
            What the system is called in its `repr` and in files.

        Returns
        -------
        HybridSystem

        Raises
        ------
        DefinitionError
            A name or an expression that cannot be used; the message names it.

        Examples
        --------
        >>> print(HybridSystem.smooth({"x": "y", "y": "-k*x"}, {"k": 2.0}, name="spring"))
        HybridSystem 'spring'
          states      x, y
          parameters  k = 2.0
          mode smooth
            x' = y
            y' = -k*x
        """
        mode = field if isinstance(field, Mode) else Mode(mapping_of(field, "field", "of states to expressions"))
        rates = mapping_of(mode.field, "field", "of states to expressions")
        values = {} if parameters is None else parameters
        modes = {"smooth": mode}
        return cls(
            tuple(rates), values, modes, phase=phase, outputs=outputs, positive=positive, let=let, angles=angles,
            name=name,
        )  # fmt: skip

    def _prepare(self) -> None:
        super()._prepare()
        self._series: dict[int, CompiledSeries | None] = {}
        self._gradients: dict[tuple[tuple[str, ...], Formulas], CompiledGradients] = {}

    def gradients(self, expressions: tuple[str, ...], formulas: Formulas = ()) -> CompiledGradients:
        """Return compiled expressions with their gradients in states and parameters.

        Parameters
        ----------
        expressions : tuple of str
            In states, phase, parameters and outputs.
        formulas : tuple of (str, tuple of str), optional
            Formulas in parameters and further names, each with these names.

        Returns
        -------
        CompiledGradients
            Made once for each of both.

        Raises
        ------
        DefinitionError
            SymPy cannot differentiate an expression.
        """
        if (expressions, formulas) not in self._gradients:
            self._gradients[expressions, formulas] = compiled.load_gradients(self, expressions, formulas)
        return self._gradients[expressions, formulas]

    def series(self, order: int) -> CompiledSeries | None:
        """Return the compiled Taylor series of motions.

        Parameters
        ----------
        order : int
            Last coefficient.

        Returns
        -------
        CompiledSeries or None
            None where a mode's field has no series.

        Raises
        ------
        DefinitionError
            SymPy cannot read an expression.
        """
        if order not in self._series:
            self._series[order] = compiled.load_series(self, order)
        return self._series[order]

    @cached_property
    def linear(self) -> CompiledLinear:
        """The compiled linear parts of the modes."""
        return compiled.load_linear(self)

    @cached_property
    def laws(self) -> Laws:
        """Linear first integrals: see `conserved`."""
        return find_laws(self, self.compiled)

    @property
    def conserved(self) -> tuple[str, ...]:
        """Sums of states, with constant coefficients, that no field and no reset changes.

        They are found from the formulas. Equilibria, orbits and their branches keep the totals of their start, and
        their stability is that at these totals.

        Examples
        --------
        >>> network = HybridSystem.smooth({"A": "k*B - A", "B": "A - k*B"}, {"k": 2.0})
        >>> network.conserved
        ('A + B',)
        """
        return self.laws.names

    @cached_property
    def velocity_conditions(self) -> frozenset[int]:
        """Indices of the transitions whose condition is the speed at which the event's surface is crossed."""
        from saltus.system.conditions import velocity_conditions

        return velocity_conditions(self)

    def field(
        self, mode: str, state: ArrayLike, *, parameters: Mapping[str, float] | None = None
    ) -> NDArray[np.float64]:
        """Return the vector field of a mode at a state.

        Parameters
        ----------
        mode : str
            Its name.
        state : array_like, shape (states,) or (all states,)
            With the phase last, or without it at phase 0.
        parameters : mapping of str to float, optional
            Parameters that differ from the defaults.

        Returns
        -------
        ndarray, shape (all states,)
            Rates of the states, then that of the phase.

        Raises
        ------
        InputError
            There is no such mode; a state of another length; a parameter that cannot be used.
        """
        return self.compiled.field(self.mode_index(mode), self.full_state(state), self.parameter_vector(parameters))

    def _repr_html_(self) -> str:
        """Equations for a notebook."""
        from saltus.system.derivatives import Symbolic

        return Symbolic(self).as_html(self.name or "HybridSystem")

"""A map, smooth or piecewise smooth: its definition, and the functions compiled from it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.errors import DefinitionError
from saltus.system.compiled_definition import CompiledDefinition
from saltus.system.definition import Definition
from saltus.system.expressions import text_of
from saltus.system.hybrid import HybridSystem
from saltus.system.parts import Mode, clean_mode, listed, mapping_of, sequence_of
from saltus.system.tiling import check_tiling, piece_at, pieces_error

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


__all__ = ["SMOOTH", "Map", "Piece", "checked_system", "flowing"]

SMOOTH = "map"  # name of the one piece of a smooth map


@dataclass(frozen=True)
class Piece:
    """One smooth piece of a map, and where it holds.

    Parameters
    ----------
    image : mapping of str to expression
        Next value of each state.
    where : expression or sequence of expressions, optional
        Positive where the piece holds, all of them; a border is the zero of one.

    Examples
    --------
    >>> Piece({"x": "2*x"}, where="1/2 - x")
    Piece(x -> 2*x; where 1/2 - x > 0)
    """

    image: Mapping[str, Any]
    where: Any = ()

    def __repr__(self) -> str:
        is_mapping = isinstance(self.image, Mapping)
        equations = listed(self.image, ", {} -> {}").removeprefix(", ") if is_mapping else repr(self.image)
        conditions = self.where if isinstance(self.where, tuple | list) else (self.where,)
        return f"Piece({equations}{_where_text(conditions, '; where ')})"


class Map(CompiledDefinition):
    """A map of the states to their next values, smooth or piecewise smooth, defined once and symbolically.

    Exactly one of `image` and `pieces` is given. The pieces cover the space of the states, and do not overlap. This is
    checked when the map is made, at its default parameters, and at each state that is met. On a border the piece listed
    first holds; where the map is continuous, its neighbour has the same image there.

    Parameters
    ----------
    states : sequence of str
        Names of the states.
    parameters : mapping of str to float
        Parameters and their default values.
    image : mapping of str to expression, optional
        Next value of each state, for a smooth map; its one piece is called ``"map"``.
    pieces : mapping of str to Piece, optional
        Images by name, each with the conditions where it holds.
    outputs : mapping of str to expression (or to a mapping of piece to expression), optional
        Named quantities that results record.
    groups : mapping of str to sequence of str, optional
        A name that sets several parameters at once.
    positive : iterable of str, optional
        Parameters that must be positive.
    parameter_bounds : mapping of str to (float, float), optional
        Closed interval in which a parameter must lie.
    let : mapping of str to expression, optional
        Names of sub-expressions, as in `HybridSystem`.
    angles : iterable of str, optional
        States on a circle, in radians: images must be the same a turn on, but for whole turns, and orbits close
        modulo 2 pi.
    name : str, optional
        What the map is called in its `repr` and in files.

    Raises
    ------
    DefinitionError
        A name or an expression that cannot be used; pieces that leave a gap or overlap. The message names the piece.

    Examples
    --------
    >>> tent = Map(
    ...     ("x",), {"a": 1.8},
    ...     pieces={"left": Piece({"x": "a*x"}, where="1/2 - x"), "right": Piece({"x": "a*(1 - x)"}, where="x - 1/2")},
    ...     name="tent map",
    ... )
    >>> print(tent)
    Map 'tent map'
      states      x
      parameters  a = 1.8
      piece left, where 1/2 - x > 0
        x -> a*x
      piece right, where x - 1/2 > 0
        x -> a*(1 - x)
    >>> tent.piece_of([0.7]), round(float(tent.image([0.7])[0]), 2)
    ('right', 0.54)
    """

    unnamed = "a map"
    part = "piece"
    natural_returns = "iterations"
    iteration = 1.0
    span = "{:.0f} iterations"
    clock = "iterations"
    time_unit = "iteration"
    rate_unit = "1 / iteration"
    smooth_cure = "a piece on either side, with the difference of the two as its condition"

    def __init__(
        self,
        states: Sequence[str],
        parameters: Mapping[str, float],
        image: Mapping[str, Any] | None = None,
        *,
        pieces: Mapping[str, Piece] | None = None,
        outputs: Mapping[str, Any] | None = None,
        groups: Mapping[str, Sequence[str]] | None = None,
        positive: Iterable[str] = (),
        parameter_bounds: Mapping[str, tuple[float, float]] | None = None,
        let: Mapping[str, Any] | None = None,
        angles: Iterable[str] = (),
        name: str = "",
    ) -> None:
        if (image is None) == (pieces is None):
            given = "none" if image is None else "both"
            raise DefinitionError("image, pieces", given, "exactly one of the two given")
        if pieces is None:
            pieces = {SMOOTH: Piece(mapping_of(image, "image", "of each state to its next value"))}
        super().__init__(
            states, parameters, pieces, outputs=outputs, groups=groups, positive=positive,
            parameter_bounds=parameter_bounds, let=let, angles=angles, name=name,
        )  # fmt: skip

    def _clean_modes(self, modes: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Mode]:
        given = mapping_of(modes, "pieces", "of names to Piece")
        self.pieces = {key: _clean_piece(key, piece, names) for key, piece in given.items()}
        return {key: Mode(piece.image) for key, piece in self.pieces.items()}

    def _prepare(self) -> None:
        super()._prepare()
        if self.is_piecewise:
            check_tiling(self)

    @property
    def piece_names(self) -> tuple[str, ...]:
        """Names of the pieces, in the order of definition."""
        return tuple(self.pieces)

    @property
    def is_piecewise(self) -> bool:
        """Whether the map has pieces with conditions."""
        return len(self.pieces) > 1 or any(piece.where for piece in self.pieces.values())

    @property
    def conditions(self) -> dict[str, tuple[str, ...]]:
        """The conditions of each piece, all positive where it holds."""
        return {key: tuple(piece.where) for key, piece in self.pieces.items()}

    @cached_property
    def guards(self) -> NDArray[np.int64]:
        """Indices of the compiled guards: those of piece k are ``guards[k]`` to ``guards[k + 1] - 1``."""
        counts = [len(texts) for texts in self.conditions.values()]
        return len(self.pieces) + np.cumsum([0, *counts], dtype=np.int64)

    @cached_property
    def borders(self) -> HybridSystem:
        """The conditions of all pieces as functions with derivatives: the first state's rate in one mode for each."""
        first, *others = self.states
        texts = [text for conditions in self.conditions.values() for text in conditions]
        modes = {
            f"condition{k}": Mode({first: text, **dict.fromkeys(others, "0")}) for k, text in enumerate(texts)
        }  # fmt: skip
        return HybridSystem(self.states, self.parameters, modes, name=f"borders of {self.name or 'a map'}")

    def piece_index(self, x: NDArray[np.float64], p: NDArray[np.float64]) -> int:
        """Return the index of the piece that holds at a state.

        Parameters
        ----------
        x : ndarray, shape (states,)
            The state.
        p : ndarray, shape (parameters,)
            `parameter_vector`.

        Returns
        -------
        int
            Its place in `piece_names`; on a border the first of its pieces.

        Raises
        ------
        DefinitionError
            No piece holds there, or two do.
        """
        if not self.is_piecewise:
            return 0
        extended = self.compiled.extended(p)
        found = piece_at(self, np.ascontiguousarray(x, dtype=np.float64), extended)
        if found < 0:
            raise pieces_error(self, x, p)
        return found

    def piece_of(self, x: ArrayLike, *, parameters: Mapping[str, float] | None = None) -> str:
        """Return the name of the piece that holds at a state.

        Parameters
        ----------
        x : array_like, shape (states,)
            The state.
        parameters : mapping of str to float, optional
            Parameters that differ from the defaults.

        Returns
        -------
        str
            On a border the first of its pieces.

        Raises
        ------
        InputError
            A state of another length; a parameter that cannot be used.
        DefinitionError
            No piece holds there, or two do.
        """
        return self.piece_names[self.piece_index(self.full_state(x, "x"), self.parameter_vector(parameters))]

    def image(self, x: ArrayLike, *, parameters: Mapping[str, float] | None = None) -> NDArray[np.float64]:
        """Return the image of a state.

        Parameters
        ----------
        x, parameters
            As in `piece_of`.

        Returns
        -------
        ndarray, shape (states,)
            The next state.

        Raises
        ------
        InputError
            A state of another length; a parameter that cannot be used.
        DefinitionError
            No piece holds there, or two do.
        """
        state, p = self.full_state(x, "x"), self.parameter_vector(parameters)
        return self.compiled.field(self.piece_index(state, p), state, p)

    def jacobian(self, x: ArrayLike, *, parameters: Mapping[str, float] | None = None) -> NDArray[np.float64]:
        """Return the derivative of the image of a state, that of the piece that holds there.

        Parameters
        ----------
        x, parameters
            As in `piece_of`.

        Returns
        -------
        ndarray, shape (states, states)
            Row by row the derivatives of each state's next value.

        Raises
        ------
        InputError
            A state of another length; a parameter that cannot be used.
        DefinitionError
            No piece holds there, or two do.
        """
        state, p = self.full_state(x, "x"), self.parameter_vector(parameters)
        return self.compiled.linearised(self.piece_index(state, p), state, self.compiled.extended(p))[1]

    def definition(self) -> dict[str, Any]:
        """Return the definition as plain data, from which `from_definition` makes an equal map."""
        shared = super().definition()
        pieces = {key: {"image": dict(piece.image), "where": list(piece.where)} for key, piece in self.pieces.items()}
        kept = ("outputs", "groups", "positive", "parameter_bounds", "angles")
        return {key: shared[key] for key in ("name", "states", "parameters")} | {
            "pieces": pieces, **{key: shared[key] for key in kept if key in shared},
        }  # fmt: skip

    @classmethod
    def from_definition(cls, definition: Mapping[str, Any]) -> Self:
        """Return the map that plain data describe.

        Parameters
        ----------
        definition : mapping
            As `definition` returns it.

        Returns
        -------
        Map
            Equal to the one that returned the data.

        Raises
        ------
        DefinitionError
            The data are not of this form, or a name or an expression cannot be used.
        """
        data = dict(mapping_of(definition, "definition", "as Map.definition returns it"))
        try:
            pieces = {key: Piece(**piece) for key, piece in data.pop("pieces").items()}
            return cls(pieces=pieces, **data)
        except (AttributeError, KeyError, TypeError) as error:
            hint = f"{type(error).__name__}: {error}"
            raise DefinitionError("definition", list(data), "as Map.definition returns it", hint) from error

    def __str__(self) -> str:
        shown = []
        for line in super().__str__().splitlines():
            if line.startswith("  mode "):
                key = line.removeprefix("  mode ")
                line = f"  piece {key}{_where_text(self.pieces[key].where, ', where ')}"
            shown.append(line.replace("' = ", " -> ", 1) if line.startswith("    ") else line)
        return "\n".join(shown)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """Equations for a notebook."""
        from saltus.system.derivatives import Symbolic

        return Symbolic(self).as_html(self.name or "Map")


def flowing(system: object, instead: str = "") -> HybridSystem:
    """Return a system that moves in continuous time.

    Parameters
    ----------
    system : object
        What was given as the system.
    instead : str, optional
        What to use for a map.

    Raises
    ------
    InputError
        It is a map, or no system at all.
    """
    hint = f"this is {system.unnamed}: use {instead}" if isinstance(system, Definition) and instead else ""
    return checks.instance("system", system, HybridSystem, hint)


def checked_system(system: HybridSystem | Map) -> HybridSystem | Map:
    """Return a system of any kind; raise `InputError` for what is none."""
    return system if isinstance(system, Definition) else flowing(system)


def _clean_piece(key: str, piece: Piece, names: tuple[str, ...]) -> Piece:
    """Return a piece whose expressions are texts that can be read, its conditions as a tuple."""
    where = f"piece {key!r}"
    if not isinstance(piece, Piece):
        raise DefinitionError(where, piece, "a Piece")
    if not isinstance(piece.image, Mapping):
        raise DefinitionError(where, piece.image, "a mapping of each state to its next value as the image")
    given = () if piece.where is None else piece.where
    conditions = sequence_of(given, where, "of conditions") if isinstance(given, list | tuple) else (given,)
    image = clean_mode(key, Mode(piece.image), names, part=Map.part).field
    return Piece(image, tuple(text_of(condition, where, names) for condition in conditions))


def _where_text(conditions: Iterable[Any], before: str) -> str:
    texts = [f"{condition} > 0" for condition in conditions if condition is not None]
    return f"{before}{' and '.join(texts)}" if texts else ""

"""What all curves share: their `repr`, and special points and rows of different lengths as variables of a Dataset."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.contents import Contents, complex_of
from saltus.continuation.problems.ends.connection import Homoclinic
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.equilibria import Equilibrium
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.orbits.observables.faults import MOST_FAULTS
from saltus.orbits.signature import Signature
from saltus.orbits.unfolding import Fixed
from saltus.system import HybridSystem
from saltus.system.plain import all_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "column_name",
    "complex_table",
    "ragged_rows",
    "special_points_of",
    "special_variables",
    "texts_array",
]


def column_name(name: str, taken: Collection[str]) -> str:
    """Return the variable of a curve's dataset that holds a varied parameter or quantity.

    Examples
    --------
    >>> column_name("A", ["form"]), column_name("form", ["form"]), column_name("amplitude(x, 1/2)", [])
    ('A', 'varied_form', 'varied_quantity')
    """
    if "(" in name:
        return "varied_quantity"
    return f"varied_{name}" if name in taken else name


def special_variables(
    points: SpecialPoints, varied: tuple[str, ...], multipliers: int, forms: list[Signature], system: HybridSystem
) -> dict[str, Any]:
    """Return special points as variables of a Dataset.

    Parameters
    ----------
    points : SpecialPoints
        The points.
    varied : tuple of str
        The parameters that vary.
    multipliers : int
        Number of Floquet multipliers of an orbit.
    forms : list of Signature
        Signatures, including the points' signatures.
    system : HybridSystem
        The orbits' system.
    """
    specials = list(points)
    orbits = [point.orbit for point in specials]
    blocks = [orbit.unknowns for orbit in orbits]
    tangents = [np.empty(0) if point.tangent is None else point.tangent for point in specials]
    states, quantities = len(system.states), len(system.all_states) + len(system.output_names)
    values = [[_own_value(point, name) for name in varied] for point in specials]
    freed = [orbit.fixed.free and orbit.parameters[orbit.fixed.free] for orbit in orbits if orbit.fixed is not None]

    def stack(rows: list[Any], width: int) -> NDArray[np.float64]:
        return np.array(rows, dtype=np.float64).reshape(len(rows), width)

    width = multipliers
    kinds = [point.kind for point in specials]
    told = {"special_kind": ("special", texts_array(kinds))} if any(kinds) else {}
    further = told if len(freed) < len(orbits) or not freed else told | {"special_freed": ("special", _numbers(freed))}
    return further | {
        "special_type": ("special", texts_array([point.type for point in specials])),
        "special_label": ("special", texts_array([point.label for point in specials])),
        "special_of": ("special", texts_array([point.of for point in specials])),
        "special_locus": ("special", texts_array([point.locus for point in specials])),
        "special_value": (("special", "parameter"), stack(values, len(varied))),
        "special_test": ("special", np.array([point.test for point in specials], dtype=float)),
        "special_arclength": ("special", np.array([point.arclength for point in specials], dtype=float)),
        "special_position": ("special", np.array([point.position for point in specials], dtype=float)),
        "special_x0": (("special", "state"), stack([o.x0 for o in orbits], states)),
        "special_multiplier_re": (("special", "multiplier"), stack([o.multipliers.real for o in orbits], width)),
        "special_multiplier_im": (("special", "multiplier"), stack([o.multipliers.imag for o in orbits], width)),
        "special_low": (("special", "quantity"), stack([o.lows for o in orbits], quantities)),
        "special_high": (("special", "quantity"), stack([o.highs for o in orbits], quantities)),
        "special_residual": ("special", np.array([o.residual for o in orbits], dtype=float)),
        "special_faults": ("special", np.array([o.faults for o in orbits], dtype=np.int64)),
        "special_implicit": ("special", np.array([o.implicit for o in orbits], dtype=np.int8)),
        "special_form": ("special", np.array([forms.index(o.form) for o in orbits], dtype=np.int64)),
        "special_unknown": ("special_ragged", np.concatenate([*blocks, np.empty(0)])),
        "special_unknown_count": ("special", np.array([len(block) for block in blocks], dtype=np.int64)),
        **_saddles(specials, varied, states),
        "special_tangent": ("tangent_ragged", np.concatenate([*tangents, np.empty(0)])),
        "special_tangent_count": ("special", np.array([len(row) for row in tangents], dtype=np.int64)),
    }


def _saddles(specials: list[Any], varied: tuple[str, ...], states: int) -> dict[str, Any]:
    """Return the equilibria of homoclinic orbits as variables; NaN at other special points."""
    count = len(specials)
    values, places = np.full((count, len(varied)), np.nan), np.full((count, states), np.nan)
    modes = np.full(count, -1)
    eigenvalues, residuals = np.full((count, states), np.nan, dtype=np.complex128), np.full(count, np.nan)
    for i, point in enumerate(specials):
        if point.homoclinic is not None:
            saddle = point.homoclinic.saddle
            values[i] = [saddle.parameters[name] for name in varied]
            places[i], residuals[i] = saddle.state, saddle.residual
            eigenvalues[i, : saddle.eigenvalues.size] = saddle.eigenvalues
            modes[i] = saddle.system.mode_index(saddle.mode)
    return {
        "special_saddle_value": (("special", "parameter"), values),
        "special_saddle": (("special", "state"), places),
        "special_eigenvalue_re": (("special", "state"), eigenvalues.real),
        "special_eigenvalue_im": (("special", "state"), eigenvalues.imag),
        "special_saddle_residual": ("special", residuals),
        "special_saddle_mode": ("special", modes),
    }


def _saddles_of(
    held: Contents,
    system: HybridSystem,
    parameters: Mapping[str, float],
    varied: tuple[str, ...],
    starts: list[int],
    events: list[str],
) -> list[Homoclinic | None]:
    """Return what `_saddles` wrote, for special points whose orbits start in given modes, and the events met there."""
    modes = starts  # so it is in files of version 0.1
    if "special_saddle_mode" in held.dataset:
        modes = held.array("special_saddle_mode", ("special",), int, least=-1, most=len(system.modes) - 1).tolist()
    values = held.array("special_saddle_value", ("special", "parameter"), finite=False)
    places = held.array("special_saddle", ("special", "state"), finite=False)
    eigenvalues = complex_table(held, "special_eigenvalue", ("special", "state"))
    residuals = held.array("special_saddle_residual", ("special",), finite=False)
    found: list[Homoclinic | None] = []
    for value, place, own, residual, mode, event in zip(
        values, places, eigenvalues, residuals, modes, events, strict=True
    ):
        if not np.all(np.isfinite(place)):
            found.append(None)
            continue
        own_parameters = {**parameters, **dict(zip(varied, value.tolist(), strict=True))}
        name = system.mode_names[mode]
        values_there = own[: system.freedom]
        saddle = Equilibrium(system, all_parameters(own_parameters, system), name, place, values_there, float(residual))
        found.append(Homoclinic(saddle, event))
    return found


def special_points_of(
    held: Contents,
    system: HybridSystem,
    along: tuple[Mapping[str, float], tuple[str, ...], Fixed | None],
    forms: list[Signature],
    tolerance: float,
) -> list[SpecialPoint]:
    """Return the special points that `special_variables` wrote to a curve's file.

    along: parameters at the start, what varies, and what is fixed and freed along a quantity.
    """
    parameters, varied, fixed = along
    special = ("special",)
    wide, number = len(system.all_states) + 1, held.array("special_form", special, int, least=0, most=len(forms) - 1)
    sizes = [len(forms[i]) * wide for i in number.tolist()]
    blocks = ragged_rows(held, "special_unknown", "special_ragged", "special", sizes)
    with_tangent = held.array("special_tangent_count", special, int, least=0) > 0
    lengths = [size + 1 if there else 0 for size, there in zip(sizes, with_tangent.tolist(), strict=True)]
    tangents = ragged_rows(held, "special_tangent", "tangent_ragged", "special", lengths)
    text = {name: held.array(f"special_{name}", special, str) for name in ("type", "label", "of", "locus")}
    real = {
        name: held.array(f"special_{name}", special, finite=name in ("position", "arclength"))
        for name in ("test", "position", "arclength", "residual")
    }
    values = held.array("special_value", ("special", "parameter"))
    multipliers = complex_table(held, "special_multiplier", ("special", "multiplier"))
    x0 = held.array("special_x0", ("special", "state"), finite=False)
    both = ("special", "quantity")
    lows, highs = (held.first_finite(f"special_{end}", both, wide - 1) for end in ("low", "high"))
    faults = held.array("special_faults", special, int, least=0, most=MOST_FAULTS)
    implicit = np.zeros(len(blocks), dtype=np.bool_)
    if "special_implicit" in held.dataset:  # absent from earlier files
        implicit = held.array("special_implicit", special, bool)
    freed = held.array("special_freed", special, finite=False) if "special_freed" in held.dataset else None
    kinds = text["type"].size * [""]
    if "special_kind" in held.dataset:  # of points that have none, and in earlier files, it is absent
        kinds = held.array("special_kind", special, str).tolist()
    events = [of if type_ in ("BC", "BE") else "" for type_, of in zip(text["type"], text["of"], strict=True)]
    saddles = _saddles_of(held, system, parameters, varied, [forms[i].modes[0] for i in number.tolist()], events)
    specials = []
    for i, block in enumerate(blocks):
        own = dict(zip(varied, values[i].tolist(), strict=True))
        if fixed is not None:
            own = {fixed.free: float(freed[i])} if fixed.free and freed is not None else {}
        table = block.reshape(-1, wide)
        orbit = PeriodicOrbit(
            system,
            all_parameters({**parameters, **own}, system),
            forms[number[i]],
            table[:, :-1],
            table[:, -1],
            multipliers[i],
            float(real["residual"][i]),
            int(faults[i]),
            x0[i],
            lows[i],
            highs[i],
            tolerance,
            None if fixed is None else replace(fixed, value=float(values[i, 0])),
            bool(implicit[i]),
        )
        specials.append(
            SpecialPoint(
                str(text["type"][i]),
                str(text["label"][i]),
                orbit,
                float(real["test"][i]),
                float(real["position"][i]),
                float(real["arclength"][i]),
                varied,
                str(text["of"][i]),
                str(text["locus"][i]),
                tangents[i] if tangents[i].size else None,
                str(kinds[i]),
                homoclinic=saddles[i],
            )
        )
    return specials


def texts_array(texts: list[str]) -> NDArray[np.object_]:
    """Return texts as an array that a Dataset can hold, also where there is none."""
    return np.array(texts, dtype=object)


def _own_value(point: SpecialPoint, name: str) -> float:
    """Return a varied parameter or quantity of the point's own orbit; at a HOM the saddle's parameters differ."""
    return point.value(name) if point.homoclinic is None else point.solution.parameters[name]


def _numbers(values: list[Any]) -> NDArray[np.float64]:
    """Return numbers, NaN in place of an empty text."""
    return np.array([np.nan if value == "" else value for value in values], dtype=float)


def complex_table(held: Contents, name: str, dims: tuple[str, ...]) -> NDArray[np.complex128]:
    """Return a complex variable from its real and imaginary parts ``<name>_re`` and ``<name>_im``."""
    return complex_of(*(held.array(f"{name}_{part}", dims, finite=False) for part in ("re", "im")))


def ragged_rows(held: Contents, name: str, ragged: str, dim: str, sizes: list[int]) -> tuple[NDArray[np.float64], ...]:
    """Return the parts of a ragged variable; raise `InputError` where their sizes are not `sizes`."""
    counts, values = held.array(f"{name}_count", (dim,), int, least=0), held.array(name, (ragged,))
    if counts.tolist() != sizes or values.size != sum(sizes):
        told = f"those of the signatures: {sum(sizes)} numbers"
        raise InputError(f"counts of variable {name!r}", f"{counts.sum()} for {values.size} numbers", told)
    return tuple(np.split(values, np.cumsum(sizes, dtype=np.int64))[:-1])

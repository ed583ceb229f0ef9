"""What all curves share: their `repr`, and special points and rows of different lengths as variables of a Dataset."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.contents import Contents
from saltus.continuation.special_points import SpecialPoint, SpecialPoints
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.orbits.orbit import MOST_FAULTS, complex_of
from saltus.orbits.signature import Signature
from saltus.system import HybridSystem
from saltus.system.plain import all_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["complex_table", "described", "ragged_rows", "special_points_of", "special_variables", "texts_array"]


def described(curve: Any, what: str, solutions: str) -> str:
    """Return the text of a curve's `repr`: kind, range, ends and special points.

    Parameters
    ----------
    curve : OrbitCurve or EquilibriumCurve
        The curve.
    what : str
        Its kind in words.
    solutions : str
        What its points are, as ``orbits``.
    """
    of = curve.system.name or "a hybrid system"
    lines = [f"{what} of {of}: {len(curve)} {solutions}, {int(curve.stable.sum())} stable"]
    for name, column in zip(curve.varied, curve.values.reshape(len(curve), -1).T, strict=True):
        ends = (column.min(), column.max()) if len(curve) else (np.nan, np.nan)
        lines[0] += ", {} from {:.9g} to {:.9g}".format(name, *ends)
    lines += [f"  began: {curve.stopped[0]}", f"  ended: {curve.stopped[1]}"]
    lines += [f"  {line}" for line in repr(curve.special_points).splitlines()]
    return "\n".join(lines)


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
    values = [[point.parameters[name] for name in varied] for point in specials]

    def stack(rows: list[Any], width: int) -> NDArray[np.float64]:
        return np.array(rows, dtype=np.float64).reshape(len(rows), width)

    width = multipliers
    return {
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
        "special_form": ("special", np.array([forms.index(o.form) for o in orbits], dtype=np.int64)),
        "special_unknown": ("special_ragged", np.concatenate([*blocks, np.empty(0)])),
        "special_unknown_count": ("special", np.array([len(block) for block in blocks], dtype=np.int64)),
        "special_tangent": ("tangent_ragged", np.concatenate([*tangents, np.empty(0)])),
        "special_tangent_count": ("special", np.array([len(row) for row in tangents], dtype=np.int64)),
    }


def special_points_of(
    held: Contents,
    system: HybridSystem,
    parameters: Mapping[str, float],
    varied: tuple[str, ...],
    forms: list[Signature],
    tolerance: float,
) -> list[SpecialPoint]:
    """Return the special points that `special_variables` wrote to a curve's file."""
    special = ("special",)
    wide, number = len(system.all_states) + 1, held.array("special_form", special, int, least=0, most=len(forms) - 1)
    sizes = [len(forms[i]) * wide for i in number.tolist()]
    blocks = ragged_rows(held, "special_unknown", "special_ragged", "special", sizes)
    with_tangent = held.array("special_tangent_count", special, int, least=0) > 0
    lengths = [size + 1 if there else 0 for size, there in zip(sizes, with_tangent.tolist(), strict=True)]
    tangents = ragged_rows(held, "special_tangent", "tangent_ragged", "special", lengths)
    text = {name: held.array(f"special_{name}", special, str) for name in ("type", "label", "of", "locus")}
    real = {
        name: held.array(f"special_{name}", special, finite=False)
        for name in ("test", "position", "arclength", "residual")
    }
    values = held.array("special_value", ("special", "parameter"))
    multipliers = complex_table(held, "special_multiplier", ("special", "multiplier"))
    x0 = held.array("special_x0", ("special", "state"), finite=False)
    lows, highs = (held.array(f"special_{end}", ("special", "quantity"), finite=False) for end in ("low", "high"))
    faults = held.array("special_faults", special, int, least=0, most=MOST_FAULTS)
    specials = []
    for i, block in enumerate(blocks):
        table = block.reshape(-1, wide)
        orbit = PeriodicOrbit(
            system,
            all_parameters({**parameters, **dict(zip(varied, values[i].tolist(), strict=True))}, system),
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
            )
        )
    return specials


def texts_array(texts: list[str]) -> NDArray[np.object_]:
    """Return texts as an array that a Dataset can hold, also where there is none."""
    return np.array(texts, dtype=object)


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

"""Linear first integrals found from the formulas: sums of states that no field and no reset changes.

Such totals are the moles of an element in a closed vessel, or the charge between capacitors in series. Coefficients are
polynomials of the parameters. The compiled fields and resets, at places drawn at random, show how many integrals there
can be: none for most systems, and then no formula is looked at. docs/theory/conserved.md says how the others are found.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.scales import ILL_CONDITIONED, WRITTEN, as_written, near_rank
from saltus.system.integrals.laws import NONE, Laws

if TYPE_CHECKING:
    from collections.abc import Sequence

    import sympy
    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled
    from saltus.system.definition import Definition
    from saltus.system.derivatives import Symbolic

__all__ = ["find_laws"]

_MORE = 6  # places beyond the number of states at which formulas are compared with each other
_SEED = 11  # of the places
_BALANCINGS = 40  # rounds in which rows and columns are brought to like sizes
_SHORT = 2000  # operations of a sum of rates up to which it is asked whether it is 0 by algebra


def find_laws(system: Definition, compiled: Compiled) -> Laws:
    """Return the linear first integrals of a hybrid system; those with an angle are left out."""
    drawn = _drawn(system, compiled)
    count = drawn.shape[1] if not drawn.size else drawn.shape[1] - _rank(drawn)
    if count == 0:
        return NONE
    from saltus.system.derivatives import Symbolic

    symbolic = Symbolic(system)
    table = _terms(symbolic, len(system.states))
    found = _by_terms(table, symbolic)
    if len(found) < count:
        numbers = _numbers(table)  # decimals, which cancel but for rounding
        near = [_as_row(law) for law in _candidates(numbers) if _cancels(numbers * law)]
        found = near if len(near) > len(found) else found
    if len(found) < count:  # equal terms that look different
        rows = [_as_row(law) for law in _candidates(drawn)]
        near = [row for row in rows if _vanishes(row, symbolic)]
        found = near if len(near) > len(found) else found
    angles = set(system.angle_places.tolist())
    return _as_laws(symbolic, [row for row in found if not any(row[i] != 0 for i in angles)], len(system.states))


def _places(system: Definition, n: int, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return parameters and full states at random, shape (place, n)."""
    p = np.array([system.parameters[name] for name in system.parameter_names], dtype=float)
    p = np.where(p == 0.0, 1.0, p) * rng.uniform(0.6, 1.4, p.size)
    x = rng.uniform(0.2, 1.8, (n + _MORE, n))
    x[::3] *= rng.choice([-1.0, 1.0], x[::3].shape)
    return p, x


def _drawn(system: Definition, compiled: Compiled) -> NDArray[np.float64]:
    """Return rates and jumps of the states at places and parameters drawn at random, shape (place, state)."""
    count, rng = len(system.states), np.random.default_rng(_SEED)
    p, places = _places(system, compiled.n, rng)
    rows: list[NDArray[np.float64]] = []
    extended, out = compiled.extended(p), np.empty(compiled.n)
    for mode in range(len(system.modes)):
        before = len(rows)
        for x in places:
            compiled.call("field", mode, 0, x, extended, out)
            if np.all(np.isfinite(out)):
                rows.append(out[:count].copy())
        if len(rows) == before:  # nothing is known of it
            return np.eye(count)
    for k, transition in enumerate(system.transitions):
        for x in places if transition.reset else ():
            compiled.call("reset", k, 0, x, extended, out)
            if np.all(np.isfinite(out)):
                rows.append((out - x)[:count])
    return np.array(rows)


def _scaled(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a matrix whose entries are as near to 1 as units of rows and columns make them, and the columns' units."""
    rows = rows[np.any(rows != 0.0, axis=1)]
    there = rows != 0.0
    logs = np.log(np.abs(rows), where=there, out=np.zeros(rows.shape))
    across, down = np.zeros(rows.shape[0]), np.zeros(rows.shape[1])
    for _ in range(_BALANCINGS):
        across = np.sum((logs - down) * there, axis=1) / np.maximum(there.sum(axis=1), 1)
        down = np.sum((logs - across[:, None]) * there, axis=0) / np.maximum(there.sum(axis=0), 1)
    return rows * np.exp(-across)[:, None] * np.exp(-down), np.exp(down)


def _rank(rows: NDArray[np.float64]) -> int:
    scaled = _scaled(rows)[0]
    return near_rank(np.linalg.svd(scaled, compute_uv=False)) if scaled.size else 0


def _exact(expression: sympy.Expr) -> sympy.Expr:
    """Return an expression whose decimal numbers are fractions."""
    import sympy

    return expression.xreplace({f: sympy.Rational(repr(float(f))) for f in expression.atoms(sympy.Float)})


def _terms(symbolic: Symbolic, count: int) -> dict[tuple[int, Any], list[Any]]:
    """Return for each term of the rates and jumps its factor, made of numbers and parameters, in each of them."""
    import sympy

    states = set(symbolic.x)
    changes = [[_exact(f) for f in field[:count]] for field in symbolic.field]
    changes += [[_exact(r - x) for r, x in zip(reset[:count], symbolic.x, strict=False)] for reset in symbolic.reset]
    table: dict[tuple[int, Any], list[Any]] = {}
    for k, change in enumerate(changes):
        for i, expression in enumerate(change):
            for term in sympy.Add.make_args(sympy.expand(expression)):
                factor, kernel = term.as_independent(*states, as_Add=False)
                row = table.setdefault((k, kernel), [sympy.S.Zero] * count)
                row[i] += factor
    return table


def _numbers(table: dict[tuple[int, Any], list[Any]]) -> NDArray[np.float64]:
    """Return the numbers before each product of parameters and terms, shape (product, state)."""
    import sympy

    parted: dict[tuple[Any, Any], list[float]] = {}
    for key, row in table.items():
        for i, factor in enumerate(row):
            for term in sympy.Add.make_args(factor):
                number, rest = term.as_coeff_Mul()
                parted.setdefault((key, rest), [0.0] * len(row))[i] += float(number)
    return np.array(list(parted.values()))


def _by_terms(table: dict[tuple[int, Any], list[Any]], symbolic: Symbolic) -> list[list[Any]]:
    """Return the integrals as rows of expressions, from the terms that the rates have in common."""
    rows = list(table.values())
    return _null_space(rows, symbolic, len(rows[0]))


def _null_space(rows: list[list[Any]], symbolic: Symbolic, count: int) -> list[list[Any]]:
    """Return rows that span the null space of a matrix, polynomials of the parameters without common factors."""
    import sympy
    from sympy.polys.matrices import DomainMatrix

    matrix = DomainMatrix.from_Matrix(sympy.Matrix(len(rows), count, [entry for row in rows for entry in row]))
    null = matrix.to_field().nullspace()
    if not null.shape[0]:
        return []
    reduced = null.to_field().rref()[0].to_Matrix()
    found = []
    for i in range(reduced.rows):
        entries = [sympy.together(entry) for entry in reduced.row(i)]
        common = sympy.lcm_list([sympy.denom(entry) for entry in entries])
        entries = [sympy.cancel(entry * common) for entry in entries]
        shared = sympy.gcd_list([entry for entry in entries if entry != 0])
        entries = [sympy.cancel(entry / shared) for entry in entries]
        if all(entry.is_polynomial(*symbolic.p) and entry.free_symbols <= set(symbolic.p) for entry in entries):
            found.append([sympy.expand(entry) for entry in entries])
    return found


def _candidates(rows: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return coefficients of integrals, numbers alone, as far as a matrix tells that they take to 0."""
    scaled, columns = _scaled(rows)
    if not scaled.size:
        return list(np.eye(rows.shape[1]))
    _, values, right = np.linalg.svd(scaled)
    found = []
    for row in _reduced(right[near_rank(values) :]):
        law = row / columns
        law /= law[np.flatnonzero(row)[0]]
        found.append(np.array([as_written(value) for value in law.tolist()]))
    return found


def _cancels(parts: NDArray[np.float64]) -> bool:
    """Return whether the numbers in each row add up to 0 but for their rounding."""
    return bool(np.all(np.abs(parts.sum(axis=1)) <= WRITTEN * np.abs(parts).sum(axis=1)))


def _as_row(law: NDArray[np.float64]) -> list[Any]:
    import sympy

    return [sympy.Rational(repr(value)) for value in law.tolist()]


def _vanishes(row: list[Any], symbolic: Symbolic) -> bool:
    """Return whether all fields and resets leave a sum of the states as it is, by the algebra of their formulas."""
    import sympy

    count = len(row)
    changes = [field[:count] for field in symbolic.field]
    changes += [[r - x for r, x in zip(reset[:count], symbolic.x, strict=False)] for reset in symbolic.reset]
    sums = [sympy.Add(*(factor * _exact(f) for factor, f in zip(row, change, strict=True))) for change in changes]
    return all(total.count_ops() < _SHORT and sympy.cancel(sympy.together(total)) == 0 for total in sums)


def _reduced(basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a basis in reduced row echelon form; entries that are rounding are 0."""
    A, row = basis.copy(), 0
    for column in range(A.shape[1]):
        if row == len(A):
            break
        at = row + int(np.argmax(np.abs(A[row:, column])))
        if abs(A[at, column]) < ILL_CONDITIONED:
            continue
        A[[row, at]] = A[[at, row]]
        A[row] /= A[row, column]
        others = np.arange(len(A)) != row
        A[others] -= np.outer(A[others, column], A[row])
        row += 1
    A[np.abs(A) < ILL_CONDITIONED] = 0.0
    return np.asarray(A)


def _as_laws(symbolic: Symbolic, found: Sequence[Sequence[Any]], count: int) -> Laws:
    import sympy

    if not found:
        return NONE
    names, parts = [], []
    for k, row in enumerate(found):
        names.append(str(sympy.Add(*(entry * x for entry, x in zip(row, symbolic.x, strict=False)))))
        for i, entry in enumerate(row):
            if entry == 0:
                continue
            terms = sympy.Poly(entry, *symbolic.p).terms() if symbolic.p else [((), entry)]
            parts += [(k, i, float(factor), powers) for powers, factor in terms]
    rows, columns, coefficients, powers = zip(*parts, strict=True)
    width = len(symbolic.p)
    return Laws(
        tuple(names), np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64), np.array(coefficients),
        np.array(powers, dtype=np.int64).reshape(len(parts), width), count,
    )  # fmt: skip

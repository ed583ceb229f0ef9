"""Normal forms of a field at its critical equilibria: saddle-node, cusp, Hopf, Bogdanov-Takens.

docs/theory/equilibria.md, "Normal forms", lists the formulas.

References
----------
Kuznetsov, Elements of Applied Bifurcation Theory, Springer 2004, sections 5.4, 8.2 to 8.4 and 8.7; the first Lyapunov
coefficient is his (5.39). Kuznetsov, Int. J. Bifurcation Chaos 15 (2005) 3535-3546 (Bogdanov-Takens).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from saltus.algebraic.newton import state_sizes
from saltus.equilibria.spectrum import eigenvalues
from saltus.errors import InputError
from saltus.scales import EPS, SEPARATED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["NORMAL_FORMS", "EquilibriumNormalForm", "HopfTerms", "check_no_zero", "cusp_coefficient",
           "fold_coefficient", "hopf_terms", "lyapunov_coefficient", "normal_form", "null_pair"]  # fmt: skip

NORMAL_FORMS = ("SN", "HB", "CP", "BT")  # types of special points that have a normal form here
_SHOWN = 5e-10  # error of a coefficient, over it, from which on it is shown: the last digit that is printed
_SAMPLES = 4  # Jacobians with other rounding, which show the error of a coefficient
_ROUNDS = 3  # Rayleigh quotients, each of which triples the digits of an eigenvalue
_NOISE = 1e-10  # size of a coefficient, over its terms, up to which it is rounding
_ZERO_HOPF = 1e-7  # modulus of an eigenvalue, over the pair's, below which it is 0
_FAR = 1e-3  # distance of an eigenvalue from the critical one, over the largest, above which a point is not critical


@dataclass(frozen=True)
class EquilibriumNormalForm:
    """Normal form of a field on the centre manifold of a critical equilibrium."""

    # ``SN``: x' = a x^2; ``CP``: x' = c x^3; ``HB``: z' = i w z (1 + ...) + w l1 z abs(z)^2; ``BT``: x' = y, y' = a x^2
    # + b x y
    type: str
    # a, c, the first Lyapunov coefficient l1, or the product a b. Critical eigenvectors have unit length in the states:
    # other coordinates keep the signs of c, l1 and a b, but not their sizes. That of a SN changes sign with the
    # eigenvector.
    coefficient: float
    frequency: float = 0.0  # imaginary part w of the critical pair, in radians per unit of time; 0 but for ``HB``
    error: float = 0.0  # of l1: what rounding of the Jacobian makes of it; 0 but for ``HB``

    @property
    def criticality(self) -> str:
        """What is born: at HB ``supercritical`` (stable within the centre manifold) or ``subcritical`` cycles.

        Other points are ``nondegenerate``. Where the coefficient vanishes, but for rounding, ``degenerate``: at HB the
        cycles may all lie at one value of the parameter, as those of a linear field do.
        """
        if self.coefficient == 0.0:
            return "degenerate"
        if self.type == "HB":
            return "supercritical" if self.coefficient < 0.0 else "subcritical"
        return "nondegenerate"

    def __repr__(self) -> str:
        name = "l1" if self.type == "HB" else "coefficient"
        frequency = f", frequency {self.frequency:.9g}" if self.type == "HB" else ""
        error = f" +- {self.error:.1g}" if self.error > _SHOWN * abs(self.coefficient) else ""
        return (
            f"EquilibriumNormalForm {self.type}: {self.criticality}, {name} = {self.coefficient:.9g}{error}{frequency}"
        )


def normal_form(
    problem: EquilibriumProblem, u: NDArray[np.float64], kind: str, sizes: NDArray[np.float64] | None = None
) -> EquilibriumNormalForm:
    """Return the normal form at a critical equilibrium.

    Parameters
    ----------
    problem : EquilibriumProblem
        The equations.
    u : ndarray, shape (n + active,)
        The equilibrium, located.
    kind : {"SN", "HB", "CP", "BT"}
        Type of the point.
    sizes : ndarray, shape (n,), optional
        Typical sizes of the states; by default those at the equilibrium.

    Raises
    ------
    InputError
        `kind` is another, or no eigenvalue is near the critical one.
    """
    if kind not in NORMAL_FORMS:
        raise InputError("type", kind, f"one of {', '.join(NORMAL_FORMS)}", "no normal form belongs to it")
    J = problem.evaluate(u)[1]
    sizes = state_sizes(problem, u, J) if sizes is None else sizes
    scaled = _Scaled(problem, np.where(sizes > 0.0, sizes, 1.0))
    A = J[:, : problem.n] * scaled.sizes / scaled.sizes[:, None]
    values = eigenvalues(A)
    top = float(np.linalg.norm(A, 2))
    if kind == "HB":
        pair = values[np.argmin(np.where(values.imag > 0.0, np.abs(values.real), np.inf))]
        if not pair.imag > 0.0 or abs(pair.real) > _FAR * top:
            raise InputError("point", f"eigenvalues {values}", "an equilibrium with an imaginary pair, as every HB has")
        w = float(pair.imag)
        check_no_zero(values, w)
        l1 = lyapunov_coefficient(problem, u, J, w, sizes)
        error = lyapunov_error(problem, u, J, w, sizes, l1)
        if not error <= max(abs(l1), EPS):
            hint = "rates beside it are too fast for its last bits"
            raise InputError(
                "point", f"l1 = {l1:.3g} +- {error:.1g}", "one with a known first Lyapunov coefficient", hint
            )
        return EquilibriumNormalForm(kind, l1, w, error)
    if problem.n > 1 and float(np.abs(values).min()) > _FAR * top:
        raise InputError("point", f"eigenvalues {values}", f"an equilibrium with an eigenvalue 0, as every {kind} has")
    q, p = null_pair(A)
    if kind == "BT":
        return EquilibriumNormalForm(kind, _takens_coefficient(scaled, u, A) * scaled.unit(q) ** 2)
    p = p / float(p @ q)
    if kind == "SN":
        return EquilibriumNormalForm(kind, fold_coefficient(scaled, u, q, p) * scaled.unit(q))
    return EquilibriumNormalForm(kind, cusp_coefficient(scaled, u, A, q, p) * scaled.unit(q) ** 2)


def check_no_zero(values: NDArray[Any], w: float) -> None:
    """Raise `InputError` where an eigenvalue beside the pair +-i w is 0: the normal form of an HB does not hold."""
    if float(np.abs(values).min()) < _ZERO_HOPF * w:
        hint = "it is a zero-Hopf point (ZH), and what is born there depends on two parameters"
        raise InputError("point", f"eigenvalues {values}", "a pair +-i w beside which no eigenvalue is 0", hint)


def lyapunov_coefficient(
    problem: EquilibriumProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    w: float,
    sizes: NDArray[np.float64],
) -> float:
    """Return the first Lyapunov coefficient at an equilibrium with the imaginary pair +-i w, q of unit length."""
    scaled = _Scaled(problem, np.where(sizes > 0.0, sizes, 1.0))
    terms = hopf_terms(scaled, u, J[:, : problem.n] * scaled.sizes / scaled.sizes[:, None], w)
    return terms.l1 * scaled.unit(terms.q) ** 2


def lyapunov_error(
    problem: EquilibriumProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    w: float,
    sizes: NDArray[np.float64],
    l1: float,
) -> float:
    """Return what rounding of the Jacobian makes of the first Lyapunov coefficient `l1`; infinite where it is unknown.

    Each row is the sum of a few terms, with an error of the rounding of its largest entry. Some matrices that differ
    by as much show what the coefficient takes from it.
    """
    draw, own = np.random.default_rng(0), J[:, : problem.n]
    units = np.where(sizes > 0.0, sizes, 1.0)
    rounding = 4.0 * EPS * np.abs(own * units).max(axis=1, keepdims=True) / units
    with np.errstate(all="ignore"):
        found = []
        for _ in range(_SAMPLES):
            moved = J.copy()
            moved[:, : problem.n] += np.where(own != 0.0, draw.uniform(-1.0, 1.0, own.shape) * rounding, 0.0)
            try:
                found.append(lyapunov_coefficient(problem, u, moved, w, sizes))
            except np.linalg.LinAlgError:
                return math.inf
        error = 2.0 * float(np.abs(np.array(found) - l1).max())
    return error if math.isfinite(error) else math.inf


def apart(A: NDArray[np.float64], w: float) -> bool:
    """Return whether a matrix has entries so much larger than a frequency that its pair needs row by row arithmetic."""
    return w < SEPARATED * float(np.abs(A).max())


def _row_units(A: NDArray[Any], w: float) -> NDArray[np.float64]:
    """Return the factors of rows that are solved with: 1, or powers of two that make them alike."""
    if not apart(A, w):
        return np.ones(len(A))
    return np.asarray(2.0 ** -np.round(np.log2(np.maximum(np.abs(A).max(axis=1), w))))


def _critical_pair(A: NDArray[np.float64], w: float) -> tuple[float, NDArray[Any], NDArray[Any]]:
    """Return the frequency next to `w`, and the vectors q, of unit length, and p, with <p, q> = 1, of its eigenvalue.

    Beside far faster rates vectors are null vectors of rows in units of their own: no row then has rounding of others.
    """
    right, vectors = np.linalg.eig(A.astype(np.complex128))
    q: NDArray[Any] = vectors[:, np.argmin(np.abs(right - 1j * w))]
    q = q / np.linalg.norm(q)
    if not apart(A, w):
        left, adjoint = np.linalg.eig(A.T.astype(np.complex128))
        p: NDArray[Any] = adjoint[:, np.argmin(np.abs(left + 1j * w))]
        return w, q, p / (p @ q.conj())
    value, rows, first = 1j * w, _row_units(A, w), q
    for _ in range(_ROUNDS):
        shifted = A - value * np.eye(len(A))
        columns, _, null = np.linalg.svd(shifted * rows[:, None])
        q, p = null[-1].conj(), columns[:, -1] * rows
        p = p / np.conj(p.conj() @ q)
        value += complex(p.conj() @ (shifted @ q))
    turn = first.conj() @ q
    turn = turn / abs(turn) if turn else 1.0
    return value.imag, q / turn, p / turn


def _solved(A: NDArray[Any], right: NDArray[Any], rows: NDArray[np.float64]) -> NDArray[Any]:
    """Return the solution of equations with rows in units of their own."""
    return np.asarray(np.linalg.solve(A * rows[:, None], right * rows))


class _Field(Protocol):
    """Derivatives of a field, as of an `EquilibriumProblem`."""

    n: int

    def second(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def third(self, u: NDArray[np.float64], *directions: NDArray[np.float64]) -> NDArray[np.float64]: ...


class _Scaled:
    """The field in units of the states' sizes, in which singular vectors are accurate whatever the units are."""

    def __init__(self, problem: EquilibriumProblem, sizes: NDArray[np.float64]) -> None:
        self.problem, self.sizes, self.n = problem, sizes, problem.n

    def unit(self, q: NDArray[Any]) -> float:
        """Return the factor that gives a vector unit length in the states."""
        return float(1.0 / np.linalg.norm(self.sizes * q))

    def second(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `EquilibriumProblem.second`; the columns of parameters are left out."""
        n = self.n
        found = self.problem.second(u, np.append(v[:n] * self.sizes, v[n:]))[:, :n]
        return np.asarray(found * self.sizes / self.sizes[:, None])

    def third(self, u: NDArray[np.float64], *directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `EquilibriumProblem.third`."""
        return np.asarray(self.problem.third(u, *(v * self.sizes for v in directions)) / self.sizes)


def null_pair(A: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the right and the left null vector of a singular matrix, of unit length."""
    left, _, right = np.linalg.svd(A)
    return right[-1], left[:, -1]


def _seen(value: float, *terms: float) -> float:
    """Return a sum of terms; 0 where it is their rounding."""
    return value if abs(value) > _NOISE * sum(abs(term) for term in terms) else 0.0


def _bilinear(problem: _Field, u: NDArray[np.float64], v: NDArray[Any], w: NDArray[Any]) -> NDArray[Any]:
    """Return the second derivative B(v, w) of the field in the state."""
    n, still = problem.n, np.zeros(u.size - problem.n)
    parts = [problem.second(u, np.append(part, still))[:, :n] for part in (v.real, v.imag)]
    return np.asarray((parts[0] + 1j * parts[1]) @ w)


def fold_coefficient(problem: _Field, u: NDArray[np.float64], q: NDArray[np.float64], p: NDArray[np.float64]) -> float:
    """Return a = <p, B(q, q)> / 2; it vanishes at a cusp."""
    n = problem.n
    bend = problem.second(u, np.append(q, np.zeros(u.size - n)))[:, :n]
    return _seen(0.5 * float(p @ bend @ q), *(0.5 * p * (np.abs(bend) @ np.abs(q))))


def cusp_coefficient(
    problem: _Field,
    u: NDArray[np.float64],
    A: NDArray[np.float64],
    q: NDArray[np.float64],
    p: NDArray[np.float64],
) -> float:
    """Return c = <p, C(q, q, q) + 3 B(q, h)> / 6, where A h = <p, B(q, q)> q - B(q, q) and <p, h> = 0."""
    n = problem.n
    bend = problem.second(u, np.append(q, np.zeros(u.size - n)))[:, :n]
    square = bend @ q
    bordered = np.block([[A, p[:, None]], [p[None, :], np.zeros((1, 1))]])
    h = np.linalg.solve(bordered, np.append(float(p @ square) * q - square, 0.0))[:n]
    terms = float(p @ problem.third(u, q, q, q)) / 6.0, 0.5 * float(p @ bend @ h)
    return _seen(sum(terms), *terms)


@dataclass(frozen=True, eq=False)
class HopfTerms:
    """Expansion of the centre manifold at a Hopf point: x + z q + conj(z q) + abs(z)^2 mean + Re(z^2 double)."""

    l1: float  # first Lyapunov coefficient
    # q, p: shape (n,): eigenvector of unit length, and adjoint one with <p, q> = 1
    q: NDArray[Any]
    p: NDArray[Any]
    mean: NDArray[np.float64]  # shape (n,): shift of the mean
    double: NDArray[Any]  # shape (n,): second harmonic
    # the amplitude abs(z) at which a term of second or third order of z' is as large as the linear one; inf without
    # such terms. It does not depend on the units of the states but for those of q.
    reach: float


def hopf_terms(problem: _Field, u: NDArray[np.float64], A: NDArray[np.float64], w: float) -> HopfTerms:
    """Return the terms to third order at an equilibrium with the imaginary pair +-i w."""
    n = problem.n
    rows = _row_units(A, w)
    w, q, p = _critical_pair(A, w)
    a, b = q.real.copy(), q.imag.copy()
    cubes = {key: problem.third(u, *ways) for key, ways in
             {"aaa": (a, a, a), "abb": (a, b, b), "aab": (a, a, b), "bbb": (b, b, b)}.items()}  # fmt: skip
    cubic = cubes["aaa"] + cubes["abb"] + 1j * (cubes["aab"] + cubes["bbb"])
    across, along = _bilinear(problem, u, q, q.conj()), _bilinear(problem, u, q, q)
    mean = -_solved(A, across.real, rows)
    double = _solved(2j * w * np.eye(n) - A, along, rows)
    parts = [
        p.conj() @ cubic,
        2.0 * (p.conj() @ _bilinear(problem, u, q, mean)),
        p.conj() @ _bilinear(problem, u, q.conj(), double),
    ]
    l1 = _seen(float(sum(parts).real) / (2.0 * w), *(abs(part) / (2.0 * w) for part in parts))
    second = max(abs(complex(p.conj() @ term)) for term in (across, along)) / w
    third = sum(abs(complex(part)) for part in parts) / (2.0 * w)
    faint = _NOISE * float(np.linalg.norm(p))
    sizes = [1.0 / second if second > faint else math.inf, third**-0.5 if third > faint else math.inf]
    return HopfTerms(l1, q, p, mean, double, min(sizes))


def _takens_coefficient(problem: _Field, u: NDArray[np.float64], A: NDArray[np.float64]) -> float:
    """Return a b of x' = y, y' = a x^2 + b x y.

    The null vectors q0 and p1 have generalised ones q1 and p0, with A q1 = q0 and p0 A = p1.
    """
    n = problem.n
    q0, p1 = null_pair(A)
    right = np.block([[A, p1[:, None]], [q0[None, :], np.zeros((1, 1))]])
    q1 = np.linalg.solve(right, np.append(q0, 0.0))[:n]
    p1 = p1 / float(p1 @ q1)
    left = np.block([[A.T, q0[:, None]], [q1[None, :], np.zeros((1, 1))]])
    p0 = np.linalg.solve(left, np.append(p1, 0.0))[:n]
    bend = problem.second(u, np.append(q0, np.zeros(u.size - n)))[:, :n]
    a = 0.5 * float(p1 @ bend @ q0)
    b = float(p0 @ bend @ q0) + float(p1 @ bend @ q1)
    return _seen(a * b, float(np.linalg.norm(p1) * np.linalg.norm(bend)) ** 2)

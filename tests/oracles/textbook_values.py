"""Computes special points and equilibria of `textbook.TEXTBOOK` with NumPy and mpmath alone, into `textbook.json`.

A curve of equilibria is followed by short steps of fixed length. Signs that change between two points give first
guesses, and mpmath solves the defining equations to 30 digits: f = 0 and det A = 0 (SN); f = 0 and a Hurwitz
determinant (HB); f + m w = 0, w^T (A, f_p) = 0, |w| = 1 (BP). The first Lyapunov coefficient comes from the centre
manifold in real coordinates and (3.4.11) of Guckenheimer and Holmes, Nonlinear Oscillations, Springer 1983.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import sympy

from oracles.textbook import TEXTBOOK, Textbook

mpmath.mp.dps = 40
STEP = 1e-3  # arclength of a step, states and parameter in units of their ranges


class Field:
    """The field of a system as NumPy functions, and as mpmath ones with derivatives to third order."""

    def __init__(self, item: Textbook) -> None:
        names = [*item.states, *item.parameters]
        symbols = {name: sympy.Symbol(name, real=True) for name in names}
        self.x = [symbols[name] for name in item.states]
        self.p = symbols[item.parameter]
        fixed = {symbols[k]: sympy.Float(repr(v), 50) if v != int(v) else sympy.Integer(int(v))
                 for k, v in item.parameters.items() if k != item.parameter}  # fmt: skip
        # numbers of the definition are doubles, as a program reads them
        exact = {k: sympy.Rational(float(v)) for k, v in fixed.items()}
        self.f = [self.doubles(sympy.sympify(text, locals=symbols)).subs(exact) for text in item.field.values()]
        self.n = len(self.x)
        u = [*self.x, self.p]
        self.J = [[sympy.diff(f, v) for v in u] for f in self.f]
        self.np_f = sympy.lambdify(u, self.f, "numpy")
        self.np_J = sympy.lambdify(u, self.J, "numpy")
        self.mp_f = sympy.lambdify(u, self.f, "mpmath")
        self.mp_J = sympy.lambdify(u, self.J, "mpmath")

    @staticmethod
    def doubles(f: sympy.Expr) -> sympy.Expr:
        return f.xreplace({a: sympy.Rational(float(a)) for a in f.atoms(sympy.Float)})

    def F(self, u: np.ndarray) -> np.ndarray:
        return np.array(self.np_f(*u), dtype=float)

    def DF(self, u: np.ndarray) -> np.ndarray:
        return np.array(self.np_J(*u), dtype=float)

    def tensors(self, u: list[Any]) -> tuple[Any, Any]:
        """Return second and third derivatives in the states at `u`, as object arrays of mpmath numbers."""
        n = self.n
        B = np.empty((n, n, n), dtype=object)
        C = np.empty((n, n, n, n), dtype=object)
        at = [*self.x, self.p]
        for i in range(n):
            for j in range(n):
                for k in range(n):
                    d2 = sympy.diff(self.f[i], self.x[j], self.x[k])
                    B[i, j, k] = mpmath.mpf(sympy.lambdify(at, d2, "mpmath")(*u))
                    for m in range(n):
                        C[i, j, k, m] = mpmath.mpf(sympy.lambdify(at, sympy.diff(d2, self.x[m]), "mpmath")(*u))
        return B, C


def newton(field: Field, u: np.ndarray, row: np.ndarray, scale: np.ndarray) -> np.ndarray | None:
    target = row @ (u / scale)
    for _ in range(12):
        F, J = field.F(u), field.DF(u) * scale
        size = np.abs(J).max(axis=1) + 1e-300
        step = np.linalg.solve(np.vstack([J / size[:, None], row]), -np.append(F / size, row @ (u / scale) - target))
        u = u + step * scale
        if np.abs(step).max() < 1e-12:
            return u
    return u if np.abs(step).max() < 1e-8 else None


def tangent(field: Field, u: np.ndarray, scale: np.ndarray, old: np.ndarray) -> np.ndarray:
    J = field.DF(u) * scale
    t = np.linalg.svd(J / (np.abs(J).max(axis=1, keepdims=True) + 1e-300))[2][-1]
    return t if t @ old >= 0 else -t


def curve(field: Field, item: Textbook, u: np.ndarray, scale: np.ndarray, sign: float, step: float) -> list[Any]:
    """Return points and tangents from `u` on, to the first bound or back to the start."""
    t = tangent(field, u, scale, sign * np.eye(u.size)[-1])
    out, low, high = [(u, t)], *item.bounds
    h = step
    while len(out) < 60_000:
        v = newton(field, u + h * scale * t, t, scale)
        ok = v is not None and np.linalg.norm((v - u) / scale - h * t) < 0.02 * h + 1e-9
        if ok:
            s = tangent(field, v, scale, t)
            ok = s @ t > 0.999
        if not ok:
            h *= 0.5
            if h < 1e-9:
                raise RuntimeError(f"{item.name}: no step from {u}")
            continue
        u, t, h = v, s, min(2 * h, step)
        out.append((u, t))
        if not low <= u[-1] <= high:
            return out
        if len(out) > 20 and np.linalg.norm((u - out[0][0]) / scale) < 0.7 * step and t @ out[0][1] > 0.9:
            return out
        if np.abs(u[:-1] / scale[:-1]).max() > 50:
            return out
    return out


def pairs(A: np.ndarray) -> tuple[float, bool]:
    """Return the product of the sums of two eigenvalues, and whether the least sum is that of a complex pair."""
    e = np.linalg.eigvals(A).astype(complex)
    sums = [(abs(e[i] + e[j]), e[i] + e[j], abs(e[i].imag) > 0) for i in range(e.size) for j in range(i)]
    size = np.abs(e).max()
    return float(np.prod([s / size for _, s, _ in sums]).real), min(sums, key=lambda s: s[0])[2]


def signs(field: Field, u: np.ndarray, t: np.ndarray, scale: np.ndarray) -> tuple[float, float, float, bool]:
    J = field.DF(u) * scale
    J = J / (np.abs(J).max(axis=1, keepdims=True) + 1e-300)
    hopf, pair = pairs(field.DF(u)[:, :-1]) if field.n > 1 else (1.0, False)
    return t[-1], float(np.linalg.det(np.vstack([J, t]))), hopf, pair


def coefficients(A: Any) -> list[Any]:
    """Return the coefficients of the characteristic polynomial, by Faddeev and LeVerrier."""
    n = A.rows
    M, c = mpmath.zeros(n), [mpmath.mpf(1)]
    for k in range(1, n + 1):
        M = A * M + c[-1] * mpmath.eye(n)
        c.append(-sum((A * M)[i, i] for i in range(n)) / k)
    return c


def hurwitz(A: Any) -> Any:
    """Return the Hurwitz determinant that vanishes with an imaginary pair."""
    n, c = A.rows, coefficients(A)
    if n == 2:
        return c[1]
    return c[1] * c[2] - c[3] if n == 3 else c[1] * c[2] * c[3] - c[3] ** 2 - c[1] ** 2 * c[4]


def refined(field: Field, kind: str, u: np.ndarray, scale: np.ndarray) -> list[Any]:
    """Return the special point near `u` to 30 digits."""
    n = field.n
    J = field.DF(u) * scale
    unit = [mpmath.mpf(float(s)) for s in scale]
    rows = [mpmath.mpf(float(1 / (np.abs(r).max() + 1e-300))) for r in J]
    lam = mpmath.mpf(float(np.abs(np.linalg.eigvals(field.DF(u)[:, :n])).max())) if n > 1 else 1

    def parts(y: list[Any]) -> tuple[list[Any], Any]:
        v = [a * s for a, s in zip(y, unit, strict=True)]
        return [a * r for a, r in zip(field.mp_f(*v), rows, strict=True)], mpmath.matrix(field.mp_J(*v))

    y0 = [mpmath.mpf(float(a)) / s for a, s in zip(u, unit, strict=True)]
    if kind == "BP":
        w0 = np.linalg.svd((J / (np.abs(J).max(axis=1, keepdims=True) + 1e-300))[:, :n])[0][:, -1]

        def equations(*z: Any) -> list[Any]:
            f, D = parts(list(z[: n + 1]))
            w, m = z[n + 1 : 2 * n + 1], z[-1]
            D = mpmath.matrix([[D[i, j] * rows[i] * unit[j] for j in range(n + 1)] for i in range(n)])
            left = [sum(w[i] * D[i, j] for i in range(n)) for j in range(n + 1)]
            return [*(f[i] + m * w[i] for i in range(n)), *left, sum(a * a for a in w) - 1]

        start = [*y0, *(mpmath.mpf(float(a)) for a in w0), mpmath.mpf(0)]
    else:

        def equations(*z: Any) -> list[Any]:
            f, D = parts(list(z))
            A = D[:, :n]
            if kind == "SN":
                A = mpmath.matrix([[A[i, j] * rows[i] * unit[j] for j in range(n)] for i in range(n)])
                return [*f, coefficients(A)[-1]]
            return [*f, hurwitz(A / lam)]

        start = y0
    root = mpmath.findroot(equations, start, tol=1e-50, maxsteps=40, method="mdnewton")
    return [root[i] * unit[i] for i in range(n + 1)]


def lyapunov(field: Field, u: list[Any]) -> tuple[float, float, float]:
    """Return the first Lyapunov coefficient (|q| = 1, over the frequency), the frequency, and d Re(lambda)/dp."""
    n, D = field.n, mpmath.matrix(field.mp_J(*u))
    A = D[:, :n]
    values, right = mpmath.eig(A)
    k = min((i for i in range(n) if values[i].imag > 0), key=lambda i: abs(values[i].real))
    w = values[k].imag
    q = right[:, k] / mpmath.norm(right[:, k])
    columns = [[q[i].real for i in range(n)], [-q[i].imag for i in range(n)]]
    others = [v for i, v in enumerate(values) if i != k and abs(v - values[k].conjugate()) > 1e-20 * abs(w)]
    if others:
        # the invariant complement is the range of A^2 + w^2
        M = A * A + w * w * mpmath.eye(n)
        U = mpmath.svd_r(M)[0]
        columns += [[U[i, j] for i in range(n)] for j in range(n - 2)]
    P = mpmath.matrix(columns).T
    inverse = mpmath.inverse(P)
    L = inverse * A * P
    assert abs(L[0, 1] + w) < 1e-15 * w, L
    assert abs(L[1, 0] - w) < 1e-15 * w, L
    B, C = field.tensors(u)
    Pn, In = np.array(P.tolist(), dtype=object), np.array(inverse.tolist(), dtype=object)
    B = np.einsum("ia,ajk->ijk", In, np.einsum("ijk,ja,kb->iab", B, Pn, Pn, optimize=False), optimize=False)
    C = np.einsum("ia,ajkl->ijkl", In, np.einsum("ijkl,ja,kb,lc->iabc", C, Pn, Pn, Pn))
    m = n - 2
    if m:
        # s = h(u, v): S h + F_s = h_u (-w v) + h_v (w u), in the coefficients of u^2, u v, v^2
        S = L[2:, 2:]
        K = mpmath.zeros(3 * m)
        r = mpmath.zeros(3 * m, 1)
        for i in range(m):
            for j in range(m):
                for b in range(3):
                    K[b * m + i, b * m + j] = S[i, j]
            # h = a u^2 + b u v + c v^2: h_u(-w v) + h_v(w u) = w b u^2 + 2 w (c - a) u v - w b v^2
            K[i, m + i] -= w
            K[m + i, 2 * m + i] -= 2 * w
            K[m + i, i] += 2 * w
            K[2 * m + i, m + i] += w
            r[i], r[m + i], r[2 * m + i] = -B[2 + i, 0, 0] / 2, -B[2 + i, 0, 1], -B[2 + i, 1, 1] / 2
        h = mpmath.lu_solve(K, r)
        H = np.empty((m, 2, 2), dtype=object)
        for i in range(m):
            H[i, 0, 0], H[i, 0, 1], H[i, 1, 0], H[i, 1, 1] = 2 * h[i], h[m + i], h[m + i], 2 * h[2 * m + i]
        for i in range(2):
            for a in range(2):
                for b in range(2):
                    for c in range(2):
                        C[i, a, b, c] += sum(
                            B[i, a, 2 + s] * H[s, b, c] + B[i, b, 2 + s] * H[s, a, c] + B[i, c, 2 + s] * H[s, a, b]
                            for s in range(m)
                        )
    (f2, g2), (f3, g3) = B[:2, :2, :2], C[:2, :2, :2, :2]
    a = (f3[0, 0, 0] + f3[0, 1, 1] + g3[0, 0, 1] + g3[1, 1, 1]) / 16 + (
        f2[0, 1] * (f2[0, 0] + f2[1, 1]) - g2[0, 1] * (g2[0, 0] + g2[1, 1]) - f2[0, 0] * g2[0, 0] + f2[1, 1] * g2[1, 1]
    ) / (16 * w)
    # crossing speed by a difference of eigenvalues along the branch, at 40 digits
    eps = mpmath.mpf(10) ** -15 * max(abs(u[n]), mpmath.mpf("1e-3"))
    dx = mpmath.lu_solve(A, -D[:, n])
    shifted = []
    for s in (-1, 1):
        y = [u[i] + s * eps * dx[i] for i in range(n)] + [u[n] + s * eps]
        e = mpmath.eig(mpmath.matrix(field.mp_J(*y))[:, :n], left=False, right=False)
        shifted.append(min(e, key=lambda v: abs(v - values[k])).real)
    l1 = 4 * a / w
    return float(l1) if abs(l1) > 1e-20 else 0.0, float(w), float((shifted[1] - shifted[0]) / (2 * eps))


def equilibria(field: Field, item: Textbook, p: float, box: np.ndarray, seed: int) -> list[list[float]]:
    """Return all equilibria that Newton's method finds from 300 starts in a box, to 30 digits."""
    rng, found = np.random.default_rng(seed), []
    n = field.n
    size = box[1] - box[0]
    for _ in range(300):
        x = box[0] + size * rng.random(n)
        with np.errstate(all="ignore"):  # starts may lie where a root or a logarithm is not real
            for _ in range(40):
                F, A = field.F(np.append(x, p)), field.DF(np.append(x, p))[:, :n]
                if not (np.all(np.isfinite(F)) and np.all(np.isfinite(A))):
                    break
                try:
                    step = np.linalg.solve(A, -F)
                except np.linalg.LinAlgError:
                    break
                x = x + step
                if np.abs(step / size).max() < 1e-11:
                    break
            else:
                continue
        if not np.all(np.isfinite([*x, *F])) or np.abs(step / size).max() > 1e-10:
            continue
        if np.any(x < box[0] - 0.5 * size) or np.any(x > box[1] + 0.5 * size):
            continue
        if all(np.abs((x - y) / size).max() > 1e-7 for y in found):
            found.append(x)
    exact = []
    for x in found:
        root = mpmath.findroot(lambda *z: field.mp_f(*z, mpmath.mpf(p)), [mpmath.mpf(float(v)) for v in x],
                               tol=1e-45, maxsteps=30, method="mdnewton")  # fmt: skip
        if any(mpmath.im(root[i]) != 0 for i in range(n)):
            continue
        exact.append([clean(root[i], size[i]) for i in range(n)])
    return sorted(exact)


def clean(value: Any, size: float) -> float:
    return 0.0 if abs(value) < 1e-25 * max(size, 1e-6) else float(mpmath.nstr(value, 17))


def values(item: Textbook) -> dict[str, Any]:
    """Return special points in the order from the lower end on, and equilibria at a few values of the parameter."""
    field = Field(item)
    width = item.bounds[1] - item.bounds[0]
    u = np.append(np.array(item.start, dtype=float), item.value)
    for _ in range(60):
        u[:-1] += np.linalg.solve(field.DF(u)[:, :-1], -field.F(u))
    scale = np.append(np.maximum(np.abs(u[:-1]), 1e-2), width)
    both: list[Any] = []
    for step in (10 * STEP, STEP):
        up, down = curve(field, item, u, scale, 1.0, step), curve(field, item, u, scale, -1.0, step)
        closed = (
            len(up) > 1
            and item.bounds[0] <= up[-1][0][-1] <= item.bounds[1]
            and np.abs(up[-1][0][:-1] / scale[:-1]).max() < 50
        )
        both = up if closed else [*((v, -t) for v, t in down[:0:-1]), *up]
        span = np.ptp(np.array([v[:-1] for v, _ in both]), axis=0)
        scale = np.append(np.where(span > 1e-9, span, scale[:-1]), width)
    specials = []
    table = [signs(field, v, t, scale) for v, t in both]
    for (v, _), (w, _), a, b in zip(both[:-1], both[1:], table[:-1], table[1:], strict=True):
        kinds = [kind for kind, i in (("SN", 0), ("BP", 1)) if a[i] * b[i] < 0]
        if np.abs([a[0], b[0]]).max() < 1e-9:
            kinds = [kind for kind in kinds if kind != "SN"]
        if "BP" in kinds:
            kinds = ["BP"]
        kinds += ["HB"] if a[2] * b[2] < 0 and (a[3] or b[3]) else []
        for kind in kinds:
            i = ("SN", "BP", "HB").index(kind)
            share = a[i] / (a[i] - b[i])
            root = refined(field, kind, (1 - share) * v + share * w, scale)
            entry = {"type": kind, "p": clean(root[-1], width),
                     "x": [clean(x, s) for x, s in zip(root[:-1], scale[:-1], strict=True)]}  # fmt: skip
            if kind == "HB":
                entry["l1"], entry["frequency"], entry["speed"] = lyapunov(field, root)
                others = np.linalg.eigvals(np.array(field.mp_J(*root), dtype=float)[:, :-1])
                entry["attracting"] = bool(np.sum(others.real > 1e-7 * np.abs(others).max()) == 0)
            low, high = item.bounds
            if low <= entry["p"] <= high:
                specials.append(entry)
    states = np.array([v[:-1] for v, _ in both])
    span = np.maximum(np.ptp(states, axis=0), 0.1 * np.abs(states).max(axis=0))
    span = np.where(span > 0, span, 1.0)
    box = np.array([states.min(axis=0) - 0.2 * span, states.max(axis=0) + 0.2 * span])
    found = {}
    for k, share in enumerate((0.137, 0.391, 0.617, 0.883)):
        p = item.bounds[0] + share * width
        found[repr(p)] = equilibria(field, item, p, box, k)
    return {"special": specials, "ends": [both[0][0][-1], both[-1][0][-1]], "points": len(both), "equilibria": found}


def main() -> None:
    path = Path(__file__).with_name("textbook.json")
    known = json.loads(path.read_text()) if path.exists() else {}
    for name in sys.argv[1:] or TEXTBOOK:
        try:
            known[name] = values(TEXTBOOK[name])
        except Exception as error:  # one system must not stop the others
            print(name, "FAILED", type(error).__name__, str(error)[:200], flush=True)
            continue
        line = " ".join(f"{s['type']}({s['p']:.6g}" + (f",l1={s['l1']:.3g})" if "l1" in s else ")")
                        for s in known[name]["special"])  # fmt: skip
        counts = [len(v) for v in known[name]["equilibria"].values()]
        print(f"{name}: {line} | {known[name]['points']} {counts}", flush=True)
    path.write_text(json.dumps({name: known[name] for name in TEXTBOOK if name in known}, indent=1) + "\n")


if __name__ == "__main__":
    main()

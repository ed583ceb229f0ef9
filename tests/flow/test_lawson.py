"""Lawson's steps in the frame of a field's linear part, against closed forms and SciPy."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import HybridSystem, Mode
from saltus.afm import table1, tapping_mode
from saltus.flow import lawson
from saltus.flow.kernels import lawson_segment
from saltus.flow.linear_parts import linear_part

POINTER = ctypes.c_void_p
FLOW = ctypes.CFUNCTYPE(
    ctypes.c_double, POINTER, POINTER, POINTER, POINTER, POINTER, ctypes.c_double, POINTER, ctypes.c_double,
    ctypes.c_double, POINTER, POINTER,
)  # fmt: skip
DENSE = ctypes.CFUNCTYPE(
    ctypes.c_double, POINTER, ctypes.c_int64, ctypes.c_int64, POINTER, ctypes.c_double, POINTER, POINTER,
    ctypes.c_int64, POINTER, POINTER,
)  # fmt: skip


def followed(
    system: HybridSystem, linear: np.ndarray, x0: np.ndarray, duration: float, steps: int, parameter: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State, sensitivities by state and one parameter, and errors of steps, in mode 0."""
    compiled, n = system.compiled, system.compiled.n
    table = np.zeros((len(system.modes), linear.size))
    table[0] = linear
    functions = np.append(compiled.addresses, table.ctypes.data)
    p = compiled.extended(np.array([system.parameters[name] for name in system.parameter_names]))
    sizes = np.array([0, n, 0, 0, 1, n + 1, steps])
    active = np.array([system.parameter_names.index(parameter)])
    mesh, y, errors = np.linspace(0.0, 1.0, steps + 1), np.empty(n * (n + 2)), np.empty(steps)
    given = [a.ctypes.data for a in (functions, p, sizes, active, x0)]
    FLOW(lawson_segment.flow.address)(
        *given, duration, mesh.ctypes.data, 1e-12, 1e-12, y.ctypes.data, errors.ctypes.data
    )
    return y[:n], y[n:].reshape(n, n + 1), errors


def by_scipy(system: HybridSystem, x0: np.ndarray, duration: float, parameter: str) -> tuple[np.ndarray, np.ndarray]:
    """State and sensitivities by SciPy's DOP853; sensitivities by the parameter and the first state are differences."""
    compiled, n = system.compiled, system.compiled.n
    values = np.array([system.parameters[name] for name in system.parameter_names])
    at = system.parameter_names.index(parameter)

    def end(x: np.ndarray, p: np.ndarray) -> np.ndarray:
        extended = compiled.extended(p)
        out = np.empty(n)

        def field(_: float, y: np.ndarray) -> np.ndarray:
            compiled.call("field", 0, 0, np.ascontiguousarray(y), extended, out)
            return out.copy()

        return np.asarray(solve_ivp(field, (0.0, duration), x, "DOP853", rtol=3e-14, atol=1e-16).y[:, -1])

    h = 1e-4
    slopes = []
    for dx, dp in ((h * np.eye(n)[0], 0.0), (np.zeros(n), h)):
        change = np.eye(len(values))[at] * dp
        one, two = (end(x0 + k * dx, values + k * change) - end(x0 - k * dx, values - k * change) for k in (1, 2))
        slopes.append((8.0 * one - two) / (12.0 * h))
    return end(x0, values), np.stack(slopes, axis=1)


def oscillators() -> HybridSystem:
    """Three driven oscillators, one overdamped, that do not see each other."""
    field = {}
    for i, (k, d) in enumerate(((1.0, 0.1), (900.0, 0.3), (2.0, 5.0)), start=1):
        field |= {f"x{i}": f"v{i}", f"v{i}": f"-{k}*x{i} - {d}*v{i} + a*cos(s)"}
    return HybridSystem(tuple(field), {"Omega": 1.3, "a": 0.7}, {"flight": Mode(field)}, phase=("s", "Omega"))


def exponential(A: np.ndarray, time: float) -> np.ndarray:
    """Matrix exponential of blocks of two, by Sylvester's formula."""
    found = np.zeros_like(A)
    for i in range(0, len(A), 2):
        block = A[i : i + 2, i : i + 2]
        mean = 0.5 * np.trace(block)
        root = np.sqrt(complex(mean * mean - np.linalg.det(block)))
        grown = np.cosh(root * time) * np.eye(2) + np.sinh(root * time) / root * (block - mean * np.eye(2))
        found[i : i + 2, i : i + 2] = (np.exp(mean * time) * grown).real
    return found


def test_tables_are_exact_for_polynomials() -> None:
    for k in range(lawson.STAGES):
        assert lawson.WITHIN @ lawson.NODES**k == pytest.approx(lawson.NODES ** (k + 1) / (k + 1), abs=1e-15)
    assert pytest.approx(1.0 / 16.0, abs=1e-15) == lawson.WEIGHTS @ lawson.NODES**15
    increments = np.append(lawson.NODES**7 - 2.0 * lawson.NODES**4, -1.0)
    coefficients, s, value, power = lawson.DENSE @ increments, 0.37, 0.0, 1.0
    for k, c in enumerate(coefficients):
        power *= s if k % 2 == 0 else 1.0 - s
        value += c * power
    assert value == pytest.approx(s**7 - 2.0 * s**4, abs=1e-12)


def test_linear_oscillators_are_those_of_the_variation_of_constants() -> None:
    """The slow and the fast oscillator, and one that does not turn, in steps of up to 4 radians of the fast one."""
    system, duration, w = oscillators(), 4.0, 1.3
    A = np.zeros((6, 6))
    numbers = np.zeros((7, 5))
    numbers[:, 0] = np.arange(7)
    for i, (k, d) in enumerate(((1.0, 0.1), (900.0, 0.3), (2.0, 5.0))):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, 1.0], [-k, -d]]
        numbers[2 * i, :3], numbers[2 * i + 1, :3] = (2 * i + 1, 0.0, 1.0), (2 * i, -d, -k)
    x0 = np.array([0.3, -0.2, 0.01, 0.4, 0.5, 0.1, 0.8])
    push = np.array([0.0, 1.0] * 3)

    def response(omega: float, phase: float) -> np.ndarray:
        force = np.linalg.solve(1j * omega * np.eye(6) - A, 0.7 * push)
        return np.asarray((force * np.exp(1j * phase)).real)

    def end(omega: float, start: np.ndarray) -> np.ndarray:
        away = exponential(A, duration) @ (start[:6] - response(omega, start[6]))
        return np.append(away + response(omega, start[6] + omega * duration), start[6] + omega * duration)

    x, X, errors = followed(system, np.append([6.0, 1.0, 2.0], numbers.ravel()), x0, duration, 50, "Omega")
    assert np.max(errors) < 5.0
    assert x == pytest.approx(end(w, x0), abs=1e-12)
    assert X[:6, :6] == pytest.approx(exponential(A, duration), abs=1e-12)
    for column, change in ((6, lambda h: (w, x0 + h * np.eye(7)[6])), (7, lambda h: (w + h, x0))):
        one, two = (end(*change(h)) - end(*change(-h)) for h in (1e-4, 2e-4))
        assert X[:, column] == pytest.approx((8.0 * one - two) / 1.2e-3, abs=1e-10)


def flight() -> tuple[HybridSystem, np.ndarray]:
    """The paper's model with three modes, and a state a hundredth of the gap from contact, with ringing modes."""
    return tapping_mode(table1(), modes=3), np.array([0.86, -1e-3, 2e-3, 0.02, 0.05, -0.02, 1.8])


@pytest.mark.parametrize("parameter", ["Omega", "D_att_3"])
def test_a_cantilever_next_to_the_sample_moves_as_by_scipy(parameter: str) -> None:
    system, x0 = flight()
    p = system.compiled.extended(np.array([system.parameters[name] for name in system.parameter_names]))
    along = x0 + np.outer(0.3 * np.arange(9), np.eye(7)[0] * -0.1 + np.eye(7)[6])
    part = linear_part(system.compiled, 0, along, p, 6)
    assert part is not None
    assert part.rate == pytest.approx(math.sqrt(307.914), rel=1e-4)
    assert part.numbers[3:].reshape(-1, 5)[5, :3] == pytest.approx([2.0, -0.025, -307.914122], rel=1e-7)
    state, slopes = by_scipy(system, x0, 1.0, parameter)
    x, X, errors = followed(system, part.numbers, x0, 1.0, 40, parameter)
    assert np.max(errors) < 5.0
    assert x == pytest.approx(state, rel=1e-10, abs=1e-13)
    assert X[:, [0, 7]] == pytest.approx(slopes, rel=1e-6, abs=1e-8)


def test_errors_of_steps_say_when_they_are_too_long() -> None:
    system, x0 = flight()
    p = system.compiled.extended(np.array([system.parameters[name] for name in system.parameter_names]))
    along = x0 + np.outer(0.3 * np.arange(9), np.eye(7)[0] * -0.1 + np.eye(7)[6])
    part = linear_part(system.compiled, 0, along, p, 6)
    assert part is not None
    exact, _, _ = followed(system, part.numbers, x0, 2.0, 200, "Omega")
    for steps in (8, 12, 16, 24, 32, 48):
        x, _, errors = followed(system, part.numbers, x0, 2.0, steps, "Omega")
        off = float(np.max(np.abs(x - exact) / (1e-12 * (1.0 + np.abs(exact)))))
        assert math.sqrt(off) < 3.0 + 3.0 * float(np.max(errors))


def test_dense_output_meets_the_motion() -> None:
    system, x0 = flight()
    compiled, n, steps = system.compiled, 7, 120
    p = compiled.extended(np.array([system.parameters[name] for name in system.parameter_names]))
    along = x0 + np.outer(0.3 * np.arange(9), np.eye(7)[0] * -0.1 + np.eye(7)[6])
    part = linear_part(compiled, 0, along, p, 6)
    assert part is not None
    table = np.stack([part.numbers, np.zeros_like(part.numbers)])
    functions, mesh = np.append(compiled.addresses, table.ctypes.data), np.linspace(0.0, 1.0, steps + 1)
    nodes, bends = np.empty((steps + 1, n)), np.empty((steps, 7, n))
    DENSE(lawson_segment.dense.address)(
        functions.ctypes.data, 0, n, p.ctypes.data, 2.0, x0.ctypes.data, mesh.ctypes.data, steps, nodes.ctypes.data,
        bends.ctypes.data,
    )  # fmt: skip
    step, share = 61, 0.3
    s = (step + share) / steps
    x, power = nodes[step].copy(), 1.0
    for k in range(7):
        power *= share if k % 2 == 0 else 1.0 - share
        x += power * bends[step, k]
    exact, _, _ = followed(system, part.numbers, x0, 2.0 * s * s * (3.0 - 2.0 * s), 100, "Omega")
    assert x == pytest.approx(exact, rel=1e-9, abs=1e-11)


def test_a_rest_of_two_functions_has_no_such_steps() -> None:
    """The kernel sees it, too, and takes Runge-Kutta steps."""
    field = {"x": "v", "v": "-x - x**3 + k*y", "y": "w", "w": "-400*y - y**3 + k*x"}
    system = HybridSystem(tuple(field), {"k": 0.1}, {"all": Mode(field)})
    p, x0 = system.compiled.extended(np.array([0.1])), np.array([0.5, 0.2, 0.3, -1.0])
    along = np.array([[0.2 * k, 0.1, 0.3 - 0.05 * k, 0.0] for k in range(6)])
    assert linear_part(system.compiled, 0, along, p, 4) is None
    numbers = np.zeros((4, 5))
    numbers[:, :3] = [[1, 0.0, 1.0], [0, 0.0, -1.0], [3, 0.0, 1.0], [2, 0.0, -400.0]]
    numbers[[1, 3], 3] = numbers[[0, 2], 4] = 1.0
    x, X, errors = followed(system, np.append([4.0, 1.0, 2.0], numbers.ravel()), x0, 1.0, 150, "k")
    state, slopes = by_scipy(system, x0, 1.0, "k")
    assert np.max(errors) < 100.0
    assert x == pytest.approx(state, abs=1e-9)
    assert X[:, [0, 4]] == pytest.approx(slopes, abs=1e-7)

"""Steps of a field's linear part, by exponential collocation and in its frame, against closed forms and SciPy."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, expm_frechet

from saltus import HybridSystem, Mode
from saltus.afm import table1, tapping_mode
from saltus.flow import lawson
from saltus.flow.exponential import NODES, STAGES, speed, tables
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
CHECK = ctypes.CFUNCTYPE(
    ctypes.c_double, POINTER, ctypes.c_int64, ctypes.c_int64, POINTER, ctypes.c_double, ctypes.c_double,
    ctypes.c_double, POINTER, POINTER, ctypes.c_double, ctypes.c_double,
)  # fmt: skip


def addresses(system: HybridSystem, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Addresses of a system's functions, of the linear part of mode 0 and of its tables; the last two arrays."""
    parts, made = np.zeros((len(system.modes), numbers.size)), tables(numbers[4:].reshape(-1, 5))
    parts[0] = numbers
    return np.append(system.compiled.addresses, [parts.ctypes.data, made.ctypes.data]), parts, made


def followed(
    system: HybridSystem, linear: np.ndarray, x0: np.ndarray, duration: float, steps: int, parameter: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State, sensitivities by state and one parameter, and errors of steps, in mode 0."""
    compiled, n = system.compiled, system.compiled.n
    functions, *_held = addresses(system, linear)
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
    """The slow and the fast oscillator, and one that does not turn, in steps of up to 6 radians of the fast one."""
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

    linear = np.append([6.0, 1.0, 2.0, speed(numbers)], numbers.ravel())
    x, X, errors = followed(system, linear, x0, duration, 30, "Omega")
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
    assert part.numbers[2] == 0.0  # q1, whose linear part is the smallest, stands for the gap
    assert part.numbers[4:].reshape(-1, 5)[5, :3] == pytest.approx([2.0, -0.025, -307.914122], rel=1e-7)
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
    functions, *_held = addresses(system, part.numbers)
    mesh = np.linspace(0.0, 1.0, steps + 1)
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
    x, X, errors = followed(system, np.append([4.0, 1.0, 2.0, speed(numbers)], numbers.ravel()), x0, 1.0, 150, "k")
    state, slopes = by_scipy(system, x0, 1.0, "k")
    assert np.max(errors) < 100.0
    assert x == pytest.approx(state, abs=1e-9)
    assert X[:, [0, 4]] == pytest.approx(slopes, abs=1e-7)


PAIRS = {
    "turns": [[0.0, 1.0], [-900.0, -0.3]],
    "is overdamped": [[0.0, 1.0], [-2.0, -5.0]],
    "has one eigenvalue": [[0.0, 1.0], [-4.0, -4.0]],
    "is free": [[0.0, 1.0], [0.0, 0.0]],
}


def named(row: np.ndarray, n: int) -> dict[str, np.ndarray]:
    """The tables of one length by the names of `Level`."""
    nodes = STAGES
    shapes = {
        "numbers": (3,), "gains": (n,), "own": (n, nodes), "other": (n, nodes), "end": (n,), "beyond": (n,),
        "looks": (n, nodes), "pushed": (n, nodes), "closing": (n, nodes), "crossing": (n, nodes),
        "coupled": (nodes, nodes), "within": (n, nodes, nodes), "beside": (n, nodes, nodes), "seen": (n, nodes, nodes),
    }  # fmt: skip
    found, at = {}, 0
    for name, shape in shapes.items():
        found[name] = row[at : at + math.prod(shape)].reshape(shape)
        at += math.prod(shape)
    assert at == row.size
    return found


@pytest.mark.parametrize("kind", PAIRS)
def test_answers_to_polynomial_forces_are_those_of_matrix_exponentials(kind: str) -> None:
    """Powers of time as forces are states of a larger linear system. A fast pair beside makes lengths short or long."""
    A = np.array(PAIRS[kind])
    for beside in (40.0, 4e3):
        part = np.array(
            [
                [1, A[0, 0], A[0, 1], 0.2, 1.0],
                [0, A[1, 1], A[1, 0], 1.0, 0.3],
                [3, 0.0, 1.0, 0, 0],
                [2, 0, -beside, 0, 0],
            ]
        )
        made = tables(part)
        assert np.all(np.diff(made[:, 0]) > 0.0)
        for row in made[::4]:
            level, h = named(row, 4), float(row[0])
            size = 5e-14 * h * math.sqrt(max(np.abs(A).max(), 1.0))
            assert level["own"][:2, 3] == pytest.approx(np.diag(expm(A * h * NODES[3])), abs=1e-14)
            for power in (0, 1, 4, 15):
                values = NODES**power
                for force in (0, 1):
                    larger = np.zeros((power + 3, power + 3))
                    larger[:2, :2] = A
                    larger[force, 2 + power] = 1.0
                    larger[np.arange(3, power + 3), np.arange(2, power + 2)] = np.arange(1, power + 1) / h
                    end, node = (expm(larger * h * c)[:2, 2] for c in (1.0, NODES[9]))
                    other = 1 - force
                    assert level["closing"][force] @ values == pytest.approx(end[force], abs=size)
                    assert level["crossing"][other] @ values == pytest.approx(end[other], abs=size)
                    assert values @ level["within"][force][:, 9] == pytest.approx(node[force], abs=size)
                    assert values @ level["beside"][other][:, 9] == pytest.approx(node[other], abs=size)
                    seen = node[0] + 0.3 * node[1]
                    assert values @ level["seen"][force][:, 9] == pytest.approx(seen, abs=size)
            both = 0.2 * level["closing"][0] + level["crossing"][0]
            assert level["pushed"][0] == pytest.approx(both, abs=1e-15)


@pytest.mark.parametrize("steps", [24, 40, 80])
def test_oscillators_that_a_spring_couples_move_as_by_matrix_exponentials(steps: int) -> None:
    field = {"x": "v", "v": "-x - 0.1*v - k*(x + y)", "y": "w", "w": "-900*y - 0.3*w - k*(x + y)"}
    system, duration = HybridSystem(tuple(field), {"k": 2.0}, {"all": Mode(field)}), 3.0
    numbers = np.zeros((4, 5))
    numbers[:, :3] = [[1, 0.0, 1.0], [0, -0.1, -1.0], [3, 0.0, 1.0], [2, -0.3, -900.0]]
    numbers[[1, 3], 3] = numbers[[0, 2], 4] = 1.0
    A = np.array([[0, 1, 0, 0], [-1, -0.1, 0, 0], [0, 0, 0, 1], [0, 0, -900, -0.3]], dtype=float)
    spring = np.outer([0.0, -1.0, 0.0, -1.0], [1.0, 0.0, 1.0, 0.0])
    x0 = np.array([0.5, 0.2, 0.01, -1.0])
    x, X, errors = followed(
        system, np.append([4.0, 1.0, 2.0, speed(numbers)], numbers.ravel()), x0, duration, steps, "k"
    )
    exact, slope = expm_frechet((A + 2.0 * spring) * duration, spring * duration)
    sizes = np.array([1.0, 1.0, 1.0 / 30.0, 1.0])
    assert np.max(errors) < 5.0
    assert np.abs((x - exact @ x0) / sizes).max() < 1e-12
    assert np.abs((X[:, :4] - exact) / np.outer(sizes, [1.0, 1.0, 30.0, 1.0])).max() < 1e-12
    assert np.abs((X[:, 4] - slope @ x0) / sizes).max() < 1e-11


def test_steps_fit_the_sensitivities_where_the_state_rests() -> None:
    field = {"x": "v", "v": "-x - k*(x + y)", "y": "w", "w": "-900*y - k*(x + y)"}
    system = HybridSystem(tuple(field), {"k": 20.0}, {"all": Mode(field)})
    numbers = np.zeros((4, 5))
    numbers[:, :3] = [[1, 0.0, 1.0], [0, 0.0, -1.0], [3, 0.0, 1.0], [2, 0.0, -900.0]]
    numbers[[1, 3], 3] = numbers[[0, 2], 4] = 1.0
    A = np.array([[0, 1, 0, 0], [-21, 0, -20, 0], [0, 0, 0, 1], [-20, 0, -920, 0]], dtype=float)
    linear = np.append([4.0, 1.0, 2.0, speed(numbers)], numbers.ravel())
    _, X, errors = followed(system, linear, np.zeros(4), 3.0, 3, "k")
    assert np.max(errors) > 1.0
    assert np.abs(X[:, :4] - expm(A * 3.0)).max() < 1e-10 * np.abs(X).max()


def test_a_second_function_is_seen_where_it_sets_in() -> None:
    """Steps are then those of Runge and Kutta, far more than the mesh has, as these follow what turns."""
    later = "k*exp(60*(cos(s) - 1))"
    field = {"x": "v", "v": "-x - 0.1*(x + y)", "y": "w", "w": f"-400*y - 0.1*(x + y) - {later}*y**3"}
    numbers = np.zeros((5, 5))
    numbers[:, 0] = [1, 0, 3, 2, 4]
    numbers[:4, 1:3] = [[0.0, 1.0], [0.0, -1.0], [0.0, 1.0], [0.0, -400.0]]
    numbers[[1, 3], 3] = numbers[[0, 2], 4] = 1.0
    linear, x0 = np.append([4.0, 1.0, 2.0, speed(numbers)], numbers.ravel()), np.array([0.5, 0.2, 0.3, -1.0, -3.0])
    for k in (0.0, 100.0):
        system = HybridSystem(tuple(field), {"k": k, "Omega": 3.0}, {"all": Mode(field)}, phase=("s", "Omega"))
        x, X, _ = followed(system, linear, x0, 1.0, 4, "Omega")
        state, slopes = by_scipy(system, x0, 1.0, "Omega")
        assert x == pytest.approx(state, abs=1e-8)
        assert X[:, [0, 5]] == pytest.approx(slopes, abs=1e-6)


def cantilever(modes: int) -> tuple[HybridSystem, np.ndarray, np.ndarray]:
    """The paper's model, a state a tenth of the gap from contact whose modes all ring, and its linear part."""
    system, n = tapping_mode(table1(), modes=modes), 2 * modes + 1
    x0 = np.concatenate([[0.8], 1e-3 * np.cos(np.arange(1.0, modes)), 0.1 * np.sin(np.arange(modes) + 1.0), [1.8]])
    p = system.compiled.extended(np.array([system.parameters[name] for name in system.parameter_names]))
    along = x0 + np.outer(0.3 * np.arange(9), np.eye(n)[0] * -0.1 + np.eye(n)[-1])
    part = linear_part(system.compiled, 0, along, p, 2 * modes)
    assert part is not None
    return system, x0, part.numbers


@pytest.mark.parametrize("modes", [3, 5, 10])
def test_many_modes_move_as_by_scipy(modes: int) -> None:
    system, x0, linear = cantilever(modes)
    state, slopes = by_scipy(system, x0, 1.0, "Omega")
    x, X, errors = followed(system, linear, x0, 1.0, 16, "Omega")
    assert np.max(errors) < 5.0
    assert x == pytest.approx(state, rel=1e-11, abs=1e-12)
    assert X[:, [0, -1]] == pytest.approx(slopes, rel=1e-7, abs=1e-9)


def test_a_step_that_does_not_fit_is_taken_in_halves() -> None:
    system, x0, linear = cantilever(5)
    fine, slopes, _ = followed(system, linear, x0, 2.0, 300, "Omega")
    x, X, errors = followed(system, linear, x0, 2.0, 5, "Omega")
    assert 1.0 < np.max(errors) <= 4.0  # the mesh is to be moved
    assert x == pytest.approx(fine, rel=1e-11, abs=1e-14)
    assert np.abs(X - slopes).max() < 1e-10 * np.abs(slopes).max()


def test_dense_output_is_checked_between_its_stages() -> None:
    """Pieces of 0.85 radians of the fastest mode pass, also where a state that turns is near 0; longer ones do not."""
    system, x0, linear = cantilever(5)
    compiled, n = system.compiled, 11
    functions, *_held = addresses(system, linear)
    p = compiled.extended(np.array([system.parameters[name] for name in system.parameter_names]))
    given = functions.ctypes.data, 0, n, p.ctypes.data, 1.0
    for steps, passes in ((100, True), (80, False)):
        mesh = np.linspace(0.0, 1.0, steps + 1)
        nodes, bends = np.empty((steps + 1, n)), np.empty((steps, 7, n))
        rest = x0.ctypes.data, mesh.ctypes.data, steps, nodes.ctypes.data, bends.ctypes.data
        DENSE(lawson_segment.dense.address)(*given, *rest)
        worst = max(
            CHECK(lawson_segment.check.address)(
                *given, mesh[i], mesh[i + 1] - mesh[i], nodes[i].ctypes.data, bends[i].ctypes.data, 1e-12, 1e-16
            )
            for i in range(steps)
        )
        assert (worst <= 1.0) is passes

"""Fields from Lagrangians and mass matrices move as mechanics says."""

import math

import numpy as np
import pytest
import sympy

from saltus import HybridSystem, Mode, SaltusError, Transition, simulate
from saltus.errors import DefinitionError
from selection import guarding

CHAIN = {"g": 9.81, "m1": 1.0, "m2": 0.7, "m3": 0.4, "l1": 1.0, "l2": 0.6, "l3": 0.8}


def chain_lagrangian(n):
    """A chain of point masses on rods, by Cartesian coordinates, as SymPy's expression; angles from below."""
    angles, speeds = sympy.symbols(f"q1:{n + 1}"), sympy.symbols(f"v1:{n + 1}")
    masses, lengths, g = sympy.symbols(f"m1:{n + 1}"), sympy.symbols(f"l1:{n + 1}"), sympy.Symbol("g")
    x = y = sympy.Integer(0)
    lagrangian = sympy.Integer(0)
    for q, m, length in zip(angles, masses, lengths, strict=True):
        x, y = x + length * sympy.sin(q), y - length * sympy.cos(q)
        u, w = (sum(sympy.diff(a, b) * v for b, v in zip(angles, speeds, strict=True)) for a in (x, y))
        lagrangian += m * (u**2 + w**2) / 2 - m * g * y
    return lagrangian, {f"q{i}": f"v{i}" for i in range(1, n + 1)}


def chain_mass_and_forces(q, v, values):
    """The same chain by sums over its links, as numbers: no line of it is SymPy's."""
    n = len(q)
    m = [values[f"m{i + 1}"] for i in range(n)]
    length = [values[f"l{i + 1}"] for i in range(n)]
    beyond = [sum(m[k:]) for k in range(n)]
    mass, right = np.zeros((n, n)), np.zeros(n)
    for i in range(n):
        for j in range(n):
            carried = beyond[max(i, j)] * length[i] * length[j]
            mass[i, j] = carried * math.cos(q[i] - q[j])
            right[i] -= carried * math.sin(q[i] - q[j]) * v[j] ** 2
        right[i] -= beyond[i] * values["g"] * length[i] * math.sin(q[i])
    return mass, right


def system_of(mode, values, **more):
    return HybridSystem(tuple(mode.field), values, {"swing": mode}, **more)


def accelerations(mode, values, x, *phase):
    """Values of the rates of velocities, by Python's own arithmetic."""
    n = len(mode.field) // 2
    here = dict(zip((*mode.field, "theta"), (*x, *phase), strict=False))
    functions = {name: getattr(math, name) for name in ("sin", "cos", "sqrt")} | {"sign": np.sign}
    return [eval(rate, functions | values | here) for rate in list(mode.field.values())[n:]]


def places(n, seed=1):
    return np.random.default_rng(seed).uniform(-3.0, 3.0, (20, n))


# fields


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_chain_of_rods_solves_its_mass_matrix(n):
    values = {name: value for name, value in CHAIN.items() if name == "g" or int(name[1]) <= n}
    lagrangian, velocities = chain_lagrangian(n)
    mode = Mode.lagrangian(lagrangian, velocities)
    for x in places(2 * n):
        mass, right = chain_mass_and_forces(x[:n], x[n:], values)
        wanted = np.linalg.solve(mass, right)
        assert accelerations(mode, values, x) == pytest.approx(wanted, rel=1e-12, abs=1e-12 * abs(wanted).max())


@pytest.mark.parametrize("n", guarding([2, 3], 2))
def test_angles_between_links_move_as_differences_of_angles_from_below(n):
    lagrangian, velocities = chain_lagrangian(n)
    sums = {}
    for letter in "qv":
        symbols = sympy.symbols(f"{letter}1:{n + 1}")
        sums |= {symbol: sum(symbols[: i + 1]) for i, symbol in enumerate(symbols)}
    mode = Mode.lagrangian(lagrangian.subs(sums, simultaneous=True), velocities)
    for x in places(2 * n):
        mass, right = chain_mass_and_forces(np.cumsum(x[:n]), np.cumsum(x[n:]), CHAIN)
        wanted = np.diff(np.linalg.solve(mass, right), prepend=0.0)
        size = abs(wanted).max()
        assert accelerations(mode, CHAIN, x) == pytest.approx(wanted, rel=1e-12, abs=1e-12 * size)


def test_three_links_have_a_short_field():
    lagrangian, velocities = chain_lagrangian(3)
    assert max(map(len, Mode.lagrangian(lagrangian, velocities).field.values())) < 1000


def test_a_double_pendulum_has_the_accelerations_in_print():
    # Neumann, myphysicslab.com: the double pendulum, equations (13) and (14)
    lagrangian, velocities = chain_lagrangian(2)
    mode = Mode.lagrangian(lagrangian, velocities)
    g, m1, m2, l1, l2 = (CHAIN[name] for name in ("g", "m1", "m2", "l1", "l2"))
    for a, b, u, w in places(4):
        below = 2 * m1 + m2 - m2 * math.cos(2 * a - 2 * b)
        first = (
            -g * (2 * m1 + m2) * math.sin(a)
            - m2 * g * math.sin(a - 2 * b)
            - 2 * math.sin(a - b) * m2 * (w**2 * l2 + u**2 * l1 * math.cos(a - b))
        ) / (l1 * below)
        second = (
            2 * math.sin(a - b)
            * (u**2 * l1 * (m1 + m2) + g * (m1 + m2) * math.cos(a) + w**2 * l2 * m2 * math.cos(a - b))
        ) / (l2 * below)  # fmt: skip
        size = abs(first) + abs(second)
        assert accelerations(mode, CHAIN, (a, b, u, w)) == pytest.approx([first, second], rel=1e-12, abs=1e-12 * size)


def test_energy_is_kept_along_a_double_pendulum():
    lagrangian, velocities = chain_lagrangian(2)
    system = system_of(Mode.lagrangian(lagrangian, velocities), CHAIN)
    motion = simulate(system, x0=(2.0, 1.0, 0.0, 0.0), t_end=10.0, tolerance=1e-13)
    g, m1, m2, l1, l2 = (CHAIN[name] for name in ("g", "m1", "m2", "l1", "l2"))
    q1, q2, v1, v2 = motion(np.linspace(0.0, 10.0, 500)).T
    kinetic = (m1 + m2) * (l1 * v1) ** 2 / 2 + m2 * (l2 * v2) ** 2 / 2 + m2 * l1 * l2 * v1 * v2 * np.cos(q1 - q2)
    energy = kinetic - (m1 + m2) * g * l1 * np.cos(q1) - m2 * g * l2 * np.cos(q2)
    assert np.ptp(q1) > 2.0
    assert energy == pytest.approx(energy[0], rel=0.0, abs=1e-10)


def test_a_pendulum_on_a_cart_has_the_accelerations_in_print():
    # Aastrom and Murray, Feedback Systems, 2nd ed., example 3.3: the angle is from above, the friction linear
    mode = Mode.lagrangian(
        "M*u**2/2 + m*((u - l*w*cos(s))**2 + (l*w*sin(s))**2)/2 + J*w**2/2 - m*g*l*cos(s)",
        {"p": "u", "s": "w"},
        {"p": "F - c*u", "s": "-gamma*w"},
    )
    values = {"M": 2.0, "m": 0.3, "l": 0.5, "J": 0.02, "g": 9.8, "F": 1.5, "c": 0.1, "gamma": 0.05}
    for p, s, u, w in places(4):
        mass = [[2.3, -0.15 * math.cos(s)], [-0.15 * math.cos(s), 0.02 + 0.3 * 0.25]]
        right = [1.5 - 0.1 * u - 0.15 * math.sin(s) * w**2, -0.05 * w + 0.15 * 9.8 * math.sin(s)]
        assert accelerations(mode, values, (p, s, u, w)) == pytest.approx(
            np.linalg.solve(mass, right), rel=1e-12, abs=1e-12
        )


def test_a_compass_gait_swings_as_its_equations_say():
    # Goswami, Thuilot, Espiau, Int. J. Robotics Research 17 (1998) 1282, section 2: angles from the vertical
    a, b, m, hip, g = 0.5, 0.5, 5.0, 10.0, 9.8
    lagrangian = (
        "m*(a*vs)**2/2 - m*g*a*cos(s) + mh*(l*vs)**2/2 - mh*g*l*cos(s)"
        " + m*((-l*vs*cos(s) + b*vn*cos(n))**2 + (-l*vs*sin(s) + b*vn*sin(n))**2)/2 - m*g*(l*cos(s) - b*cos(n))"
    )
    mode = Mode.lagrangian(lagrangian, {"n": "vn", "s": "vs"})
    values = {"a": a, "b": b, "l": a + b, "m": m, "mh": hip, "g": g}
    for n, s, vn, vs in places(4):
        coupled = -m * (a + b) * b * math.cos(s - n)
        mass = [[m * b**2, coupled], [coupled, (hip + m) * (a + b) ** 2 + m * a**2]]
        turning = m * (a + b) * b * math.sin(s - n)
        right = [
            -turning * vs**2 - m * b * g * math.sin(n),
            turning * vn**2 + (hip * (a + b) + m * a + m * (a + b)) * g * math.sin(s),
        ]
        wanted = np.linalg.solve(mass, right)
        assert accelerations(mode, values, (n, s, vn, vs)) == pytest.approx(
            wanted, rel=1e-12, abs=1e-12 * abs(wanted).max()
        )


def test_a_pivot_that_moves_acts_as_gravity_that_varies():
    # Kapitza: l q'' = -(g + y'') sin q where the pivot is at y = a cos(theta)
    mode = Mode.lagrangian(
        "m*((l*v*cos(q))**2 + (l*v*sin(q) - a*w*sin(theta))**2)/2 + m*g*(l*cos(q) - a*cos(theta))",
        {"q": "v"},
        phase=("theta", "w"),
    )
    values = {"m": 2.0, "l": 0.4, "a": 0.1, "w": 7.0, "g": 9.8}
    for q, v, theta in places(3):
        wanted = -(9.8 - 0.1 * 49.0 * math.cos(theta)) * math.sin(q) / 0.4
        assert accelerations(mode, values, (q, v), theta) == pytest.approx([wanted], rel=1e-12, abs=1e-12)


def test_a_relativistic_mass_is_the_third_power_of_its_factor():
    mode = Mode.lagrangian("-m*c**2*sqrt(1 - v**2/c**2) + F*q", {"q": "v"})
    values = {"m": 2.0, "c": 3.0, "F": 0.5}
    assert accelerations(mode, values, (0.1, 1.8)) == pytest.approx([0.5 / 2.0 * (1 - 0.36) ** 1.5], rel=1e-12)


def test_a_potential_with_a_corner_gives_a_force_that_jumps():
    mode = Mode.lagrangian("m*v**2/2 - r*abs(q)", {"q": "v"})
    values = {"m": 2.0, "r": 0.5}
    assert accelerations(mode, values, (0.4, 0.0)) == pytest.approx([-0.25])
    assert accelerations(mode, values, (-0.4, 0.0)) == pytest.approx([0.25])


def test_a_spring_that_only_pushes_needs_two_modes():
    mode = Mode.lagrangian("m*v**2/2 - k*Max(0, q)**2/2", {"q": "v"})
    with pytest.raises(DefinitionError, match="a mode on either side, and a transition"):
        system_of(mode, {"m": 2.0, "k": 3.0})


@pytest.mark.parametrize("form", [lambda rows: rows, sympy.Matrix, np.array])
def test_a_full_mass_matrix_is_solved_whatever_holds_it(form):
    rng = np.random.default_rng(3)
    root = rng.uniform(-1.0, 1.0, (4, 4))
    matrix = root @ root.T + np.eye(4)
    velocities = {f"q{i}": f"v{i}" for i in range(4)}
    mode = Mode.mass_matrix(form((matrix + matrix.T) / 2), ["1", "q0", -2.5, sympy.Symbol("v1") ** 2], velocities)
    values = {}
    for x in places(8):
        wanted = np.linalg.solve(matrix, [1.0, x[0], -2.5, x[5] ** 2])
        assert accelerations(mode, values, x) == pytest.approx(wanted, rel=1e-12, abs=1e-12 * abs(wanted).max())


def test_names_of_functions_and_constants_are_plain_names():
    mode = Mode.lagrangian("pi*beta**2/2 - S*sin**2/2 + E*cos (1)*sin", {"sin": "beta"})
    values = {"pi": 2.0, "S": 3.0, "E": 0.5}
    assert accelerations(mode, values, (0.7, 0.0)) == pytest.approx([(0.5 * math.cos(1.0) - 2.1) / 2.0])


def test_sub_expressions_are_differentiated_too():
    mode = Mode.lagrangian("m*v**2/2 - k*gap**2/2", {"q": "v"}, let={"gap": "q**2 - d"})
    values = {"m": 1.0, "k": 2.0, "d": 0.3}
    assert accelerations(mode, values, (0.5, 0.0)) == pytest.approx([-2.0 * (0.25 - 0.3) * 2 * 0.5])


def test_a_smooth_system_is_made_of_a_mode():
    system = HybridSystem.smooth(Mode.lagrangian("v**2/2 - k*q**2/2", {"q": "v"}, domain="q + 9"), {"k": 2.0})
    assert system.states == ("q", "v")
    assert system.modes["smooth"].domain == "q + 9"


def test_a_walker_s_mode_jumps_as_others_do():
    mode = Mode.lagrangian("v**2/2 - g*q", {"q": "v"}, domain="q + 1")
    ball = HybridSystem(
        ("q", "v"), {"g": 2.0}, {"flight": mode}, [Transition("flight", "flight", "q", -1, {"v": "-v"}, name="impact")]
    )
    motion = simulate(ball, x0=(1.0, 0.0), t_end=1.5)
    assert motion.events["time"][0] == pytest.approx(1.0)


# where a mass matrix is singular at places


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_a_motion_to_where_the_mass_vanishes_ends_with_an_error(start):
    mode = Mode.lagrangian("q*v**2/2 - q", {"q": "v"})
    system = system_of(mode, {})
    with pytest.raises(SaltusError):
        simulate(system, x0=(start, -1.0), t_end=5.0)


# what is refused


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("v**2/2", {"q": "v", "p": "u"}), r"lagrangian = 'v\*\*2/2': .* kinetic energy of its own; 'u' has none"),
        (("(v + u)**2/2", {"q": "v", "p": "u"}), "lagrangian = .*its mass matrix is singular everywhere"),
        (("v*cos(q) - q**2", {"q": "v"}), "lagrangian = .*'v' has none"),
        (("v**2", {"q": "v", "v": "a"}), "velocities = 'v': must be one of them only"),
        (("v**2", {"q": "q"}), "velocities = 'q': must be one of them only, but it is a coordinate and a velocity"),
        (("v**2", {"q": "v", "p": "v"}), "velocities = 'v': .*the velocity of two coordinates"),
        (("v**2", {}), "velocities = {}: must be a mapping of coordinates to velocities, .*at least one"),
        (("v**2", ["q"]), "velocities = .*a mapping of coordinates to velocities"),
        (("v**2", {f"q{i}": f"v{i}" for i in range(6)}), "velocities = 6: must be those of at most 5 coordinates"),
        (("v**2", {"q": "2v"}), "velocity of 'q' = '2v': must be an identifier"),
        ((["v**2"], {"q": "v"}), "lagrangian = .*must be an expression: text, a number or SymPy"),
        ((sympy.Function("q")(sympy.Symbol("t")), {"q": "v"}), r"lagrangian = 'q\(t\)': .*in place of q\(t\)"),
        (("v**2 + ", {"q": "v"}), "lagrangian = .*must be an expression"),
        (("m(q)*v**2", {"q": "v"}), "lagrangian = .*'m' is unknown"),
        (("v**2/2", {"q": "v"}, {"v": "-c*v"}), "forces = 'v': must be a coordinate: q; .*not of the velocity"),
        (("v**2/2", {"q": "v"}, {"qq": "1"}), "forces = 'qq': must be a coordinate: q; did you mean 'q'"),
        (("v**2/2", {"q": "v"}, ["1"]), "forces = .*a mapping of coordinates"),
        (("v**2/2", {"q": "v"}, {"q": [1]}), "force of 'q' = .*an expression"),
        (("v**2/2", {"q": "v"}, {"q": "1 +"}), "force of 'q' = .*an expression"),
    ],
)
def test_a_lagrangian_that_cannot_be_used_is_told(arguments, message):
    with pytest.raises(DefinitionError, match=message):
        Mode.lagrangian(*arguments)


@pytest.mark.parametrize(
    ("mass", "forces", "message"),
    [
        ([["m", "0"]], [0, 0], "mass = 'rows of 2': must be a matrix of 2 rows of 2 expressions"),
        ([["m", "0"], ["m"]], [0, 0], "mass = 'rows of 2, 1': must be a matrix of 2 rows"),
        ("m", [0, 0], "mass = 'm': must be a matrix of 2 rows"),
        (["m", "m"], [0, 0], "mass = .*as in"),
        (
            [["m", "k"], ["l", "m"]],
            [0, 0],
            r"mass = 'l and k': must be symmetric, but mass\[1\]\[0\] and mass\[0\]\[1\]",
        ),
        ([["m", "m*cos(q)"], ["m*cos(q)", "m - m*sin(q)**2"]], [0, 0], "mass = .*not singular everywhere; .*is 0"),
        ([[0.1, 0.2], [0.2, 0.4]], [0, 0], "mass = .*not singular everywhere"),
        ([["m", "0"], ["0", "m"]], {"q": "1"}, "forces = .*one for each of q, p; 'p' is missing"),
        ([["m", "0"], ["0", "m"]], ["1"], "forces = .*2 expressions, one for each of q, p"),
        ([["m", "0"], ["0", "m"]], "1", "forces = '1': must be a mapping"),
        ([["m", "0"], ["0", "m +"]], [0, 0], r"mass\[1\]\[1\] = .*an expression"),
    ],
)
def test_a_mass_matrix_that_cannot_be_used_is_told(mass, forces, message):
    with pytest.raises(DefinitionError, match=message):
        Mode.mass_matrix(mass, forces, {"q": "v", "p": "u"})


def test_entries_that_are_equal_but_written_otherwise_are_symmetric():
    mass = [["m", "r*cos(2*q)"], ["r - 2*r*sin(q)**2", "m"]]
    assert set(Mode.mass_matrix(mass, [0, 0], {"q": "v", "p": "u"}).field) == {"q", "p", "v", "u"}


def test_a_momentum_that_varies_with_the_phase_needs_the_phase():
    mode = Mode.lagrangian("v**2/2 + a*v*cos(theta)", {"q": "v"})
    with pytest.raises(DefinitionError, match="mode 'swing' = 'theta': must be constant in time.*hand phase="):
        system_of(mode, {"a": 1.0, "w": 2.0}, phase=("theta", "w"))
    clocked = Mode.lagrangian("v**2/2 + a*v*cos(theta)", {"q": "v"}, phase=("theta", "w"))
    with pytest.raises(DefinitionError, match="mode 'swing' = .*the system's phase"):
        system_of(clocked, {"a": 1.0, "w": 2.0}, phase=("theta", "2*w"))


def test_a_sub_expression_of_the_system_in_a_lagrangian_is_refused():
    mode = Mode.lagrangian("v**2/2 - gap**2", {"q": "v"})
    with pytest.raises(DefinitionError, match="mode 'swing' = 'gap': .*hand let= to Mode.lagrangian"):
        system_of(mode, {}, let={"gap": "q - 1"})

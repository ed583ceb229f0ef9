"""Machine code of generated functions against Python and against Numba, bit by bit."""

from __future__ import annotations

import ast
import ctypes
import itertools
import math
import sys
from functools import partial, reduce
from textwrap import dedent, indent

import numba
import numpy as np
import pytest
from numba.core import event
from numba.core.compiler_lock import global_compiler_lock
from numba.extending import intrinsic

import systems
from saltus import HybridSystem, Mode, simulate
from saltus.system.cache import read_checked
from saltus.system.compiled import FLOW, SECOND_DERIVATIVES, SERIES
from saltus.system.generated import source_file
from saltus.system.numba_tools import lowering
from saltus.system.numba_tools.machine_code import LOWERED, generated
from selection import guarding

_POINTER = numba.types.CPointer(numba.float64)
_SIGNATURE = numba.void(numba.int64, numba.int64, _POINTER, _POINTER, _POINTER)
_FOREIGN = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 3)
_TOTAL = itertools.count()
FAST = ("contract", "nsz")

# numbers at which functions, orders and signs are special
SPECIAL = [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.0, 1e-310, 1e300, -1e300, 709.9, 3.7, math.inf, -math.inf, math.nan]


def text_of(body):
    return "def f(k, m, x, p, out):\n" + indent(dedent(body).strip(), "    ") + "\n"


def lowered(tree, fast=False):
    """Return a generated function as a call of arrays; its library lives as long as the call."""
    symbol = f"f_{next(_TOTAL)}"
    with global_compiler_lock:
        library = lowering.library_of(tree, symbol, fast=fast)
        address = lowering.code_of(library, symbol)
    return of_arrays(address, library)


def of_arrays(address, owner):
    function = _FOREIGN(address)

    def call(k, m, x, p, out):
        function(k, m, x.ctypes.data, p.ctypes.data, out.ctypes.data)

    call.owner = owner
    return call


def by_numba(tree, fast=False):
    """Return the same by Numba."""
    names = {"math": math, "products": products}
    plain = ast.FunctionDef(tree.name, tree.args, tree.body, [])
    exec(compile(ast.fix_missing_locations(ast.Module([plain], [])), "generated", "exec"), names)
    options = {"fastmath": set(FAST)} if fast else {}
    callback = numba.cfunc(_SIGNATURE, error_model="numpy", **options)(names[tree.name])
    return of_arrays(callback.address, callback)


@intrinsic
def products(typingctx, *factors):
    """The sum of products, with what is added to what written down once more."""
    pair = numba.types.StarArgTuple.from_types(factors)

    def lower(context, builder, signature, arguments):
        values = [builder.extract_value(arguments[0], i) for i in range(len(factors))]
        terms = [builder.fmul(a, b, flags=FAST) for a, b in zip(values[::2], values[1::2], strict=True)]
        first = max(len(terms) - 3, 1)
        sums = terms[:first]
        while len(sums) > 1:
            odd = [sums[-1]] if len(sums) % 2 else []
            sums = [builder.fadd(a, b, flags=FAST) for a, b in zip(sums[:-1:2], sums[1::2], strict=True)] + odd
        return reduce(lambda a, b: builder.fadd(a, b, flags=FAST), sums + terms[first:])

    return numba.float64(pair), lower


def results(function, k=0, m=0, x=(), p=()):
    out = np.full(16, -7.0)
    function(k, m, np.array(x, float), np.array(p, float), out)
    return out


def of_text(body):
    """Return the function by this package's code and by Python."""
    text, names = text_of(body), {"math": math}
    exec(text, names)
    return lowered(ast.parse(text).body[0]), names["f"]


@pytest.mark.parametrize("k", [0, 1, 2, 5])
def test_branches_loops_and_places_are_those_of_python(k):
    machine, python = of_text(
        """
        if k == 0:
            u = x[0]*p[1] - -2.5
            out[0] = u
            if u > 3.0:
                v = u/4.0
                out[1] = v
            else:
                out[1] = -u
        elif k == 1:
            u = 2.0 if x[1] >= 1.0 or p[0] < 0.5 else x[0] if x[1] == 0.25 else 3*x[0]
            out[1 + 2] = u
        elif k == 2:
            w = x[0]
            for c in range(m):
                v = x[1]*p[c]
                out[2 + 3*m + c] = v + w
                out[c] = c
        else:
            pass
        """
    )
    for x, p in (([2.0, 0.25], [1.0, 4.0]), ([0.5, 1.0], [0.25, 0.75]), ([-3.0, 0.0], [0.75, -1.0])):
        for m in (0, 1, 2):
            np.testing.assert_array_equal(results(machine, k, m, x, p), results(python, k, m, x, p))


def test_tuples_and_loops_within_loops_are_those_of_python():
    machine, python = of_text(
        """
        if k == 0:
            places = (2, 0, 1, 1,)
            ends = (0, 1, 1, 4,)
            values = (x[0], -2.5, x[1]*p[0], 3,)
            for i in range(3):
                for c in range(m):
                    out[i*m + c] = 0.0
                for e in range(ends[i], ends[i + 1]):
                    for c in range(m):
                        out[i*m + c] = out[i*m + c] + values[e]*x[places[e]*m + c]
        """
    )
    x, p = np.linspace(-1.3, 2.1, 15), [0.7]
    for m in (0, 1, 2, 5):
        np.testing.assert_array_equal(results(machine, 0, m, x, p), results(python, 0, m, x, p))
    expected = np.array([[0.0, 0.0, x[0]], [0.0, 0.0, 0.0], [-2.5, x[1] * 0.7 + 3.0, 0.0]]) @ x.reshape(3, 5)
    np.testing.assert_allclose(results(machine, 0, 5, x, p)[:15].reshape(3, 5), expected, atol=1e-15)


@pytest.mark.parametrize("numbers", list(itertools.product([1.0, 2.0, -0.0, 0.0, math.nan], repeat=3)))
def test_extremes_are_those_of_python_with_signs_and_nan(numbers, extremes):
    machine, python = extremes
    found, expected = results(machine, x=numbers), results(python, x=numbers)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(np.signbit(found), np.signbit(expected))


@pytest.fixture(scope="module")
def extremes():
    return of_text("out[0] = max(x[0], x[1], x[2])\nout[1] = min(x[0], x[1], x[2])\nout[2] = abs(x[0])")


ONE = ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "exp", "log",
       "sqrt", "erf"]  # fmt: skip
TWO = ["math.atan2({}, {})", "math.copysign({}, {})", "({})**({})"]


@pytest.fixture(scope="module")
def elementary():
    """Each elementary function, by this package's code and by Numba's."""
    lines = [f"out[{i}] = math.{name}(x[0])" for i, name in enumerate(ONE)]
    two = [f"out[{i}] = {text.format('x[0]', 'x[1]')}" for i, text in enumerate(TWO)]
    two += ["out[3] = x[0]**2.0", "out[4] = x[0]**0.5", "out[5] = x[0]/x[1]"]
    two += ["out[6] = x[0]**x[1] if x[0] >= 0.0 or x[1] == math.floor(x[1]) else 0.0"]
    trees = [ast.parse(text_of("\n".join(body))).body[0] for body in (lines, two)]
    return [(lowered(tree), by_numba(tree)) for tree in trees]


def test_elementary_functions_have_the_bits_of_numba(elementary):
    (machine, numbas), (machine_2, numbas_2) = elementary
    random = np.random.default_rng(5).normal(size=200).tolist()
    for a in SPECIAL + random:
        assert results(machine, x=[a]).tobytes() == results(numbas, x=[a]).tobytes()
    whole = [number for number in SPECIAL if abs(number) < 1e18]  # Numba's floor is an integer, which overflows
    for a, b in [*itertools.product(SPECIAL, whole), *zip(random, random[::-1], strict=True)]:
        assert results(machine_2, x=[a, b]).tobytes() == results(numbas_2, x=[a, b]).tobytes()


@pytest.mark.parametrize("count", range(1, 12))
def test_a_sum_of_products_is_that_of_exact_arithmetic(count):
    terms = ", ".join(f"x[{i}], p[{i}]" for i in range(count))
    machine = lowered(ast.parse(text_of(f"out[0] = products({terms})")).body[0])
    x, p = (np.random.default_rng(count).integers(-99, 99, (2, count)) / 8.0).tolist()
    assert results(machine, x=x, p=p)[0] == math.fsum(a * b for a, b in zip(x, p, strict=True))


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("for c in range(m):\n    u = x[0]\nout[0] = u", "u, which has no value there"),
        ("if k == 0:\n    u = x[0]\nout[0] = u", "u, which has no value there"),
        ("u = 0.0\nfor c in range(m):\n    u = u + x[c]\nout[0] = u", "a loop that changes u"),
        ("out[0] = y[0]", "y, which has no value there"),
        ("while k:\n    pass", "while k"),
        ("u, v = x[0], x[1]", "u, v = "),
        ("out[0] = x[0] % 2.0", "x\\[0\\] % 2.0"),
        ("out[0] = 1.0 if 0.0 < x[0] < 1.0 else 0.0", "0.0 < x\\[0\\] < 1.0"),
        ("out[0] = 1.0 if k == 0 and m == 0 else 0.0", "k == 0 and m == 0"),
        ("out[0] = not k", "not k"),
        ("out[0] = True", "True"),
        ("out[0] = 'a'", "'a'"),
        ("out[0] = cosine(x[0])", "cosine"),
        ("out[0] = math.foo(x[0])", "math.foo"),
        ("out[0] = math.e", "math.e"),
        ("out[0] = x[0] > 1.0", "a number of LLVM's type i1"),
        ("out[0] = x", "a number of LLVM's type double"),
        ("out[0] = x[1.0]", "1.0 where LLVM wants i64"),
        ("out[0] = 1.0 if x[0] else 2.0", "x\\[0\\] where LLVM wants i1"),
        ("if k:\n    pass", "k where LLVM wants i1"),
        ("for c in range(m):\n    pass\nelse:\n    out[0] = 1.0", "for c in range"),
        ("for k in range(m):\n    pass", "for k in range"),
        ("out[0] = max(x[0], x[1], key=abs)", "key=abs"),
        ("out[0] = products()", "products\\(\\)"),
        ("out[0] = [x[0]][0]", "\\[x\\[0\\]\\]"),
    ],
)
def test_what_no_generated_function_has_is_refused(body, said):
    with pytest.raises(NotImplementedError, match=said):
        lowered(ast.parse(text_of(body)).body[0])


def test_a_symbol_that_is_not_there_is_told():
    tree = ast.parse(text_of("out[0] = 1.0")).body[0]
    with global_compiler_lock:
        library = lowering.library_of(tree, f"f_{next(_TOTAL)}", fast=False)
        with pytest.raises(RuntimeError, match="g is not in the library f_"):
            lowering.code_of(library, "g")


class Counted(event.Listener):
    def __init__(self):
        self.names = []

    def on_start(self, event):
        self.names.append(event.data["name"])

    def on_end(self, event):
        pass


def test_code_is_compiled_once_and_then_read_from_its_file(tmp_path, monkeypatch):
    names = {"TEXT": b"def f(k, m, x, p, out):\n    out[0] = 2.0*x[0]\n", "__name__": "generated_twice"}
    file = tmp_path / "generated_twice.py"
    file.write_bytes(names["TEXT"])
    monkeypatch.setitem(sys.modules, "generated_twice", type(sys)("generated_twice"))
    exec(compile(names["TEXT"], file, "exec"), names)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    counted, seen = Counted(), []
    event.register(LOWERED, counted)
    try:
        for _ in range(2):
            function = generated()(names["f"])
            assert results(of_arrays(function.address, function), x=[3.5])[0] == 7.0
            assert function.address == function.address
            seen.append(len(counted.names))
        names["TEXT"] = names["TEXT"].replace(b"2.0", b"3.0")
        function = generated()(names["f"])
        assert results(of_arrays(function.address, function), x=[3.5])[0] == 10.5
        seen.append(len(counted.names))
    finally:
        event.unregister(LOWERED, counted)
    assert seen == [1, 1, 2]


MODELS = {f.__name__: f for f in (systems.ball_on_table, systems.impact_oscillator, systems.stick_slip, systems.relay)}
MODELS |= {f"afm {n}": partial(systems.afm, n) for n in (1, 2)}
CASES = [(name, kind) for name in MODELS for kind in ("flow", "series", "second")]
VARIANTS = {"flow": (FLOW,), "series": (SERIES, 24), "second": (SECOND_DERIVATIVES, (0,))}


@pytest.mark.parametrize(("name", "kind"), guarding(CASES, ("relay", "flow"), ("relay", "series"), campaign=4))
def test_whole_modules_have_the_bits_of_numba(name, kind):
    kind, *variant = VARIANTS[kind]
    text = read_checked(source_file(kind, MODELS[name](), *variant))
    random = np.random.default_rng(7)
    for tree in ast.parse(text).body:
        if not isinstance(tree, ast.FunctionDef):
            continue
        fast = "fast=True" in ast.unparse(tree.decorator_list[0])
        functions = lowered(tree, fast), by_numba(tree, fast)
        for k, m, size in itertools.product(range(5), (0, 3), (1.0, 1e-3, 30.0)):
            x, p = size * random.normal(size=(2, 500))
            found = []
            for function in functions:
                out = np.concatenate([p, np.full(3000, -7.0)])  # constants stand behind the parameters
                function(k, m, x, out if tree.name == "derive" else p, out)
                found.append(out.tobytes())
            assert found[0] == found[1], (tree.name, k, m, size)


@pytest.mark.campaign
def test_sums_and_choices_of_any_length_are_compiled():
    terms = "".join(f" + p[{i}]*x[{i}]" for i in range(1, 2000))
    choices = "".join(f"\nelif m == {j}:\n    out[1] = {j}.0" for j in range(1, 500))
    machine = lowered(ast.parse(text_of(f"out[0] = p[0]*x[0]{terms}\nif m == 0:\n    out[1] = 0.0{choices}")).body[0])
    x = np.arange(2000.0)
    found = results(machine, m=437, x=x, p=1.0 + x)
    assert found[0] == float(np.sum(x * (1.0 + x)))
    assert found[1] == 437.0


@pytest.mark.parametrize("exponent", [3.0, 2.0**53, 2.0**63, 1e19, 1e300])
def test_an_exponent_is_whole_however_large(exponent):
    body = "out[0] = x[0]**x[1] if x[0] >= 0.0 or x[1] == math.floor(x[1]) else 0.5"
    machine = lowered(ast.parse(text_of(body)).body[0])
    assert results(machine, x=[-1.0, exponent])[0] == (-1.0) ** exponent
    assert results(machine, x=[-1.0, 2.5])[0] == 0.5


@pytest.mark.parametrize(
    ("text", "value"), [("exp(1)*x", math.e * 2.0), ("x*pi", math.pi * 2.0), ("x**exp(1)", 2.0**math.e)]
)
def test_constants_of_sympy_are_numbers_in_all_texts(text, value):
    system = HybridSystem(("x",), {"a": 1.5}, {"m": Mode({"x": f"-a*x + {text}"})}, outputs={"F": text})
    assert system.field("m", [2.0])[0] == pytest.approx(value - 3.0, rel=1e-15)
    assert simulate(system, x0=[2.0], t_end=1e-9).output("F", [0.0]) == pytest.approx(value)

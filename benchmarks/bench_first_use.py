"""The first call with a new system: definition and motion, derivatives and series, and the same functions by Numba.

The package's own kernels are known; text and machine code of the system's functions are not.
"""

from __future__ import annotations

import ast
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numba
from measure import machine, show
from numba.core.compiler_lock import global_compiler_lock

import saltus
import systems
from saltus.system import compiled
from saltus.system.generated import source_file
from saltus.system.numba_tools import lowering

REPEATS = 3
ORDER = 20  # of the Taylor series
SYSTEMS = {
    "impact oscillator": systems.impact_oscillator,
    "tapping, one mode": lambda: systems.afm(1),
    "tapping, two modes": lambda: systems.afm(2),
}
POINTER = numba.types.CPointer(numba.float64)
SIGNATURE = numba.void(numba.int64, numba.int64, POINTER, POINTER, POINTER)


def main() -> None:
    """Print the tables."""
    print(machine())
    for name, make in SYSTEMS.items():
        seconds = {"definition and motion": [], "derivatives and series": [], "compiled": [], "compiled by Numba": []}
        functions = functions_of(make())
        for k in range(REPEATS):
            motion, derivatives = in_a_fresh_process(name)
            seconds["definition and motion"].append(motion)
            seconds["derivatives and series"].append(derivatives)
            seconds["compiled"].append(clocked(partial(all_lowered, functions, k)))
            seconds["compiled by Numba"].append(clocked(partial(all_by_numba, functions)))
        show(name, seconds, {"compiled": "compiled by Numba"}, {"compiled": f"{len(functions)} functions of the flow"})


def in_a_fresh_process(name: str) -> tuple[float, float]:
    """Seconds of `first_use` in a process of its own, with empty folders."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, __file__, name]
        ran = subprocess.run(command, env=os.environ | {"SALTUS_CACHE_DIR": folder}, capture_output=True, check=True)
    motion, derivatives = map(float, ran.stdout.split())
    return motion, derivatives


def first_use(make: Callable[[], saltus.HybridSystem]) -> None:
    """Define a system and use it; print the seconds of definition and motion, and those of derivatives and series."""
    saltus.simulate(systems.ball(), {}, [1.0, 0.0], t_end=0.5)  # reads the kernels
    made: list[saltus.HybridSystem] = []

    def moved() -> None:
        made.append(make())
        saltus.simulate(made[0], {}, [0.1] * len(made[0].states), t_end=0.1)

    def differentiated() -> None:
        _ = compiled.load(made[0]).addresses
        compiled.load_series(made[0], ORDER)

    print(clocked(moved), clocked(differentiated))


def clocked(work: Callable[[], object]) -> float:
    """Seconds of the processor."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def functions_of(system: saltus.HybridSystem) -> list[ast.FunctionDef]:
    """The functions that are generated for the flow of a system."""
    text = source_file(compiled.FLOW, system).read_text(encoding="utf-8").split("\n", 1)[1]
    return [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]


def all_lowered(functions: list[ast.FunctionDef], number: int) -> None:
    """Compile functions as the package does."""
    for tree in functions:
        symbol = f"{tree.name}_{number}"
        with global_compiler_lock:
            lowering.code_of(lowering.library_of(tree, symbol, fast=False), symbol)


def all_by_numba(functions: list[ast.FunctionDef]) -> None:
    """Compile functions by Numba."""
    for tree in functions:
        names: dict[str, object] = {"math": math}
        plain = ast.FunctionDef(tree.name, tree.args, tree.body, [])
        exec(compile(ast.fix_missing_locations(ast.Module([plain], [])), "generated", "exec"), names)
        _ = numba.cfunc(SIGNATURE, error_model="numpy")(names[tree.name]).address


if __name__ == "__main__":
    if len(sys.argv) > 1:
        first_use(SYSTEMS[sys.argv[1]])
    else:
        main()

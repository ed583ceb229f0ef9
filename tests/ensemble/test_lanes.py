"""The generated text of lanes: its pools, its vector instructions, its place on disk."""

from __future__ import annotations

import json
import os
import platform
import re
import subprocess
import sys

import llvmlite.binding as llvm
import numpy as np
import pytest
from numba import types

import systems
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.traps import Traps
from saltus.system.hybrid import HybridSystem, Mode, Transition

PACKED = {"x86_64": r"\bv?[a-z0-9]*pd\b[^\n]*%{}", "arm64": r"\bf[a-z]+\s+v\d+\.2d", "aarch64": r"\bf[a-z]+\s+v\d+\.2d"}
"""Instructions on several float64 at once; on x86-64 in the registers of the widest kind."""


def registers():
    """Registers of the widest vectors that this processor has, or nothing where that is not known."""
    machine, features = platform.machine(), llvm.get_host_cpu_features()
    if machine in ("arm64", "aarch64"):
        return "v"
    if machine == "x86_64" and features.get("avx2"):
        return "[yz]mm"
    return ""


def hertz():
    """A driven mass and a contact with a root: steps in time, in sigma, and by the exact flow."""
    free = "-x - 0.1*v + A*cos(s)"
    return HybridSystem(
        ("x", "v"),
        {"w": 0.8, "A": 0.5, "d": 0.1, "k": 20.0},
        {"free": Mode({"x": "v", "v": free}), "touch": Mode({"x": "v", "v": f"{free} - k*(x - d)**(3/2)"})},
        [Transition("free", "touch", "x - d", 1), Transition("touch", "free", "x - d", -1)],
        phase=("s", "w"),
    )


FOLLOWED = """
import json, sys
import numpy as np
from numba.core import event
from saltus import HybridSystem
from saltus.ensemble.ensemble import Ensemble

system = HybridSystem.from_definition(json.loads(sys.argv[1]))
points = np.random.default_rng(1).uniform(-2.0, 2.0, (400, 2))
with event.install_recorder("numba:compile") as compiled:
    ends, _ = Ensemble(system, threads=1).strobe(points)
print(json.dumps({"compiled": len(compiled.buffer), "sum": float(np.abs(ends).sum())}))
"""


def followed(system, folder):
    """What a process of its own finds: compilations, and the sum of the ends of 400 motions."""
    environment = {**os.environ, "SALTUS_CACHE_DIR": str(folder), "NUMBA_CACHE_DIR": str(folder)}
    ran = subprocess.run(
        [sys.executable, "-W", "error", "-c", FOLLOWED, json.dumps(system.definition())],
        check=True, capture_output=True, text=True, env=environment,
    )  # fmt: skip
    return json.loads(ran.stdout)


@pytest.mark.campaign
def test_a_second_process_compiles_nothing(tmp_path):
    first, second = (followed(hertz(), tmp_path) for _ in range(2))
    assert first["compiled"] > 0
    assert second == {"compiled": 0, "sum": first["sum"]}


@pytest.mark.campaign
@pytest.mark.skipif(not registers(), reason="vector instructions of this processor are not known here")
@pytest.mark.parametrize(
    "make", [hertz, systems.impact_oscillator, lambda: systems.afm(2)], ids=["Hertz", "impact", "afm"]
)
def test_steps_are_made_of_vector_instructions(make):
    lanes = Ensemble(make())._lanes
    numbers = types.CPointer(types.float64)
    signature = types.int64(types.int64, numbers, types.int64, numbers, numbers)
    for k in range(lanes.module.POOLS):
        step = getattr(lanes.module, f"step_{k}")
        step.compile(signature)
        text = step.inspect_asm(signature.args)
        packed = len(re.findall(PACKED[platform.machine()].format(registers()), text))
        alone = len(re.findall(r"\bv?(?:mul|add|sub|fn?m(?:add|sub)\d+)sd\b", text))
        assert packed > 100
        # an epilogue for lanes that are no multiple of a vector may stand behind
        assert packed > 0.8 * alone, f"step {k}: {packed} packed, {alone} scalar"
        assert not re.search(r"\bcall\w*\s+[^\n]*\b(?:sin|cos|exp|pow)\b", text)


def test_every_mode_has_a_pool_and_a_linear_one_another():
    lanes = Ensemble(hertz())._lanes
    assert lanes.module.MODE_OF == (0, 1, 0)


def test_steps_of_all_pools_are_of_use():
    lanes = Ensemble(hertz(), threads=1)
    points = np.random.default_rng(2).uniform(-2.0, 2.0, (300, 2))
    lanes.settle(points, Traps(2), longest=3)
    assert (lanes.work[: lanes._lanes.module.POOLS] > 100).all()


def test_other_parameters_need_no_other_text():
    modules = [Ensemble(hertz(), {"w": w, "A": 0.2})._lanes.module.__file__ for w in (0.5, 0.8, 1.7)]
    assert len(set(modules)) == 1


def test_motions_of_other_parameters_differ():
    points = [[0.0, 0.5], [0.05, -0.5]]
    ends = [Ensemble(hertz(), {"k": k}).strobe(points)[0] for k in (1.0, 20.0, 20.0)]
    assert np.abs(ends[0] - ends[1]).max() > 1e-3
    np.testing.assert_array_equal(ends[1], ends[2])


@pytest.mark.campaign
@pytest.mark.parametrize("direction", [-1, 0])
def test_no_lane_passes_a_table_on_which_balls_come_to_rest(direction):
    """Impacts accumulate within the first periods: such motions have no state, and none is below the table."""
    reset = {"v": "-e*v + (1 + e)*a*w*cos(s)"}
    impact = Transition("flight", "flight", "z - a*sin(s)", direction, reset, name="impact")
    modes = {"flight": Mode({"z": "v", "v": "-1"})}
    table = HybridSystem(("z", "v"), {"e": 0.3, "a": 0.5, "w": 1.0}, modes, [impact], phase=("s", "w"))
    starts = np.random.default_rng(3).uniform([0.01, -1.0], [3.0, 1.0], (24, 2))
    for a, all_rest in ((0.5, True), (2.5, False)):
        ends, _ = Ensemble(table, {"a": a}, tolerance=1e-10).strobe(starts, count=6)
        rest = np.isnan(ends[:, 0])
        assert rest.all() == all_rest
        assert np.all(ends[~rest, 0] > -1e-9)

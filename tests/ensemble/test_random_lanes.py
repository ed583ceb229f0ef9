"""Random hybrid systems in lanes, against one motion at a time."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import saltus
from saltus import Mode, Transition
from saltus.ensemble.ensemble import Ensemble
from saltus.errors import SaltusError
from saltus.options import SimulationOptions
from selection import guarding

_SURFACES = ("x - 0.4", "x + 0.2", "v - 0.3", "x + 0.5*v - 0.1", "x**2 + v**2 - 1.2", "x - 0.1 - 0.3*sin(theta)")
_CONDITIONS = ("v", "-v", "x", "v - 0.2", "x + 0.1", "x*v", "0.5 - v**2", "cos(theta)", "sin(theta) - 0.3*x")


class Draw:
    """A random hybrid system with conditions, alternatives, events of the phase, and modes with states of their own."""

    def __init__(self, seed):
        rng = self.rng = np.random.default_rng(seed)
        self.modes = ["A", "B", "C"][: rng.integers(1, 4)]
        self.has_memory = {name: len(self.modes) == 1 or rng.random() < 0.6 for name in self.modes}
        made = [way for source in self.modes for _ in range(rng.integers(1, 4)) for way in self.ways(source)]
        transitions = [replace(way, name=f"t{i}") for i, way in enumerate(made)]
        fields = {name: self.field(name) for name in self.modes}
        self.system = saltus.HybridSystem(("x", "v", "q"), {"w": 1.3}, fields, transitions, phase=("theta", "w"))

    def field(self, name):
        rng = self.rng
        force = f"{rng.uniform(0.2, 1.5)}*cos(theta) - {rng.uniform(0.5, 3)}*x - {rng.uniform(0.02, 0.3)}*v"
        force += rng.choice(["", " - 0.3*x**3", " + 0.2"])
        if not self.has_memory[name]:
            return Mode({"x": "v", "v": force}, states=("x", "v"))
        return Mode({"x": "v", "v": f"{force} + {rng.uniform(-0.8, 0.8)}*q", "q": "0.6*x - 1.4*q"})

    def ways(self, source):
        """Yield one transition, or two that share a surface."""
        rng, where = self.rng, {}
        if rng.random() < 0.2:
            where["at_phase"] = rng.uniform(0.2, 6)
        else:
            where |= {"event": str(rng.choice(_SURFACES)), "direction": int(rng.choice([-1, 1, 0], p=[0.4, 0.4, 0.2]))}
        count = 1
        if rng.random() < 0.6:
            where["when"] = str(rng.choice(_CONDITIONS))
            count = rng.choice([1, 2])
        for _ in range(count):
            target = str(rng.choice(self.modes))
            reset = {"v": str(rng.choice(["-0.7*v", "0.8*v", "v + 0.1"]))} if rng.random() < 0.3 else {}
            if self.has_memory[target] and (not self.has_memory[source] or rng.random() < 0.2):
                reset["q"] = str(rng.choice(["0", "x", "0.5*v"]))
            yield Transition(source, target, reset=reset, **where)
            if "when" in where:
                where["when"] = str(rng.choice(_CONDITIONS))


@pytest.mark.parametrize("seed", guarding(range(12), campaign=4))
def test_motions_of_random_systems_are_those_of_the_event_driven_flow(seed):
    drawn = Draw(seed)
    starts = drawn.rng.uniform(-1.5, 1.5, (20, 3))
    starts[drawn.rng.random(20) < 0.6, 2] = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ends, modes = Ensemble(drawn.system, {}, tolerance=1e-11).strobe(starts, count=3)
        compared = 0
        for start, end, mode in zip(starts, ends, modes, strict=True):
            try:
                options = SimulationOptions(max_events=2000)
                motion = saltus.simulate(drawn.system, {}, start, periods=3, tolerance=(1e-12, 1e-12), options=options)
            except SaltusError:
                assert not np.isfinite(end).all()
                continue
            if "events" in motion.stopped:
                continue
            compared += 1
            np.testing.assert_allclose(end, motion.x_end[:3], atol=1e-6 * (1 + np.abs(motion.x_end).max()))
            assert drawn.system.mode_names[mode] == motion.mode_at(motion.t_end)
    assert compared > 10

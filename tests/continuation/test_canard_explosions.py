"""A branch of cycles passes a canard explosion from either end, with the fold where simulations begin to die."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import saltus
from selection import guarding

FOLDS = {0.08: 0.324178522504, 0.05: 0.311979818354}  # where motions of FitzHugh and Nagumo's neuron begin to die


def neuron(rate: float) -> saltus.HybridSystem:
    fields = {"v": "v - v**3/3 - w + I", "w": "e*(v + 0.7 - 0.8*w)"}
    return saltus.HybridSystem.smooth(fields, {"I": 0.5, "e": rate}, name="FitzHugh-Nagumo")


def swing(rate: float, current: float, span: float = 2500.0) -> float:
    """Return the range of the voltage at the end of a motion that SciPy follows from a large cycle."""

    def field(t: float, x: np.ndarray) -> list[float]:
        return [x[0] - x[0] ** 3 / 3.0 - x[1] + current, rate * (x[0] + 0.7 - 0.8 * x[1])]

    places = np.linspace(span - 300.0, span, 3001)
    motion = solve_ivp(field, (0.0, span), [1.0, 0.0], rtol=1e-12, atol=1e-13, method="DOP853", t_eval=places)
    return float(np.ptp(motion.y[0]))


@pytest.mark.parametrize("rate", guarding(FOLDS, 0.08))
def test_branch_is_the_same_from_both_ends_of_a_canard_explosion(rate):
    system = neuron(rate)
    rest = saltus.find_equilibrium(system, {"I": 0.0}, x0=[-1.0, -0.5])
    hopf = saltus.continue_equilibrium(rest, "I", (0.0, 1.0))["HB1"]
    small = saltus.continue_orbit(saltus.switch_branch(hopf), "I", (0.0, 0.6))
    large = saltus.continue_orbit(saltus.find_orbit(system, x0=[1.0, 0.0]), "I", (0.0, 0.6))
    for branch in (small, large):
        assert sorted(point.type for point in branch.special_points) == ["HB", "SN"]
        assert branch["SN1"].parameters["I"] == pytest.approx(FOLDS[rate], abs=2e-12)
        assert branch["HB1"].parameters["I"] == pytest.approx(hopf.parameters["I"], abs=1e-10)
        assert sorted(end.split(": ")[1] for end in branch.stopped) == [
            "bound reached",
            "the cycle shrinks to an equilibrium",
        ]
        assert not branch.audit.breaches
        assert not branch.audit.remarks
        assert np.all(branch.multipliers[:, 0].real >= 0.0)  # of a planar flow; 0 below its error


@pytest.mark.parametrize("rate", guarding(FOLDS, 0.08))
def test_fold_on_a_canard_is_where_simulated_cycles_begin_to_die(rate):
    assert swing(rate, FOLDS[rate] + 1e-9) > 3.0
    assert swing(rate, FOLDS[rate] - 1e-9) < 1e-3


@pytest.mark.parametrize("rate", guarding([0.003, 0.002]))
def test_relaxation_cycles_go_onto_a_canard_that_a_jump_ends(rate):
    """What grows along the canard is forgotten behind the jump, and a long contraction before it hides it."""
    field = {"x": "y - x**3/3 + x", "y": "e*(a - x)"}
    start = saltus.find_orbit(saltus.HybridSystem.smooth(field, {"a": 0.5, "e": rate}), x0=[2.0, 0.0])
    steps = saltus.StepControl(max_points=60)
    branch = saltus.continue_orbit(start, "a", (-1.5, 1.5), directions="down", steps=steps)
    assert branch.stopped[1].endswith("60 points")
    # Benoit, Callot, Diener and Diener: the canard's parameter, in powers of the rate
    canard = -1.0 + rate / 8.0 + 3.0 * rate**2 / 32.0 + 173.0 * rate**3 / 1024.0
    assert branch.values[-1] == pytest.approx(canard, abs=2.0 * rate**4)
    assert np.ptp(branch.values[-10:]) < 1e-11
    assert np.ptp(branch.period[-10:]) > 1.0

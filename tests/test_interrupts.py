"""An interrupt (Ctrl-C) keeps what is done."""

from __future__ import annotations

import signal

import numpy as np
import pytest

import saltus
from saltus import afm
from saltus.flow.motion import EventDrivenMotion
from saltus.maps.kernels import steps
from saltus.work import interrupt_noted

LORENZ = saltus.HybridSystem.smooth({"x": "10*(y - x)", "y": "28*x - y - x*z", "z": "x*y - 8/3*z"}, {}, name="Lorenz")
LOGISTIC = saltus.Map(("x",), {"r": 4.0}, {"x": "r*x*(1 - x)"})


def interrupt_at(calls: int):
    """Return a function that raises the signal of Ctrl-C when it is called so often."""
    made = []

    def called(*_args, **_kwargs):
        made.append(1)
        if len(made) == calls:
            signal.raise_signal(signal.SIGINT)

    return called


def interrupt_motions(monkeypatch, calls: int):
    """Interrupt motions when they are looked at under way for so many times."""
    act, watch = interrupt_at(calls), EventDrivenMotion.watch

    def watched(self):
        act()
        watch(self)

    monkeypatch.setattr(EventDrivenMotion, "watch", watched)


def test_a_simulation_keeps_the_motion_so_far(monkeypatch):
    interrupt_motions(monkeypatch, 4)
    motion = saltus.simulate(LORENZ, x0=[1.0, 1.0, 20.0], t_end=1e5)
    assert motion.stopped.startswith("interrupted at t = ")
    assert 1.0 < motion.t_end < 1e5
    short = saltus.simulate(LORENZ, x0=[1.0, 1.0, 20.0], t_end=1.0)
    np.testing.assert_array_equal(motion(0.5), short(0.5))
    np.testing.assert_array_equal(motion(motion.t_end), motion.x_end)


def test_exponents_keep_the_stretches_so_far(monkeypatch, tmp_path):
    interrupt_motions(monkeypatch, 100)
    found = saltus.lyapunov_spectrum(LORENZ, x0=[1.0, 1.0, 20.0], average=saltus.Average(t_end=50_000.0, discard=10.0))
    assert found.stopped == f"interrupted: {found.times.size} stretches done"
    assert 2 <= found.times.size < 500
    assert found.stopped in repr(found)
    assert abs(found.sum + 41 / 3) < 1e-3  # the divergence
    found.save(tmp_path / "found.nc")
    assert saltus.load(tmp_path / "found.nc").stopped == found.stopped


def test_exponents_of_a_map_keep_the_stretches_so_far(monkeypatch):
    act, growth = interrupt_at(3), steps.growth
    monkeypatch.setattr(steps, "growth", lambda *args: (act(), growth(*args))[1])
    periods = 500 * 1000 * 10
    found = saltus.lyapunov_spectrum(LOGISTIC, x0=[0.3], average=saltus.Average(periods=periods, discard=0))
    assert found.stopped == f"interrupted: {found.times.size} stretches done"
    assert found.exponents[0] == pytest.approx(np.log(2.0), abs=5 * found.errors[0])


def test_an_interrupt_before_anything_is_done_is_raised(monkeypatch):
    interrupt_motions(monkeypatch, 1)
    with pytest.raises(KeyboardInterrupt):
        saltus.lyapunov_spectrum(LORENZ, x0=[1.0, 1.0, 20.0], average=saltus.Average(t_end=1e6))


def test_a_diagram_keeps_its_branches():
    brusselator = saltus.HybridSystem.smooth({"x": "1 - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}, {"B": 1.5})
    found = saltus.diagram(brusselator, "B", (1.0, 3.0), x0=[1.0, 1.5], progress=interrupt_at(40))
    assert found.stopped == "interrupted"
    assert len(found) > 0


@pytest.mark.parametrize("calls", [3, 70])
def test_a_distance_curve_keeps_its_sheets_and_tells_that_some_may_be_missing(calls):
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=20.0)
    curve = afm.distance_curve(system, (5.0, 14.0), progress=interrupt_at(calls))
    assert repr(curve).count("interrupted: sheets may be missing") == 1
    with pytest.warns(RuntimeWarning, match="interrupted"):
        curve.at(Zc_nm=float(curve.branches[0].values[0]))


def test_the_second_interrupt_is_raised():
    with interrupt_noted() as noted:
        signal.raise_signal(signal.SIGINT)
        assert len(noted) == 1
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler

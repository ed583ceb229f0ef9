"""What a user writes; a line that ends in ``# wrong`` is one that a type checker must refuse."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import saltus
from saltus import HybridSystem, Mode, StepControl, Transition, afm

ball = HybridSystem(
    states=("z", "v"),
    parameters={"g": 1.0, "e": 0.5, "A": 0.1, "w": 1.0},
    modes={"flight": Mode({"z": "v", "v": "-g"})},
    transitions=[Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="impact")],
    phase=("theta", "w"),
)
motion: saltus.results.Trajectory = saltus.simulate(ball, {"e": 0.7}, x0=[1.0, 0.0], t_end=10.0)
heights: NDArray[np.float64] = motion(np.linspace(0.0, 10.0, 101))[:, 0]
orbit: saltus.results.PeriodicOrbit = saltus.find_orbit(ball, {"e": 0.7}, x0=[1.0, 0.0])
period: float = orbit.period
branch: saltus.results.Branch = saltus.continue_orbit(orbit, "A", (0.05, 0.5), steps=StepControl(largest=0.01))
options = saltus.options.BranchOptions(StepControl(at_grazing="pass"), events={"max_z": 1.2}, stop_at=("PD", "max_z"))
family: saltus.results.Family = saltus.continue_family(orbit, "A", {"e": [0.6, 0.7]}, (0.05, 0.5), options=options)
doubled: saltus.results.PeriodicOrbit = saltus.switch_branch(branch["PD1"], to=saltus.results.PeriodicOrbit)
signatures: list[saltus.results.PeriodicOrbit] = saltus.grazing_orbits(branch["GR1"])
cascade: saltus.results.Cascade = saltus.follow_cascade(branch["PD1"], (0.05, 0.5), progress=True)
saltus.continue_orbit(orbit, "A", (0.05, 0.5), progress=lambda progress: print(progress.done, progress.text))
locus: saltus.results.Locus = saltus.continue_locus(branch["SN1"], ("A", "e"), {"A": (0.0, 1.0), "e": (0.0, 1.0)})
swept = saltus.options.SweepOptions(discard=300, section="impact")
optimum: saltus.results.Optimum = saltus.optimise(
    branch, maximise="max(v)", vary={"A": (None, None)}, subject_to={"stable": True}
)
active: dict[str, float] = optimum.active
sweep: saltus.results.Sweep = saltus.run_sweep(
    ball, "A", np.linspace(0.1, 0.2, 11), x0=[1.0, 0.0], options=swept, progress=lambda told: print(told.left)
)
spectrum = saltus.lyapunov_spectrum(ball, None, [1.0, 0.0], average=saltus.Average(periods=100))
rest = saltus.find_equilibrium(ball, x0=[1.0, 0.0], mode="flight")
eigenvalues: NDArray[np.complex128] = rest.eigenvalues
rests: saltus.results.EquilibriumBranch = saltus.continue_equilibrium(rest, "g", (0.5, 2.0), stop_at="HB")
born: saltus.results.PeriodicOrbit = saltus.switch_branch(rests["HB1"], to=saltus.results.PeriodicOrbit)
back: saltus.results.PeriodicOrbit | saltus.results.Equilibrium = saltus.switch_branch(branch["HB1"])
criticality: str = rests["HB1"].normal_form.criticality
folds: saltus.results.EquilibriumLocus = saltus.continue_locus(
    rests["SN1"], ("g", "e"), {"g": (0.0, 1.0), "e": (0.0, 1.0)}
)
tolerance: tuple[float, float] = spectrum.tolerance
attractors: saltus.results.Attractors = saltus.find_attractors(ball, region={"z": (0.0, 2.0), "v": (-1.0, 1.0)})
basins: saltus.results.Basins = saltus.map_basins(ball, None, {"z": (0.0, 2.0, 100), "v": (-1.0, 1.0, 100)})
henon = saltus.Map(("x", "y"), {"a": 1.4, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"})
tent = saltus.Map(("x",), {}, pieces={"l": saltus.Piece({"x": "x"}, "-x"), "r": saltus.Piece({"x": "-x"}, "x")})
iterates: saltus.results.Iterates = saltus.iterate(henon, {"a": 1.3}, [0.1, 0.1], n=100, discard=10)
pieces: tuple[str, ...] = iterates.itinerary
diagram: saltus.results.Sweep = saltus.run_sweep(henon, "a", [1.0, 1.2], x0=[0.1, 0.1])
of_map: saltus.results.Basins = saltus.map_basins(henon, None, {"x": (-2.0, 2.0, 10), "y": (-2.0, 2.0, 10)})
setup: afm.Setup = afm.table1()
tapping: HybridSystem = afm.tapping_mode(setup, modes=2)
probe = afm.Probe(k_N_m=(2.0, 78.5), f0_kHz=(70.0, 438.7), Q=(150.0, 450.0), R_nm=10.0)
law: afm.Law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
drive = afm.Drive(10.0) + afm.Drive(1.0, mode=2, ratio="19/3")
model: HybridSystem = afm.model(probe, law, drive, Zc_nm=8.5, f_kHz="peak")
amplitude: float = afm.observables(saltus.find_orbit(model, x0=[0.0] * 4))["amplitude_nm"]

try:
    saltus.load("orbit.nc").plot()
except saltus.SaltusError as error:
    print(error)

saltus.run_sweep(ball, "A", [0.1], discard=300)  # wrong
saltus.run_sweep(ball, "A", [0.1], progress="bar")  # wrong
saltus.simulate(ball, x0=[1.0, 0.0], t_end=1.0, options=saltus.options.SimulationOptions(time=1.0))  # wrong
saltus.find_orbits(ball)  # wrong
saltus.iterate(ball, x0=[1.0, 0.0])  # wrong
saltus.simulate(henon, x0=[0.1, 0.1], t_end=1.0)  # wrong
saltus.simulate(ball, x0=[1.0, 0.0], t_end="long")  # wrong
saltus.simulate(ball, x0=[1.0, 0.0], until=10.0)  # wrong
saltus.find_orbit("ball", x0=[1.0, 0.0])  # wrong
saltus.continue_orbit(orbit, 3, (0.0, 1.0))  # wrong
saltus.continue_orbit(orbit, "A", (0.0, 1.0), steps=0.01)  # wrong
saltus.continue_orbit(orbit, "A", (0.0, 1.0), at_grazing="pass")  # wrong
saltus.continue_family(orbit, "A", {"e": [0.6]}, (0.05, 0.5), progress="bar")  # wrong
saltus.optimise(branch, maximise=3, vary={"A": (None, None)})  # wrong
text: str = orbit.period  # wrong
found = orbit.multiplier  # wrong
saltus.find_equilibrium(ball, start=[1.0, 0.0])  # wrong
saltus.continue_equilibrium(orbit, "g", (0.5, 2.0))  # wrong
saltus.continue_equilibrium(rest, "g", 2.0)  # wrong
afm.tapping_mode(setup, number=2)  # wrong
afm.table2()  # wrong
afm.model(probe, law, Zc_nm=8.5)  # wrong
afm.VanDerWaals(H=0.1, a0_nm=0.3)  # wrong
afm.Probe(k=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0)  # wrong
probe + law  # wrong

"""The simplest walker: two legs without knees go down a slope, and begin to limp.

A mass at the hip and light feet, by the equations of Garcia, Chatterjee, Ruina and Coleman (J. Biomech. Eng. 120
(1998) 281). The stance leg is at theta from the slope's normal, the swing leg at phi from the stance leg. A step ends
where phi = 2 theta; the legs then change places. The start for the slope 0.009 is known to 15 digits from the code
that goes with the paper. Gaits are stable up to a slope of 0.015 in the paper, where a period doubling begins a limp.

Field: Walking and standing.

    python simplest_walker.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

walker = saltus.HybridSystem(
    states=("theta", "phi", "theta1", "phi1"),
    parameters={"gamma": 0.009},
    modes={
        "stance": saltus.Mode(
            {
                "theta": "theta1",
                "phi": "phi1",
                "theta1": "sin(theta - gamma)",
                "phi1": "sin(theta - gamma) + theta1**2*sin(phi) - cos(theta - gamma)*sin(phi)",
            }
        )
    },
    transitions=[
        saltus.Transition(
            "stance",
            "stance",
            event="phi - 2*theta",
            direction=1,  # where the legs pass each other in the middle of a step it falls
            reset={
                "theta": "-theta",
                "phi": "-2*theta",
                "theta1": "cos(2*theta)*theta1",
                "phi1": "cos(2*theta)*(1 - cos(2*theta))*theta1",
            },
            name="step",
        )
    ],
    name="simplest walker",
)
known = np.array([0.200310900544287, 0.400621801088574, -0.199832473004977, -0.015822999948318])

orbit = saltus.solve_orbit(walker, {}, [("stance", "step", known, 3.88)])
print(f"start of a step, difference {np.max(np.abs(orbit.states[0] - known)):.1e}")
assert np.max(np.abs(orbit.states[0] - known)) < 1e-9
branch = saltus.continue_orbit(orbit, "gamma", bounds=(0.002, 0.03))
limp = branch["PD1"]
print(f"period doubling at a slope of {limp.parameters['gamma']:.6f}, printed 0.015")
assert abs(limp.parameters["gamma"] - 0.015) < 5e-4
limping = saltus.continue_orbit(saltus.switch_branch(limp), "gamma", bounds=(0.002, 0.019))

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
for x, name, colour in (("theta", "stance leg $\\theta$", "#0072b2"), ("phi", "swing leg $\\phi$", "#d55e00")):
    sample = orbit.sample()
    left.plot(sample["t"], sample[x], color=colour, label=name)
left.set(xlabel="time (units of $\\sqrt{l/g}$)", ylabel="angle", title="one step at a slope of 0.009")
left.legend()
branch.plot("gamma", "max_theta", ax=right, legend=False)
limping.plot("gamma", "max_theta", ax=right, legend=False)
right.set(xlabel="slope $\\gamma$", ylabel="greatest angle of the stance leg", title="gaits, and the limp at PD1")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "simplest_walker.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)

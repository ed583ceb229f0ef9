"""Orbits, branches and loci of a Filippov system against those of a hybrid system with as many segments.

Both are a driven oscillator with dry friction on a belt, whose orbit slips to either side and sticks. The hybrid system
is written by hand: its sticking mode holds the velocity, and no transition has a condition.
"""

from __future__ import annotations

from measure import interleaved, machine, show

import saltus
from saltus import Mode, Transition


def filippov() -> saltus.HybridSystem:
    """Return the belt from its two fields and the surface."""
    return saltus.filippov(
        ("x", "v"), {"F": 0.4, "u": 0.3, "w": 0.6}, surface="v - u", above={"x": "v", "v": "cos(theta) - x - F"},
        below={"x": "v", "v": "cos(theta) - x + F"}, phase=("theta", "w"),
    )  # fmt: skip


def by_hand() -> saltus.HybridSystem:
    """Return the belt as a hybrid system of three modes, with the transitions of its orbit alone."""
    modes = {
        "above": Mode({"x": "v", "v": "cos(theta) - x - F"}),
        "below": Mode({"x": "v", "v": "cos(theta) - x + F"}),
        "stick": Mode({"x": "v", "v": "0"}),
    }
    transitions = [
        Transition("below", "above", "v - u", 1), Transition("above", "stick", "v - u", -1),
        Transition("stick", "below", "F - x + cos(theta)", -1),
    ]  # fmt: skip
    parameters = {"F": 0.4, "u": 0.3, "w": 0.6}
    return saltus.HybridSystem(("x", "v"), parameters, modes, transitions, phase=("theta", "w"))


def main() -> None:
    """Print the tables."""
    print(machine())
    made = {"Filippov": filippov(), "by hand": by_hand()}
    orbits = {name: saltus.find_orbit(system, {}, [1.0, 0.0]) for name, system in made.items()}
    segments = {name: len(orbit.segments) for name, orbit in orbits.items()}
    steps = saltus.StepControl(initial=0.02, largest=0.02)

    def branch(name: str) -> saltus.results.Branch:
        return saltus.continue_orbit(orbits[name], "w", (0.53, 0.62), steps=steps)

    counts = {name: len(branch(name)) for name in made}
    notes = {name: f"{segments[name]} segments, {counts[name]} points" for name in made}
    solved = {name: (lambda system=system: saltus.find_orbit(system, {}, [1.0, 0.0])) for name, system in made.items()}
    show("an orbit from a simulation", interleaved(solved, 9), {}, notes)
    seconds = interleaved({name: (lambda name=name: branch(name)) for name in made}, 9)
    per = {name: [value / counts[name] for value in values] for name, values in seconds.items()}
    show("a point of a branch", per, {}, notes)
    print(f"  Filippov over by hand: {min(per['Filippov']) / min(per['by hand']):.2f}")
    loci()


def loci() -> None:
    """Time the points of loci of grazing: of sliding orbits, and of an impact oscillator."""
    belt = saltus.continue_orbit(saltus.find_orbit(filippov(), {}, [1.0, 0.0]), "w", (0.49, 0.66))
    impact = saltus.HybridSystem(
        ("x", "v"), {"c": 0.1, "d": 1.0, "e": 0.8, "w": 0.7, "A": 0.4},
        {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - x"})},
        [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")], phase=("s", "w"),
    )  # fmt: skip
    graze = saltus.continue_orbit(saltus.find_orbit(impact, {}, [0.0, 0.0]), "A", (0.4, 0.52), stop_at="GR")
    steps = saltus.StepControl(initial=0.01, largest=0.01)
    window = {"w": (0.45, 0.7), "F": (0.3, 0.5)}
    works = {
        "GS": lambda: saltus.continue_locus(belt["GS1"], ("w", "F"), window, steps=steps),
        "CS": lambda: saltus.continue_locus(belt["CS1"], ("w", "F"), window, steps=steps),
        "GR, one segment": lambda: saltus.continue_locus(
            graze["GR1"], ("w", "A"), {"w": (0.6, 0.8), "A": (0.2, 0.8)}, steps=steps
        ),
    }
    counts = {name: len(work()) for name, work in works.items()}
    segments = {"GS": len(belt["GS1"].orbit.segments), "CS": len(belt["CS1"].orbit.segments), "GR, one segment": 1}
    per = {
        name: [value / counts[name] / (segments[name] + 1) for value in values]
        for name, values in interleaved(works, 5).items()
    }
    show("a point of a locus, over its segments", per, {}, {name: f"{counts[name]} points" for name in works})


if __name__ == "__main__":
    main()

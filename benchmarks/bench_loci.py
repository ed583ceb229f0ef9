"""Loci in two parameters, and the computation of the figures that have them."""

from __future__ import annotations

from measure import interleaved, machine, show

import saltus
from saltus.afm.paper.figures import fig3, runner

AUTO = 0.6
"""Seconds, on another day, of AUTO-07p for 200 points of a fold locus (0.6 to 0.9); it sought no further points."""

WINDOW = {"Omega": (0.5, 1.6), "ybar": (0.02, 0.2)}


def main() -> None:
    """Print the tables."""
    print(machine())
    loci()
    figures()


def loci() -> None:
    """Time loci with small steps, in units of 200 points."""
    branch = fig3.compute()
    steps = saltus.StepControl(initial=0.008, largest=0.008)

    def locus(label: str, **options: saltus.StepControl) -> saltus.results.Locus:
        return saltus.continue_locus(branch[label], ("Omega", "ybar"), WINDOW, **options)

    works = {
        "SN1 locus, small steps": lambda: locus("SN1", steps=steps),
        "SN4 locus, small steps": lambda: locus("SN4", steps=steps),
        "PD1 locus, with its normal forms": lambda: locus("PD1"),
        "GR1 locus": lambda: locus("GR1"),
    }
    counts = {name: len(work()) for name, work in works.items()}
    seconds = interleaved(works, 9)
    per = {name: [value / counts[name] * 200.0 for value in values] for name, values in seconds.items()}
    notes = {name: f"{counts[name]} points; seconds are those of 200" for name in works}
    show("200 points of a locus, n = 1", per, {}, notes)
    worst = min(per["SN4 locus, small steps"])
    print(f"  200 points of an SN locus against AUTO-07p's recorded {AUTO:.1f} s: {AUTO / worst:.1f} times faster")


def figures() -> None:
    """Time the computation of the figures that have loci."""
    works = {}
    for name in ("fig4", "fig5", "fig6", "fig7a"):
        module = __import__(runner(name).__module__, fromlist=["compute"])
        works[name] = lambda compute=module.compute: list(compute())
    show("computation of figures", interleaved(works, 1), {}, {})


if __name__ == "__main__":
    main()

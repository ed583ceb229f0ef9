"""Filippov systems with known answers, and a ball that comes to rest: for tests of several floors."""

from __future__ import annotations

import numpy as np

import saltus

# Dry friction on a belt, x'' + x = cos(theta) - F sgn(x' - u): values of w of the four sliding bifurcations at F = 0.4,
# u = 0.3, by closed forms in 30 digits.
CROSSING = 0.6449777687859365
GRAZING = 0.5039586191752079
SWITCHING = 0.4494622418330982
ADDING = 0.4399119912593270


def belt() -> saltus.HybridSystem:
    """Return a driven oscillator with dry friction on a moving belt."""
    return saltus.filippov(
        ("x", "v"), {"F": 0.4, "u": 0.3, "w": 0.6}, surface="v - u", above={"x": "v", "v": "cos(theta) - x - F"},
        below={"x": "v", "v": "cos(theta) - x + F"}, phase=("theta", "w"), name="belt",
    )  # fmt: skip


def planar() -> saltus.HybridSystem:
    """Return the normal form of a Hopf bifurcation above a line from below which motions rise."""
    return saltus.filippov(
        ("x", "y"), {"mu": 1.1, "c": 0.0}, surface="y + 1",
        above={"x": "x*(mu - x**2 - y**2) - y", "y": "y*(mu - x**2 - y**2) + x"}, below={"x": "c", "y": "1"},
        name="planar",
    )  # fmt: skip


def relay() -> saltus.HybridSystem:
    """Return a linear system of three states under relay control."""

    def under(u: int) -> dict[str, str]:
        return {"x": f"-(2*z + l)*x + y + {u}", "y": f"-(2*z*l + 1)*x + q + {2 * u}*s*r", "q": f"-l*x + {u}*r**2"}

    return saltus.filippov(
        ("x", "y", "q"), {"z": 0.2, "l": 0.5, "s": -0.1, "r": 0.8}, surface="x", above=under(-1), below=under(1),
        name="relay",
    )  # fmt: skip


def harvested() -> saltus.HybridSystem:
    """Return prey and predators that are harvested above a threshold."""
    fields = [{"x": "x*(1 - x) - a*x*y/(b + x)", "y": f"a*x*y/(b + x) - d*y{harvest}"} for harvest in (" - e*y", "")]
    values = {"a": 0.3556, "b": 0.33, "d": 0.0444, "e": 0.2067, "P": 1.6}
    return saltus.filippov(("x", "y"), values, surface="y - P", above=fields[0], below=fields[1], name="harvested")


def table(rest_time: float | None = None) -> saltus.HybridSystem:
    """Return a ball on a table a sin(theta), on which it comes to rest."""
    surface = "z - a*sin(th)"
    return saltus.HybridSystem(
        ("z", "v"), {"a": 1.2, "e": 0.5, "g": 1.0, "w": 1.0},
        {
            "flight": saltus.Mode({"z": "v", "v": "-g"}),
            "rest": saltus.Mode({"z": "a*w*cos(th)", "v": "-a*w**2*sin(th)"}, surface=surface),
        },
        [
            saltus.Transition(
                "flight", "flight", surface, -1, {"v": "-e*v + (1 + e)*a*w*cos(th)"}, name="impact", rests="rest",
                rest_time=rest_time,
            ),
            saltus.Transition("rest", "flight", "g - a*w**2*sin(th)", -1, name="leave"),
        ],
        phase=("th", "w"), name="table",
    )  # fmt: skip


def limit_of_sticking(w: np.ndarray) -> np.ndarray:
    """Return the friction at which a driven oscillator without a belt begins to stick.

    References
    ----------
    J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Trans. ASME 53 (1931) 107-115.
    """
    return np.asarray(w**2 / np.abs(1.0 - w**2) / np.sqrt(1.0 + w**2 * np.tan(np.pi / (2.0 * w)) ** 2))

"""A multiplier that is 0 by sliding or by contraction makes no points; cycles that shrink to a two-fold end there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.selection import guarding

import saltus

# r' = r (mu + a r^2 - b r^4), th' = w: cycles of radius r at mu = b r^4 - a r^2, touched by the line y = -h at r = h.
# They fold at r^2 = a / (2 b). A motion that meets the line slides on it, whatever the field below is like.
# A change grows by exp(2 pi / w * a^2 / (4 b)) in a turn at most; loci are not cut in pieces.
RANDOM = [
    case
    for case in np.random.default_rng(32)
    .uniform((0.5, 0.5, 0.5, -2.0, -3.0), (3.0, 3.0, 3.0, 2.0, 3.0), (24, 5))
    .tolist()
    if 2.0 * np.pi / case[2] * case[0] ** 2 / (4.0 * case[1]) < 12.0
]


def _grazing(a: float, b: float, w: float, c: float, unit: float = 1.0) -> saltus.SpecialPoint:
    square = f"((x**2 + y**2)/{unit!r}**2)"
    rate = f"(mu + {a!r}*{square} - {b!r}*{square}**2)"
    above = {"x": f"x*{rate} - {w!r}*y", "y": f"y*{rate} + {w!r}*x"}
    fold = np.sqrt(a / (2.0 * b))
    h = 1.1 * fold
    system = saltus.filippov(
        ("x", "y"),
        {"mu": b * h**4 - a * h**2, "h": h},
        surface=f"y + {unit!r}*h",
        above=above,
        below={"x": f"{c * unit!r}", "y": f"{unit!r}"},
    )
    inside = 0.98 * h
    mu = b * inside**4 - a * inside**2
    orbit = saltus.find_orbit(system, {"mu": mu}, x0=[inside * unit, 0.0])
    least = -(a**2) / (4.0 * b)
    branch = saltus.continue_orbit(orbit, "mu", (1.3 * least, 0.5 * least))
    return next(point for point in branch.special_points if point.type == "GS")


def _holds(a: float, b: float, w: float, c: float, unit: float, steps: saltus.StepControl | None) -> None:
    fold, least = np.sqrt(a / (2.0 * b)), -(a**2) / (4.0 * b)
    bounds = {"mu": (1.2 * least, -0.6 * least), "h": (0.5 * fold, 1.5 * fold)}
    locus = saltus.continue_locus(_grazing(a, b, w, c, unit), ("mu", "h"), bounds, steps=steps)
    mu, h = (np.asarray(locus.values[:, i]) for i in (0, 1))
    assert np.allclose(mu, b * h**4 - a * h**2, rtol=0.0, atol=1e-8 * abs(least))
    assert sorted(point.type for point in locus.special_points) == ["SN", "TP"]
    for point in locus.special_points:
        assert point.parameters["mu"] == pytest.approx(least, rel=1e-9)
        assert point.parameters["h"] == pytest.approx(fold, rel=1e-5)
    assert len(locus) < 120
    assert locus.audit.passed


@pytest.mark.parametrize(
    "case",
    [(2.0, 1.0, 1.0, 1.0), (2.0, 1.0, 1.0, -1.0), *(RANDOM[k][:4] for k in range(2))],
    ids=str,
)
def test_a_contraction_below_rounding_makes_no_points_of_a_grazing_locus(case: tuple[float, ...]) -> None:
    _holds(*case, 1.0, None)


@pytest.mark.parametrize("steps", [None, saltus.StepControl(largest=0.03), saltus.StepControl(deviation=1e-4)])
@pytest.mark.parametrize("case", guarding([(case,) for case in RANDOM], campaign=6), ids=str)
def test_random_grazing_loci_have_their_fold_alone(case: list[float], steps: saltus.StepControl | None) -> None:
    *system, exponent = case
    _holds(*system, 10.0 ** round(3.0 * exponent), steps)


@pytest.mark.parametrize("a", [-1.0, -0.3, -2.0])
def test_cycles_that_shrink_to_a_two_fold_end_there_by_its_name(a: float, tmp_path: Path) -> None:
    # one turn adds 2 mu - 2 a r^2 / 3 to the radius at leading order: cycles have r^2 = 3 mu / a
    system = saltus.filippov(
        ("x", "y"), {"mu": 0.02 * a}, surface="y", above={"x": "1", "y": f"-x + {a!r}*x**2"},
        below={"x": "-1", "y": "mu - x"},
    )  # fmt: skip
    orbit = saltus.find_orbit(system, x0=[-np.sqrt(0.06), 1e-3])
    branch = saltus.continue_orbit(orbit, "mu", (min(0.05 * a, -0.05), 0.1))
    assert [(point.type, point.of) for point in branch.special_points] == [("BE", "two-fold")]
    assert abs(branch.special_points[0].parameters["mu"]) < 1e-10
    assert any(told.endswith("the cycle shrinks to a two-fold") for told in branch.stopped)
    assert branch.audit.passed
    assert branch.period.min() >= 0.0
    for last in (branch.special_points[0].solution, branch.solution(-1)):
        assert saltus.load(last.save(tmp_path / "last.h5")).period == last.period  # it is rounding, of either sign
    checked = saltus.verify(branch)
    assert "shrunk to a point where no field vanishes" in str(next(row for row in checked if row.what == "orbit").found)
    assert not [row for row in checked.failures if row.what in ("of", "position by arclength") or "stopped" in row.what]

"""Special points of random polynomial fields are those of a scan by NumPy, none missed and none false.

The campaign is `benchmarks/random_fields.py`; this is a sample, and fields at which points were once lost.
"""

from __future__ import annotations

import importlib
from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import saltus
from selection import guarding

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SPREAD = ("general", "odd", "plane", "ring")


@pytest.fixture(scope="module")
def campaign():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield importlib.import_module("random_fields")


def one_of(campaign, kinds, number, seed=1):
    return next((f, start) for index, f, start in campaign.cases(number + 1, seed, kinds) if index == number)


def assert_alike(campaign, f, start, least, name):
    results = Counter()
    assert campaign.examine(f, start, results, name)
    assert results["branches"] == 3
    assert results["points said"] >= 3 * least


@pytest.mark.campaign
@pytest.mark.parametrize(
    "kind", guarding(["general", "odd", "plane", "ring", "dihedral", "alike"], "general", "dihedral", campaign=0)
)
def test_random_fields_have_the_points_of_a_scan_at_three_steps(campaign, kind):
    sizes = [(f, start) for _, f, start in campaign.cases(12, 7, (kind,)) if f.n in (3, 4)][:2]
    for f, start in sizes:
        assert_alike(campaign, f, start, 0, kind)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("number", "points"),
    [(42, 8), (85, 5), (173, 8), (195, 9)],
    ids=["beside a fold", "with a neutral saddle", "four real eigenvalues", "a narrow dip"],
)
def test_eigenvalues_that_cross_and_return_within_a_step_are_told(campaign, number, points):
    f, start = one_of(campaign, SPREAD, number)
    assert_alike(campaign, f, start, points, str(number))


@pytest.mark.campaign
@pytest.mark.parametrize("rate", [1e-9, 1e9])
@pytest.mark.parametrize("number", guarding([42, 85, 173], 42, campaign=0))
def test_the_unit_of_time_changes_no_special_point(campaign, number, rate):
    f, start = one_of(campaign, SPREAD, number)
    other = replace(f, a=rate * f.a, v={name: rate * value for name, value in f.v.items()})
    for largest in campaign.LARGEST:
        points, words = campaign.said(f, start, largest)
        assert campaign.compared(campaign.said(other, start, largest)[0], points) == ([], [])
        assert len(words) == 2


@pytest.mark.campaign
def test_five_eigenvalues_that_vanish_at_once_are_located_as_well_as_one(campaign):
    f, start = one_of(campaign, ("dihedral", "alike"), 7)
    assert max(multiplicity for _, multiplicity, _ in campaign.said(f, start, 0.1)[0]) == 5
    assert_alike(campaign, f, start, 1, "alike")


@pytest.mark.campaign
@pytest.mark.parametrize("kind", guarding(["general", "odd", "dihedral"], "dihedral", campaign=0))
def test_random_maps_have_the_points_of_a_scan_at_three_steps(campaign, kind):
    for _, f, start in campaign.cases(2, 11, (kind,), maps=True):
        assert_alike(campaign, f, start, 0, kind)


@pytest.fixture(scope="module")
def flame():
    """Eight odd modes of the Kuramoto-Sivashinsky equation; mode k is born at nu = 1/k^2."""
    field = {}
    for k in range(1, 9):
        products = [f"b{i}*b{k - i}/2" for i in range(1, k)] + [f"-b{i}*b{i + k}" for i in range(1, 9 - k)]
        field[f"b{k}"] = f"({k**2} - nu*{k**4})*b{k} - {k}/2*({' + '.join(products) or '0'})"
    return saltus.HybridSystem.smooth(field, {"nu": 1.1})


@pytest.fixture(scope="module")
def film():
    """Eight odd modes of the Kuramoto-Sivashinsky equation with a = 4/nu; mode k is born at a = 4 k^2."""
    field = {}
    for k in range(1, 9):
        pairs = "".join(f" + {k}*b{i}*b{k - i}" for i in range(1, k))
        pairs += "".join(f" - 2*{k}*b{i}*b{i + k}" for i in range(1, 9 - k))
        field[f"b{k}"] = f"(a*{k**2} - 4*{k**4})*b{k} + a*({pairs or 0})"
    return saltus.HybridSystem.smooth(field, {"a": 100.0})


@pytest.mark.campaign
@pytest.mark.parametrize("largest", [0.05, 0.15, 0.3, 0.6])
@pytest.mark.parametrize("mode", guarding([5, 6, 7, 8], 5))
def test_on_a_line_at_one_value_of_the_parameter_there_is_no_fold(film, mode, largest):
    """Modes 5 to 8 do not act on themselves: each has a line of equilibria at a = 4 k^2."""
    steps, birth = saltus.StepControl(largest=largest), 4.0 * mode**2
    rest = saltus.find_equilibrium(film, {"a": birth - 3.0}, x0=[0.0] * 8)
    trivial = saltus.continue_equilibrium(rest, "a", (birth - 5.0, birth + 5.0), steps=steps)
    (vertex,) = trivial.special_points.of_type("BP")
    line = saltus.continue_equilibrium(saltus.switch_branch(vertex), "a", (birth - 5.0, birth + 40.0), steps=steps)
    assert np.ptp(line.values) < 1e-9
    assert line.special_points.of_type("SN") == []
    assert sum(abs(point.equilibrium.state[mode - 1]) < 1e-6 for point in line.special_points.of_type("BP")) == 1


@pytest.mark.parametrize("largest", [0.1, 0.3])
def test_a_determinant_that_changes_by_many_orders_hides_no_branch_point(flame, largest):
    steps = saltus.StepControl(largest=largest)
    rest = saltus.find_equilibrium(flame, x0=[0.0] * 8)
    branch = saltus.continue_equilibrium(rest, "nu", (0.02, 1.1), steps=steps)
    born = [point.parameters["nu"] for point in branch.special_points.of_type("BP")]
    assert born == pytest.approx([1.0 / k**2 for k in range(7, 0, -1)], abs=1e-12)
    assert len(branch.special_points) == 7


@pytest.mark.campaign
@pytest.mark.parametrize("largest", [0.1, 0.3])
def test_beside_the_vertex_of_a_pitchfork_there_is_no_fold(flame, largest):
    steps = saltus.StepControl(largest=largest)
    rest = saltus.find_equilibrium(flame, x0=[0.0] * 8)
    trivial = saltus.continue_equilibrium(rest, "nu", (0.02, 1.1), steps=steps)
    fourth = saltus.continue_equilibrium(saltus.switch_branch(trivial["BP4"]), "nu", (0.02, 1.1), steps=steps)
    at_vertex = [p.type for p in fourth.special_points if abs(p.parameters["nu"] - 1.0 / 16.0) < 1e-9]
    assert at_vertex == ["BP"]
    assert fourth.special_points.of_type("SN") == []


# communities: each species' rate is its number times a linear function, so that branches are straight


@pytest.fixture(scope="module")
def communities():
    """Return communities of a number of species, each made once, all coefficients parameters."""

    @cache
    def made(n):
        texts = {
            f"x{i}": f"x{i}*(r{i} + g{i}*mu - " + " - ".join(f"a{i}_{j}*x{j}" for j in range(n)) + ")" for i in range(n)
        }
        names = [f"a{i}_{j}" for i in range(n) for j in range(n)] + [f"{c}{i}" for c in "rg" for i in range(n)]
        return saltus.HybridSystem.smooth(texts, {"mu": 0.1} | dict.fromkeys(names, 0.5))

    return made


def changes_of(a, r, g, there):
    """Return where the number of unstable eigenvalues changes along the straight branch, by 1 or by 2."""
    slopes = [np.linalg.solve(a[np.ix_(there, there)], v[there]) for v in (r, g)]

    def count(mu):
        x = np.zeros(len(r))
        x[there] = slopes[0] + mu * slopes[1]
        values = np.linalg.eigvals(np.diag(r + g * mu - a @ x) - x[:, None] * a)
        return int(np.sum(values.real > 0.0))

    def between(low, high):
        if count(low) == count(high):
            return []
        if high - low < 1e-10:
            return [(abs(count(high) - count(low)), low)]
        middle = 0.5 * (low + high)
        return between(low, middle) + between(middle, high)

    grid = np.linspace(-2.0, 2.0, 1601)
    return [change for low, high in pairwise(grid.tolist()) for change in between(low, high)]


def species(seed, i):
    """Return coefficients of a random community, and which of its species are there."""
    n, rng = 2 + i % 4, np.random.default_rng([seed, 77, 2 + i % 4, i])
    a, r, g = rng.normal(size=(n, n)), rng.normal(size=n), rng.normal(size=n)
    a[np.diag_indices(n)] = rng.uniform(0.7, 2.0, n)
    return a, r, g, np.flatnonzero(rng.random(n) < 0.6)


def branch_of(communities, a, r, g, there, largest):
    """Return the straight branch of a community, and what it tells: sorted values of mu, each with its change."""
    n, x = len(r), np.zeros(len(r))
    p = {f"a{k}_{j}": a[k, j] for k in range(n) for j in range(n)}
    p |= {f"r{k}": r[k] for k in range(n)} | {f"g{k}": g[k] for k in range(n)}
    x[there] = np.linalg.solve(a[np.ix_(there, there)], (r + 0.1 * g)[there])
    rest = saltus.find_equilibrium(communities(n), p, x)
    branch = saltus.continue_equilibrium(rest, "mu", (-2.0, 2.0), steps=saltus.StepControl(largest=largest))
    return branch, sorted((q.parameters["mu"], 2 if q.type == "HB" else 1) for q in branch.special_points)


@pytest.mark.campaign
@pytest.mark.parametrize("largest", guarding([0.1, 0.3], 0.3, campaign=0))
@pytest.mark.parametrize("seed", guarding([2, 4], 2, campaign=0))
def test_all_changes_in_communities_of_species_are_found(communities, seed, largest):
    for i in range(48):
        a, r, g, there = species(seed, i)
        if not there.size or np.linalg.cond(a[np.ix_(there, there)]) > 20.0:
            continue
        told = branch_of(communities, a, r, g, there, largest)[1]
        wanted = sorted((mu, change) for change, mu in changes_of(a, r, g, there))
        assert [change for _, change in told] == [change for _, change in wanted], (len(r), i)
        np.testing.assert_allclose([mu for mu, _ in told], [mu for mu, _ in wanted], atol=1e-8)


def test_a_species_that_passes_its_threshold_keeps_the_size_of_its_growth(communities):
    """A branch point and a Hopf point lie within 0.0003: one step of 0.3 passes both."""
    a, r, g, there = species(2, 35)
    branch, told = branch_of(communities, a, r, g, there, 0.3)
    wanted = [(mu, change) for change, mu in changes_of(a, r, g, there)]
    np.testing.assert_allclose(told, wanted, rtol=0.0, atol=1e-9)
    assert branch.audit.passed

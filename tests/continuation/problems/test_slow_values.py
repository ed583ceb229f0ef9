"""Hopf points whose frequency is far below the fastest rate: all are found, and none that is none.

The systems are made from decoupled blocks, so that rates and Hopf points are known in closed form. Fast states then
follow slow ones, slow ones feel fast ones, and each state gets a unit of its own.
"""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from tests.selection import guarding

from saltus import HybridSystem, continue_equilibrium, find_equilibrium
from saltus.equilibria.spectrum import sized_eigenvalues

# Rates as they were given for a model of a cell's receptors, with the states where they balance.
_TOTALS = [1.6563516576558746, 3.5232975392793924e8, 1.0]
_STATE = [1.6563516576558746, 0.0038843824790898043, 3.7708607296986027e-10, 0.08021161610521155]
_RATES = [2.8384448206770775e-9, 2.276606366932523e-10, 1.0000091094346868, 29473.54319518398, 0.01816749288551057,
          0.002345143593835089, 2.499174147678733e-5, 1.6010576150026472e9, 0.0005160737862267585]  # fmt: skip
_RECEPTORS = {
    "X1": "k1*(T1-X1)-k2*X1-k8*X1*X5-k9*X1*X6",
    "X4": "k4*X5-k5*X4-k6*X4+k9*X1*X6",
    "X5": "k3*(T2-X4-X5-X6)-k4*X5+k7*X6-k8*X1*X5",
    "X6": "k5*X4-k7*X6-k9*X1*X6",
}


def _receptors(slower: float) -> tuple[HybridSystem, list[float]]:
    """Return the model with its two fast rates divided by a number, and a guess of its equilibrium."""
    rates = dict(zip([f"k{i}" for i in range(1, 10)], _RATES, strict=True))
    rates["k4"], rates["k8"] = rates["k4"] / slower, rates["k8"] / slower
    totals = {"T1": sum(_TOTALS[:2]), "T2": _TOTALS[2] + sum(_STATE[1:])}
    return HybridSystem.smooth(_RECEPTORS, rates | totals), [*_STATE[:2], _STATE[2] * slower, _STATE[3]]


def _growth_of_slow_pair(equilibrium) -> float:
    """Return the real part of the complex pair over its modulus, with 50 digits."""
    A = equilibrium.problem().evaluate(equilibrium.state)[1]
    with mpmath.workdps(50):
        values = mpmath.eig(mpmath.matrix(A.tolist()), left=False, right=False)
    pair = max(values, key=lambda value: value.imag)
    return float(pair.real / abs(pair))


@pytest.mark.parametrize("slower", guarding([1.0, 1e2, 1e3, 1e4], 1.0))
def test_a_hopf_point_a_million_million_times_slower_than_the_fastest_rate_is_found(slower):
    system, guess = _receptors(slower)
    branch = continue_equilibrium(find_equilibrium(system, x0=guess), "k9", (0.0004, 0.0007))
    (point,) = branch.special_points
    assert point.type == "HB"
    assert point.multiplicity == 1
    assert abs(_growth_of_slow_pair(point.equilibrium)) < 1e-10
    stable = np.array([_growth_of_slow_pair(branch.solution(i)) < 0.0 for i in (0, len(branch) - 1)])
    assert branch.stable[[0, -1]].tolist() == stable.tolist() == [True, False]
    if slower == 1.0:
        assert point.parameters["k9"] == pytest.approx(_RATES[-1], rel=1e-10)


def _random_system(seed: int) -> tuple[HybridSystem, list[float], list[float]]:
    """Return a system whose rates span 1e-9 to 1e9, its equilibrium at p = -1, and its Hopf points in order."""
    rng = np.random.default_rng(seed)
    n, sizes = int(rng.integers(3, 9)), []
    while sum(sizes) < n:
        sizes.append(2 if n - sum(sizes) >= 2 and (rng.random() < 0.5 or 2 not in sizes) else 1)
    rates = np.sort(10.0 ** rng.uniform(-9.0, 9.0, len(sizes)))
    block = [k for k, size in enumerate(sizes) for _ in range(size)]
    own, hopf = [], []
    for size, rate in zip(sizes, rates.tolist(), strict=True):
        at = len(own)
        if size == 1:
            own.append(f"-{rate!r}*(w{at})")
            continue
        share, place = float(10.0 ** rng.uniform(-3.0, 0.0)), float(rng.uniform(-0.9, 0.9))
        turns = rng.random() < 0.8 or not hopf
        growth = f"({share!r}*(p - {place!r}))" if turns else f"(-{share!r})"
        hopf += [place] if turns else []
        own += [f"{rate!r}*({growth}*(w{at}) - (w{at + 1}))", f"{rate!r}*((w{at}) + {growth}*(w{at + 1}))"]
    units, rests = 10.0 ** rng.uniform(-9.0, 9.0, n), rng.uniform(0.5, 2.0, n)
    moves = rng.uniform(-0.3, 0.3, n)
    away = [f"(x{i}/{float(units[i])!r} - ({float(rests[i])!r} + {float(moves[i])!r}*p))" for i in range(n)]
    # every other block follows slower ones: x = w + follows x; these feel how far it is behind
    follows = [
        {
            j: round(float(rng.normal()), 3)
            for j in range(n)
            if block[i] % 2 and not block[j] % 2 and block[j] < block[i]
        }
        for i in range(n)
    ]
    behind = [f"({away[i]}" + "".join(f" - ({g!r})*{away[j]}" for j, g in follows[i].items()) + ")" for i in range(n)]
    for i in range(n):
        felt = [j for j in range(n) if not block[i] % 2 and block[j] % 2 and block[j] > block[i]]
        rate = float(rates[block[i]])
        own[i] += "".join(f" + ({round(float(rng.normal()), 3)!r})*{rate!r}*(w{j})" for j in felt)
        for j in range(n):
            own[i] = own[i].replace(f"(w{j})", behind[j])
    field = {}
    for i in range(n):
        led = "".join(f" + ({g!r})*({own[j]})" for j, g in follows[i].items())
        field[f"x{i}"] = f"{float(units[i])!r}*({own[i]}{led})"
    return HybridSystem.smooth(field, {"p": -1.0}), (units * (rests - moves)).tolist(), sorted(hopf)


@pytest.mark.parametrize("seed", guarding(range(120), 8, campaign=6))
def test_of_random_systems_with_rates_from_1e_minus_9_to_1e9_no_hopf_point_is_missed_and_none_is_false(seed):
    system, rest, hopf = _random_system(seed)
    branch = continue_equilibrium(find_equilibrium(system, x0=rest), "p", (-1.0, 1.0))
    assert [point.type for point in branch.special_points] == ["HB"] * len(hopf)
    np.testing.assert_allclose([point.parameters["p"] for point in branch.special_points], hopf, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_eigenvalues_of_all_speeds_have_the_digits_that_mpmath_gives_them(seed):
    rng = np.random.default_rng(seed)
    rates = 10.0 ** rng.uniform(-9.0, 9.0, 6)
    A = 0.3 * rng.normal(size=(6, 6)) * np.minimum(rates[:, None], rates)
    A -= np.diag(rates)
    units = 10.0 ** rng.uniform(-9.0, 9.0, 6)
    values, sizes = sized_eigenvalues(A * units / units[:, None])
    with mpmath.workdps(60):
        scaled = mpmath.matrix((A * units / units[:, None]).tolist())
        exact = sorted((complex(v) for v in mpmath.eig(scaled, left=False, right=False)), key=abs)
    order = np.argsort(np.abs(values))
    found = values[order]
    error = np.minimum(np.abs(found - exact), np.abs(found - np.conj(exact)))  # of a pair either may come first
    # decompositions have an error of some ten roundings of the values' size
    assert np.all(error < 1e-11 * sizes[order])


def test_a_conserved_quantity_is_no_slow_value_of_its_own():
    values, sizes = sized_eigenvalues(np.array([[-1.0, 3.0, 0.0], [0.7, -3.0, 2.0], [0.3, 0.0, -2.0]]))
    assert abs(values[np.argmin(np.abs(values))]) < 1e-14  # columns add to 0
    assert np.ptp(sizes) == 0.0

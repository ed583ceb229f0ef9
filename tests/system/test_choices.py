"""Largest and least values in expressions, against Python's."""

import numpy as np
import pytest
import sympy

from saltus.system.choices import Max, Min
from selection import guarding

X, Y = sympy.symbols("x y", real=True)


class Drawn:
    """A random expression, and its value by Python's own functions."""

    def __init__(self, rng, depth):
        if depth == 0 or rng.random() < 0.25:
            number = float(rng.uniform(-2, 2))
            self.text, self.at = [
                (X, lambda x, y: x), (Y, lambda x, y: y), (sympy.Float(number), lambda x, y: number),
                (X * Y - 1, lambda x, y: x * y - 1), (X - Y, lambda x, y: x - y),
            ][rng.integers(5)]  # fmt: skip
            return
        parts = [Drawn(rng, depth - 1) for _ in range(rng.integers(2, 4))]
        made, choose = [(Max, max), (Min, min)][rng.integers(2)]
        self.text = made(*(part.text for part in parts)) + X
        self.at = lambda x, y: choose(part.at(x, y) for part in parts) + x


@pytest.mark.parametrize("seed", guarding(range(60), *range(8), campaign=12))
def test_values_are_the_largest_and_the_least(seed):
    rng = np.random.default_rng(seed)
    drawn, (x, y) = Drawn(rng, 4), rng.uniform(-2, 2, 2).tolist()
    assert float(drawn.text.subs({X: x, Y: y})) == pytest.approx(drawn.at(x, y), abs=1e-12)


def test_short_arguments_are_compared_and_long_ones_are_not():
    assert Max(X, X + 1, 2 * X - X) == X + 1
    long = sum(sympy.sin(k * X) * Y**k for k in range(30))
    assert Max(long, long + 1).args == tuple(sympy.ordered({long, long + 1}))
    assert isinstance(Max(X, Y).subs(Y, long), Max)

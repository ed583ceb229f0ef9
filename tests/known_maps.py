"""Maps whose cycles and bifurcations are known in closed form."""

from __future__ import annotations

from functools import cache

from saltus import Map, Piece


@cache
def logistic():
    return Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"}, name="logistic map")


@cache
def henon():
    return Map(("x", "y"), {"a": 1.4, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"}, name="Henon map")


@cache
def cusp():
    return Map(("x",), {"r": 0.0, "h": 1.5}, {"x": "r + h*x - x**3"}, name="cusp map")


@cache
def delayed():
    return Map(("x", "y"), {"r": 1.9}, {"x": "r*x*(1 - y)", "y": "x"}, name="delayed logistic map")


@cache
def tent():
    """Normal form of a border collision on the line: slopes a and b, the border at 0."""
    return Map(
        ("x",), {"a": 0.5, "b": -0.6, "mu": -0.2},
        pieces={"left": Piece({"x": "a*x + mu"}, where="-x"), "right": Piece({"x": "b*x + mu"}, where="x")},
        name="skew tent map",
    )  # fmt: skip

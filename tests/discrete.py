"""Maps with known answers, which several tests share."""

from __future__ import annotations

from saltus import Map, Piece

LOGISTIC = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"}, name="logistic map")

HENON = Map(("x", "y"), {"a": 1.4, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"}, name="Henon map")

NEWTON = Map(
    ("x", "y"),
    {},
    {
        "x": "2*x/3 + (x**2 - y**2)/(3*(x**2 + y**2)**2)",
        "y": "2*y/3 - 2*x*y/(3*(x**2 + y**2)**2)",
    },
    name="Newton's method for a cube root",
)


def tent_of(**options):
    pieces = {"left": Piece({"x": "a*x"}, where="1/2 - x"), "right": Piece({"x": "a*(1 - x)"}, where="x - 1/2")}
    return Map(("x",), {"a": 1.8}, pieces=pieces, **({"outputs": {"double": "2*x"}, "name": "tent map"} | options))


TENT = tent_of()

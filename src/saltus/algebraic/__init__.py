"""Algebraic equations F(x, p) = 0 of equilibria and of orbits of maps: Newton's method, conditions, products."""

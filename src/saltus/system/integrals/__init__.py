"""Linear first integrals of a system: found from its formulas, and the states of given totals."""

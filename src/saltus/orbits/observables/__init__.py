"""Observables of periodic orbits by name: samples, values, exact gradients and sensitivities."""

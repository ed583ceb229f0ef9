"""Fits of models to measured data, with exact derivatives of orbits and of special points."""

from saltus.fitting.estimation import FitOptions, fit
from saltus.fitting.measured import MeasuredPoint
from saltus.fitting.result import Fit

__all__ = ["Fit", "FitOptions", "MeasuredPoint", "fit"]

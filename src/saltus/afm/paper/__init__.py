"""The dimensionless model of tapping mode, its parameters and figures."""

"""Measures of basins: integrity, erosion, stability, uncertainty, entropy, the Wada property."""

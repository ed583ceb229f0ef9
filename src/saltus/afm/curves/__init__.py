"""Distance and frequency curves, where motions coexist, and what curves tell of a sample."""

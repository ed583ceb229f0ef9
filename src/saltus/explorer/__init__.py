"""The explorer: a page in the browser that shows diagrams, orbits and basins of a system, and goes on from a click."""

"""How branches end: at equilibria, homoclinic orbits, infinity, at half the period, in themselves."""

"""Floor 2: compiled flows of hybrid systems."""

"""Laws of the force between tip and sample, as hybrid regions: docs/afm.md has their table."""

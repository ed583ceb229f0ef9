"""Laws of the force between tip and sample, as hybrid regions: docs/afm/laws.md has their table."""

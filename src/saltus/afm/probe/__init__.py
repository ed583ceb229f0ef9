"""The instrument: probe, drive, their units, the shapes of a beam."""

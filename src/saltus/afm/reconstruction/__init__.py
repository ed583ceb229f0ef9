"""The force between tip and sample from measured or computed curves, without a law of force."""

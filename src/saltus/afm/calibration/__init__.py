"""From a thermal spectrum to a calibrated cantilever."""

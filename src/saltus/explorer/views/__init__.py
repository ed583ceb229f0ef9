"""The parts of the page: what is shown and asked for in each."""

"""Many motions at once, side by side in vector lanes, by steps that are generated for a system."""

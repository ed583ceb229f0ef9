"""Pictures of curves and films of cantilevers."""

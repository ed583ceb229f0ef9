"""The hybrid system of probe, law and drives, and what is read from its motions."""

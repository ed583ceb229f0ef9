"""What knows no orbit: zero problems, steps along their curves, location of zeros of monitor functions."""

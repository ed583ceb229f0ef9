"""Whether a motion comes back: recurrences of points, closed curves, smooth courses, and the limits that judge them."""

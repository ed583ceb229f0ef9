"""Other numbers that judge."""

# Error of a multiplier near the unit circle from which on its place tells nothing: that of the circle's radius.
LIKE_ONE = 1.0

# Error of the logarithm of a product up to which the product has a digit left, by which a wrong one is seen.
UNIT_OF_GROWTH = 0.1

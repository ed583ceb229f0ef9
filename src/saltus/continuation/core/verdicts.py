"""What compiled control of steps says of a step."""

TAKEN = 0  # a step that may be taken, as `judge` tells
ANGLE = 1  # a step at which the branch turns too sharply
DEVIATION = 2  # a step whose end lies too far from the predicted point
FOLDS = 3  # a step in which the parameter turns twice

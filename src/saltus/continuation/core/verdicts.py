"""What compiled control of steps says of a step, and sizes of changes that are rounding."""

RESTS = 1e-9  # change of the parameter per unit of arclength, up to which it is rounding: the parameter rests
ROUNDED = 1e-11  # change of the parameter within a step, up to which it is rounding
CROWDED = 1e-5  # arclength of a step up to which several events may lie in it
TAKEN = 0  # a step that may be taken, as `judge` tells
ANGLE = 1  # a step at which the branch turns too sharply
DEVIATION = 2  # a step whose end lies too far from the predicted point
FOLDS = 3  # a step in which the parameter turns twice

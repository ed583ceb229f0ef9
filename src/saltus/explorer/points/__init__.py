"""Special points on the page: a table of all, a list where some coincide, labels, and steps from one to the next."""

"""Files of experiments, of instruments, and of parameter sets."""

"""Selection of structures from candidate libraries: offsets, many inputs, bounds on the error."""

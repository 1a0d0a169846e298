"""Selection of columns from inner products: one after the other, and of the best subset."""

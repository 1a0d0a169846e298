"""Programs of extended simulations in C99."""

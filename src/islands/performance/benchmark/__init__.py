"""How fast the search is: ours beside plain numpy and compiled C, in one run and on the same data."""

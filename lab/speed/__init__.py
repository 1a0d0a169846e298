"""Speed measurements of the kernels against plain numpy and compiled C. Read `run` first."""

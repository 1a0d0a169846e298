"""Where regressors meet kernels: expressions are linked to the flat programs that the kernels run."""

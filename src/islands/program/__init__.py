"""Translation of expressions to the flat programs that the kernels execute. Read `term_pool` first."""

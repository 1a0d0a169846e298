"""Programs of extended simulations that are differential equations. Read `extended_system` first.

`collect_equations` turns a document into equations with effects; `c_equations` and
`matlab_equations` write them as programs.
"""

"""Programs of extended simulations that are differential equations. Read `extended_system` first.

`collect_equations` turns a document into equations with effects. `EquationProgram` in `program` writes them;
`c` and `matlab` have the syntax of a language, its functions, and what only it requires.
"""

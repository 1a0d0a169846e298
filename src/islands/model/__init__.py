"""Expressions, regressors and NARX models, and their text (plain, LaTeX, MathML).

Read `expression` first, then `regressor` and `model`.
"""

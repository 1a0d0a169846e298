"""Regressors and NARX models, and their equations as text, LaTeX and MathML.

Read `regressor` first, then `narx`.
"""

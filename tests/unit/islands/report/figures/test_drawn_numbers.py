"""Numbers of a figure as a table."""

import csv
import io

import numpy as np

from islands.records.dataset import Dataset
from islands.report.figures.drawn_numbers import tabulate_lines
from islands.report.figures.free_run import draw_free_run
from islands.report.figures.residuals import draw_residual_correlations
from islands.validation.residual_tests import residual_tests


def read(figure):
    return list(csv.DictReader(io.StringIO(tabulate_lines(figure))))


def test_table_has_the_points_of_every_line_and_a_gap_without_a_value():
    u = np.arange(4.0)
    y = np.array([1.0, 2.0, np.nan, 4.0])
    rows = read(draw_free_run(Dataset(u, y, 0.5, ("u_V",), "y_um", ("V",), "um"), np.array([1.0, 2, 3, 3.5])))
    found = {}
    for row in rows:
        found.setdefault((row["panel"], row["line"]), []).append((row["x"], row["y"]))
    above, below = "1: y (um) over time (s)", "2: residual (um) over time (s)"
    assert found == {
        (above, "measured"): [("0", "1"), ("0.5", "2"), ("1", ""), ("1.5", "4")],
        (above, "simulated"): [("0", "1"), ("0.5", "2"), ("1", "3"), ("1.5", "3.5")],
        (below, "residual"): [("0", "0"), ("0.5", "0"), ("1", ""), ("1.5", "0.5")],
    }


def test_vertical_lines_are_rows_with_their_ends():
    rng = np.random.default_rng(0)
    tests = residual_tests(rng.standard_normal(200), rng.standard_normal((200, 1)))
    rows = read(draw_residual_correlations(tests))
    drawn = [float(row["y"]) for row in rows if row["panel"].startswith("1: ")]
    assert np.allclose(drawn, tests.tests[0].values, rtol=1e-6, atol=1e-12)
    assert {row["line"] for row in rows} == {"correlation"}

"""Scalings: lines, ordered points, and labelled figures."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands_measurements.speed import kernel_evaluator, scaling
from islands_measurements.speed.full_runs import Run
from islands_measurements.speed.scaling import (
    Scaling,
    against_islands,
    draw_scaling,
    line_through,
    save_scalings,
)
from islands_measurements.speed.workload import benchmark_record

numbers = st.floats(-100.0, 100.0)


@given(intercept=numbers, slope=st.floats(0.1, 100.0))
def test_line_through_collinear_points_is_exact(intercept, slope):
    found = line_through(tuple((x, intercept + slope * x) for x in (1.0, 2.0, 5.0, 9.0)))
    assert found.slope == pytest.approx(slope, rel=1e-9)
    assert found.intercept == pytest.approx(intercept, abs=1e-9 * (100.0 + abs(intercept)))
    assert found.r2 == pytest.approx(1.0, abs=1e-9)


def test_line_has_the_expected_r2():
    # y = x**2 on 0, 1, 2: the line 2 x - 1/3 leaves 2/3 of 26/3.
    found = line_through(((0.0, 0.0), (1.0, 1.0), (2.0, 4.0)))
    assert found.slope == pytest.approx(2.0)
    assert found.intercept == pytest.approx(-1 / 3)
    assert found.r2 == pytest.approx(1 - (2 / 3) / (26 / 3))


def test_constant_cost_is_a_line():
    assert line_through(((1.0, 3.0), (2.0, 3.0), (5.0, 3.0))).r2 == 1.0


@pytest.fixture(scope="module")
def piezo():
    return benchmark_record(2_000)


def test_every_cost_is_measured_at_every_point(piezo, monkeypatch):
    monkeypatch.setattr(scaling, "TERMS", (2, 4))
    monkeypatch.setattr(scaling, "HEIGHTS", (1, 2))
    state, fractions = kernel_evaluator.prepare_record(piezo), []
    found = [
        scaling.against_samples(piezo, 1, fractions.append),
        scaling.against_terms(state, 1, fractions.append),
        scaling.against_tree_size(state, 1, fractions.append),
    ]
    assert fractions == [0.5, 1.0] * 3
    assert [each.name for each in found] == ["samples", "terms", "tree_size"]
    for each in found:
        assert set(each.curves) == {"nothing cached", "inner products cached"}
        assert "ms" in each.y_label
        for points in each.curves.values():
            assert all(cost > 0.0 for _, cost in points)
            assert all(one[0] < other[0] for one, other in itertools.pairwise(points))
    assert [x for x, _ in found[0].curves["nothing cached"]] == [1_000.0, 2_000.0]
    assert [x for x, _ in found[1].curves["nothing cached"]] == [2.0, 4.0]
    # Ten terms of trees of height 1 have three nodes each, y(k-1) one.
    assert found[2].curves["nothing cached"][0][0] == pytest.approx(28.0, abs=3.0)


def run(evaluations, wall_s):
    return Run(evaluations, 0, 1.0, wall_s, 0.5, {})


def test_individuals_per_second_of_islands_are_added():
    found = against_islands({2: (run(100, 2.0), run(100, 4.0)), 1: (run(100, 1.0),)})
    assert found.curves == {"all islands together": ((1.0, 100.0), (2.0, 75.0))}


EXAMPLES = {
    "curved": Scaling(
        "samples",
        "samples of the record",
        "CPU time of an evaluation (ms)",
        {
            "nothing cached": ((1e3, 0.1), (1e4, 0.5), (1e5, 7.0)),
            "inner products cached": ((1e3, 0.1), (1e4, 0.2), (1e5, 1.1)),
        },
    ),
    "two points": against_islands({2: (run(100, 2.0), run(100, 4.0)), 1: (run(100, 1.0),)}),
}


@pytest.fixture(params=EXAMPLES, scope="module")
def example(request):
    return EXAMPLES[request.param]


def test_figure_shows_points_line_and_units(example):
    (axes,) = draw_scaling(example).axes
    assert axes.get_xlabel() == example.x_label
    assert axes.get_ylabel() == example.y_label
    for position, (name, points) in enumerate(example.curves.items()):
        dots, line = axes.lines[2 * position : 2 * position + 2]
        assert dots.get_xydata().tolist() == [list(point) for point in points]
        assert dots.get_label().startswith(name)
        assert ("R²" in dots.get_label()) == (len(points) > 2)
        fitted = line_through(points)
        x, y = line.get_xydata().T
        assert x.tolist() == [points[0][0], points[-1][0]]
        assert np.allclose(y, fitted.intercept + fitted.slope * x)
    assert axes.get_xlim()[0] == axes.get_ylim()[0] == 0.0


@pytest.mark.ci
def test_figures_are_files_named_after_the_scaling(tmp_path):
    written = save_scalings(EXAMPLES.values(), tmp_path / "new" / "folder")
    assert [path.name for path in written] == ["samples.svg", "islands.svg"]
    for path in written:
        assert path.read_text(encoding="utf-8").count("<svg ") == 1
    first = [path.read_bytes() for path in written]
    assert first == [path.read_bytes() for path in save_scalings(EXAMPLES.values(), tmp_path)]

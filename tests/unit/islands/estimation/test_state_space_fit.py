"""Fit of a state space: the least error of the free run, with initial states of every segment."""

from itertools import pairwise

import numpy as np
import pytest

from islands.estimation.constraints.state_space import find_conditions
from islands.estimation.state_space_fit import StateSpaceFit
from islands.simulation.initial_states import Segment
from islands.simulation.segment_lanes import SegmentLanes
from support.latent_systems import make_model, spring_record

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

MODEL = make_model()


def cut(record, *rows):
    bounds = [0, *rows, record.samples]
    return SegmentLanes(Segment(record.u[a:b].copy(), record.y[a:b].copy()) for a, b in pairwise(bounds))


def begin(segments, theta=MODEL.theta, free=None):
    known = MODEL.theta != 0.0 if free is None else free
    places = np.where(known, np.cumsum(known) - 1, -1)
    return StateSpaceFit(theta.copy(), places, MODEL.codes, segments, np.zeros((len(segments), 2)))


def test_the_parameters_of_a_record_without_noise_are_found():
    start = MODEL.theta * np.where(MODEL.theta != 0.0, 1.0 + 0.05 * np.cos(np.arange(MODEL.theta.size)), 1.0)
    fit = begin(cut(spring_record(600)), start)
    fit.advance(60)
    assert fit.mean_square < 1e-12
    assert fit.states[0][0] == pytest.approx(
        0.5 * 1.2 / fit.theta[6], rel=1e-3
    )  # up to the scale of the states


def test_the_error_of_noise_is_reached_and_falls_with_each_step():
    record = spring_record(2000, noise=0.05)
    fit = begin(cut(record, 1000), 0.9 * MODEL.theta)
    errors = [fit.mean_square]
    for _ in range(20):
        fit.advance(1)
        errors.append(fit.mean_square)
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] == pytest.approx(0.05**2, rel=0.1)


def test_missing_outputs_have_no_influence():
    record = spring_record(600)
    (whole,), (holes,) = cut(record), cut(record)
    holes.y[100:140] = np.nan
    fits = [begin(SegmentLanes([each])) for each in (whole, holes)]
    for fit in fits:
        fit.advance(30)
        assert fit.mean_square < 1e-10
    whole.y[100:140] = 50.0
    assert begin(SegmentLanes([whole])).mean_square > 1.0


def test_fixed_parameters_do_not_move():
    free = np.zeros(MODEL.theta.size, bool)
    free[-1] = True
    fit = begin(cut(spring_record(600)), MODEL.theta + 0.1 * free, free)
    fit.advance(10)
    assert (fit.theta[:-1] == MODEL.theta[:-1]).all()
    assert fit.theta[-1] == pytest.approx(0.3, abs=1e-6)


def begin_under(text, segments, theta=MODEL.theta, free=None):
    known = MODEL.theta != 0.0 if free is None else free
    places = np.where(known, np.cumsum(known) - 1, -1)
    start = np.zeros((len(segments), 2))
    return StateSpaceFit(theta.copy(), places, MODEL.codes, segments, start, find_conditions(text, 1))


@pytest.mark.parametrize("text", ["gain = 0.5", "fixed-point = 1, 0.7; gain = 0.45 at 1, 0.7"])
def test_conditions_are_met_after_every_step(text):
    fit = begin_under(text, cut(spring_record(600, noise=0.02), 300))
    assert not fit.meets_conditions
    assert fit.mean_square == np.inf
    errors = []
    for _ in range(15):
        fit.advance(1)
        assert fit.meets_conditions
        errors.append(fit.mean_square)
    assert errors == sorted(errors, reverse=True)


def test_no_admissible_change_reduces_the_error_after_the_last_step():
    fit = begin_under("gain = 0.5", cut(spring_record(600, noise=0.02)))
    fit.advance(100)
    least, free, rng = fit.mean_square, MODEL.theta != 0.0, np.random.default_rng(0)
    for _ in range(20):
        moved = fit.theta.copy()
        moved[free] *= 1.0 + 0.01 * rng.standard_normal(np.count_nonzero(free))
        squares = fit.theta[free, None] ** 2
        theta = fit.conditions.correct(
            fit.system.with_theta(moved), free, lambda each, by=squares: by * each
        )[0].theta
        other = StateSpaceFit(theta, fit.places, fit.codes, fit.segments, fit.states, fit.conditions)
        assert other.mean_square > least

"""Whether a linear model explains a record: noise of any colour does not count, a curve does."""

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.records.dataset import Dataset
from islands.validation.linearity import check_linearity
from support.latent_systems import spring_record


def make_record(seed, curve=0.0, poles=(1.0,), delay=3, samples=400):
    """Return a record of a first-order lag behind a curve, with a dead time and noise of given poles."""
    random = np.random.default_rng(seed)
    u = np.repeat(random.standard_normal(samples // 10), 10)
    moved = np.concatenate([np.full(delay, u[0]), u])[:samples]
    y = lfilter([0.0, 0.1], [1.0, -0.9], moved + curve * moved**2)
    noise = lfilter([0.03], poles, random.standard_normal(samples))
    return Dataset(u, y + noise, 0.1, ("u_V",), "T_K", output_unit="K")


@pytest.mark.parametrize(("poles", "finding"), [((1.0,), "linear_within"), ((1.0, -0.9), "linear_disturbed")])
def test_a_linear_process_is_linear_with_noise_of_any_colour(poles, finding):
    fact = check_linearity(make_record(0, poles=poles))
    assert (fact.value, fact.finding) == (True, finding)
    assert "A linear model of order 1 with a dead time of 0.3 s from u_V explains T_K" in fact.sentence


def test_a_curve_is_found_although_the_noise_model_describes_its_effect():
    fact = check_linearity(make_record(0, curve=0.2))
    assert fact.value is False
    assert "depends on the amplitude of u_V (p < 1e-06): expect a curve" in fact.sentence


@pytest.mark.ci
def test_a_spring_that_stiffens_is_not_linear():
    # A cubic spring in the feedback: the squares of the residual and of the output depend on each other.
    assert check_linearity(spring_record(600, noise=0.02)).value is False


@pytest.mark.nightly
def test_linear_processes_are_rarely_taken_for_others():
    found = [check_linearity(make_record(seed, poles=(1.0, -0.8))).value for seed in range(40)]
    assert sum(not each for each in found) <= 1


@pytest.mark.parametrize(
    ("u", "y", "text"),
    [
        (np.zeros(50), np.arange(50.0), "A signal is constant: the record shows no linear model of y."),
        (np.arange(6.0), np.arange(6.0) ** 2, "is not computed: a linear identification needs at least 10"),
    ],
)
def test_a_record_without_a_linear_model_has_the_reason(u, y, text):
    fact = check_linearity(Dataset(u, y, 1.0))
    assert fact.value is None
    assert text in fact.sentence

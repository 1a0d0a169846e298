"""Direct feedthrough: inputs to which the output responds within the sample are read at sample k."""

import re

import numpy as np
import pytest
from scipy.signal import butter, lfilter

import islands
from islands.errors import SettingsError
from islands.estimation.structure_selection.direct_feedthrough import find_direct_inputs
from islands.facade.trials.feedthrough_selection import select_feedthrough
from islands.facade.trials.rate_selection import TrialLibrary
from islands.records.dataset import Dataset, join
from islands.records.split import split

LIBRARY = {"library": "polynomial", "degree": 1, "max_terms": 5, "average": 1}
TRIAL = TrialLibrary("polynomial", 1, 3, "none")


def white(seed, samples=2000):
    return np.random.default_rng(seed).normal(size=samples)


def smooth(seed, samples=2000):
    return lfilter(*butter(3, 0.1), white(seed, samples + 200))[200:]


def lag(u, delay, noise=0.0):
    """Return a first-order lag of an input with some delay in samples."""
    y = lfilter([0.0] * delay + [0.3], [1.0, -0.7], u)
    return Dataset(u, y + noise * np.std(y) * white(9, len(u)), 1.0, ("u_V",), "y_um")


def first_order_hold(u):
    """Return the exact response of a first-order lag to an input that is linear between samples."""
    pole = np.exp(-0.1)
    slope = 1.0 - (1.0 - pole) / 0.1
    return Dataset(u, lfilter([slope, 1.0 - pole - slope], [1.0, -pole], u), 1.0)


def cubic(u, delay=0):
    return Dataset(u, np.roll(u + 0.3 * u**3 + 0.2 * u**2, delay), 1.0)


@pytest.mark.parametrize(
    "record",
    [
        lag(white(0), 0),
        lag(white(0), 0, noise=0.1),
        lag(smooth(0), 0),
        cubic(white(1)),
        cubic(white(1) ** 2),
        first_order_hold(white(2)),
        first_order_hold(smooth(2)),
        join((lag(white(0), 0), lag(white(1), 0))),
        Dataset(1e5 + 1e-3 * white(0), lag(white(0), 0).y, 1.0),
    ],
)
def test_direct_feedthrough_is_found(record):
    assert find_direct_inputs(record) == (0,)


@pytest.mark.parametrize("delay", [1, 2])
@pytest.mark.parametrize("make", [white, smooth])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_delay_is_not_taken_for_direct_feedthrough(make, delay, noise):
    assert find_direct_inputs(lag(make(3), delay, noise)) == ()
    assert find_direct_inputs(cubic(make(3), delay)) == ()


@pytest.mark.parametrize(
    "record",
    [
        lag(white(0, 60), 0),
        join(tuple(lag(white(seed, 20), 0) for seed in range(100))),
        Dataset(np.sin(0.05 * np.arange(2000)), np.sin(0.05 * np.arange(2000)), 1.0),
        Dataset(np.zeros(2000), white(0), 1.0),
        Dataset(white(0), np.zeros(2000), 1.0),
    ],
    ids=["short", "short recordings", "predictable input", "constant input", "constant output"],
)
def test_a_record_without_information_has_no_direct_inputs(record):
    assert find_direct_inputs(record) == ()


@pytest.mark.ci
@pytest.mark.nightly
def test_the_defaults_find_the_static_map_of_two_inputs():
    """Decided for one input only, the other one was read a sample late and dropped: an error of 0.51."""
    rng = np.random.default_rng(1)
    i, x = rng.uniform(0.0, 2.0, 2000), rng.uniform(0.0, 3.0, 2000)
    force = 2.0 * i**2 + 0.5 * i * x + rng.normal(0.0, 0.02, 2000)
    found = islands.fit(Dataset(np.column_stack([i, x]), force, 0.01, ("i_A", "x_mm"), "F_N"))
    assert found.search_result.direct_inputs == ("i_A", "x_mm")
    assert re.sub(r"[\d.]+\*", "", found.best.equation) == "F_N(k) = i_A(k)^2 + i_A(k)*x_mm(k)"
    assert found.best.model.parameters == pytest.approx((2.0, 0.5), abs=0.002)
    assert found.best.metrics["validation"]["free_run"].rmse < 0.021


@pytest.fixture(scope="module")
def found():
    return islands.fit(lag(white(0), 0), **LIBRARY)


def make_impact(is_direct, samples=1200):
    """An accelerometer or a sensor of position on a resonance that is hit once."""
    force = np.zeros(samples)
    force[30:35] = [0.2, 1.0, 1.4, 0.9, 0.1]
    position = lfilter([0.0, 0.1], [1.0, -1.7, 0.97], force)
    y = force + np.diff(position, 2, prepend=[0.0, 0.0]) if is_direct else position
    return Dataset(force, y + 0.01 * np.std(y) * white(4, samples), 0.001, ("force_N",), "y")


@pytest.mark.ci
@pytest.mark.parametrize("is_direct", [True, False])
def test_an_impact_shows_whether_the_output_responds_at_once(is_direct):
    chosen = select_feedthrough(split(make_impact(is_direct)), "auto", TRIAL)
    assert chosen.estimation.input_names == (("force_N+1",) if is_direct else ("force_N",))


def test_the_setting_decides_without_a_test():
    data = split(Dataset(np.column_stack([white(0), white(1)]), white(2), 1.0, ("a+1", "b")))
    assert select_feedthrough(data, "no", TRIAL) is data
    assert select_feedthrough(data, "yes", TRIAL).validation.input_names == ("a+1", "b+1")
    with pytest.raises(SettingsError, match="feedthrough is auto, yes or no, got 'perhaps'"):
        select_feedthrough(data, "perhaps", TRIAL)
    with pytest.raises(SettingsError, match="feedthrough is auto, yes or no"):
        islands.identify(lag(white(0), 0), feedthrough="perhaps")


def test_identify_finds_it_likewise():
    changes = {"generations": 0, "population": 10, "max_terms": 4, "library_degree": 1, "max_height": 1}
    record = lag(white(0, 400), 0)
    found = islands.identify(record, preset="narx", estimator="shooting", shifts=(1,), average=1, **changes)
    assert found.search_result.direct_inputs == ("u_V",)
    assert "u_V(k)" in found.best.equation

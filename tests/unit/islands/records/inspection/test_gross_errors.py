"""Gross errors of an output are found where they are; responses, however fast or rare, are none."""

import numpy as np
import pytest
from scipy.signal import lfilter

from islands.records.inspection.gross_errors import find_gross_errors, find_input_codes
from support.laws import LAWS
from support.measured_events import EVENTS
from support.portfolio_records import KINDS

SAMPLES = 1200


def stepped(seed=7, samples=SAMPLES):
    return np.repeat(np.random.default_rng(seed).uniform(0, 10, samples // 10), 10)


def lagged(u, noise=0.02, seed=7):
    return lfilter([0, 0.2], [1, -0.9], u) + np.random.default_rng(seed).normal(0, noise, u.size)


def found(y, u):
    return find_gross_errors(y, u if u.ndim == 2 else u[:, None])


@pytest.mark.parametrize("values", [(-50, -50, 60), (-9999, -9999, -9999), (30, 31, 29)])
@pytest.mark.parametrize("places", [(150, 151, 700), (40, 333, 1100)])
def test_the_samples_of_gross_errors_are_found(values, places):
    u = stepped()
    y = lagged(u)
    y[list(places)] = values
    assert found(y, u).samples.tolist() == list(places)


def test_a_part_with_a_stuck_sensor_is_found():
    u = stepped()
    y = lagged(u)
    y[600:660] = y[600]
    assert found(y, u).stuck == ((600, 660),)


def test_an_output_that_rests_until_it_responds_to_an_input_is_not_stuck():
    u = stepped()
    u[600:700] = u[700] - 5.0
    y = lagged(u)
    y[650:701] = y[650]
    assert not found(y, u).samples.size


def pulses():
    u = np.zeros(3000)
    u[[300, 301, 900, 901, 1500, 1501, 2200]] = 1.0
    return u


def kicks():
    u = np.repeat(np.random.default_rng(0).uniform(-1, 1, 6), 500)
    return u, lfilter([1, -1], [1, -0.2], u - u[0])


@pytest.mark.parametrize(
    ("u", "y"),
    [
        (pulses(), 3 * pulses()),
        (pulses(), np.roll(3 * pulses() ** 2, 2)),
        (pulses(), lfilter([0, 1], [1, -0.5], pulses())),
        kicks(),
        (kicks()[0], np.roll(kicks()[1], 8)),
        (kicks()[0], (5 * kicks()[1]) ** 3),
    ],
    ids=["static", "squared", "lagged", "kick", "late kick", "cubic kick"],
)
def test_a_response_to_a_rare_movement_of_the_input_is_no_error(u, y):
    noisy = y + np.random.default_rng(1).normal(0, 0.01, y.size)
    assert not found(noisy, u).samples.size


def test_an_impact_that_rings_is_no_error():
    rng = np.random.default_rng(0)
    u = np.sin(2 * np.pi * np.arange(4000) / 400)
    y = u + rng.normal(0, 0.01, 4000)
    for begin in (203, 1003, 2203):
        time = np.arange(4000 - begin)
        y[begin:] += 3.0 * np.exp(-0.3 * time) * np.cos(1.5 * time)
    assert not found(y, u).samples.size


@pytest.mark.ci
@pytest.mark.parametrize("law", LAWS)
def test_the_record_of_no_law_has_gross_errors(law):
    for level in (0.0, 0.01, 0.05):
        record = LAWS[law].record(1000, level, 3)
        assert not found(record.y, record.u).samples.size


@pytest.mark.ci
def test_almost_all_spikes_of_the_size_of_the_range_are_found():
    hits = count = 0
    for kind in KINDS.values():
        record = kind.record(11)[0]
        rng = np.random.default_rng(5)
        places = np.sort(rng.choice(np.arange(20, record.samples - 20), 4, replace=False))
        y = record.y.copy()
        y[places] += rng.choice([-1.0, 1.0], 4) * np.ptp(record.y)
        samples = found(y, record.u).samples
        assert not set(samples.tolist()) - set(places.tolist())
        hits, count = hits + samples.size, count + 4
    assert hits >= 0.95 * count


@pytest.mark.parametrize("name", EVENTS)
def test_a_physical_event_is_no_error(name):
    deleted = 0
    for seed in range(3):
        u, y = EVENTS[name](np.random.default_rng([seed, *map(ord, name)]))
        deleted += found(y, u).samples.size > 0
    assert deleted <= 1 - (name != "floods")


def test_only_a_known_code_is_an_error_of_an_input():
    u = stepped() + np.random.default_rng(2).normal(0, 0.1, SAMPLES)
    u[[3, 4]] = 400.0
    assert find_input_codes(u) == {}
    u[[3, 4]] = -9999.0
    assert {code: samples.tolist() for code, samples in find_input_codes(u).items()} == {-9999.0: [3, 4]}


@pytest.mark.parametrize("samples", [0, 1, 5, 12, 30])
def test_short_and_incomplete_records_have_no_errors(samples):
    u, y = stepped()[:samples], lagged(stepped())[:samples]
    y[::3] = np.nan
    assert not found(y, u).samples.size

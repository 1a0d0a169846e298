"""Physics checks: holds, excursions and cluster sums of models with known behaviour."""

import numpy as np
import pytest

import islands
from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.validation.physics import LEVELS, ClusterSum, check_physics, hold_response

PERIOD = 200
AMPLITUDE = 10.0
MIDPOINT = 5.0


def model(terms, names=("u",)):
    return islands.make_model([(islands.parse(text), theta) for text, theta in terms.items()], names)


def record(period=PERIOD, periods=5, **changes):
    """Return a record with a sine input of nonzero mean, and an output of range 8 whose first sample is 3."""
    angle = 2 * np.pi * np.arange(periods * period) / period
    return Dataset(MIDPOINT + AMPLITUDE * np.sin(angle), 3.0 + 4.0 * np.sin(angle), 0.01, **changes)


def excursions(checked):
    return {entry.name: entry for entry in checked.excursions}


#: A rate-independent model with fading memory whose output is constant at constant input.
HYSTERESIS = {
    "y(k-1)": 1.0,
    "u(k-1) - u(k-2)": 0.5,
    "u(k-1)*sign(u(k-1) - u(k-2))*(u(k-1) - u(k-2))": 0.1,
    "y(k-1)*sign(u(k-1) - u(k-2))*(u(k-1) - u(k-2))": -0.3,
}


def test_hysteresis_model_has_property_1_and_does_not_drift():
    checked = check_physics(model(HYSTERESIS), record())
    assert checked.property_1 is True
    assert checked.hold_drift_percent < 1e-9
    assert checked.clusters == (ClusterSum("y", 1.0, 1.0),)
    assert all(entry.bounded for entry in checked.excursions)


def test_cluster_sums_are_not_sufficient_for_property_1():
    # The sum is 1, but the modes are 1 and 1.5, so every disturbance diverges.
    checked = check_physics(model({"y(k-1)": 2.5, "y(k-2)": -1.5, "u(k-1) - u(k-2)": 0.1}), record())
    assert [(entry.cluster, entry.met) for entry in checked.clusters] == [("y", True)]
    assert not any(entry.bounded for entry in checked.holds)
    assert checked.property_1 is False


@pytest.mark.parametrize("terms", [{"u(k-1) - u(k-2)": 0.5}, {"1": 2.0}, {"y(k-1)*u(k-1)": 0.01}])
def test_model_without_feedback_has_no_continuum_of_equilibria(terms):
    # The first model has no cluster; its output is zero and constant in every hold.
    checked = check_physics(model(terms), record())
    assert checked.clusters[0] == ClusterSum("y", 0.0, 1.0)
    assert checked.property_1 is False


def test_decaying_transient_does_not_violate_property_1():
    # Modes 1 and -0.4: a transient remains when the hold starts, but has decayed in its second half.
    settling = model({"y(k-1)": 0.6, "y(k-2)": 0.4, "u(k-1) - u(k-2)": 0.1})
    checked = check_physics(settling, record())
    assert checked.hold_drift_percent > 1e-3
    assert checked.property_1 is True
    # The output oscillates about its final value; the drift is the difference of last and first sample.
    for entry in checked.holds:
        y = hold_response(settling, record(), entry.level, entry.loading)[1][-20 * PERIOD + 2 :]
        assert entry.drift_percent == pytest.approx(100 * abs(y[-1] - y[0]) / 8, rel=1e-9)
        assert entry.drift_percent < 0.9 * 100 * np.ptp(y) / 8


@pytest.mark.parametrize("loading", [True, False])
@pytest.mark.parametrize("level", LEVELS)
def test_hold_reaches_its_level_from_the_stated_side(level, loading):
    signal, y = hold_response(model(HYSTERESIS), record(), level, loading)
    held = signal[-20 * PERIOD :]
    assert np.all(held == level)
    assert len(signal) == len(y)
    before = signal[-20 * PERIOD - 1]
    assert (before < level) if loading else (before > level)
    assert np.abs(signal).max() == pytest.approx(1.0, abs=1e-9)


def test_drift_matches_a_hand_calculation():
    decaying = model({"y(k-1)": 0.9999, "u(k-1) - u(k-2)": 0.8})
    data = record()
    checked = check_physics(decaying, data)
    drifts = {(entry.level, entry.loading): entry.drift_percent for entry in checked.holds}
    for (level, loading), drift in drifts.items():
        signal, simulated = hold_response(decaying, data, level, loading)
        u = MIDPOINT + AMPLITUDE * np.concatenate([[0.0, 0.0], signal])
        y = [3.0, 3.0]
        for k in range(2, len(u)):
            y.append(0.9999 * y[-1] + 0.8 * (u[k - 1] - u[k - 2]))
        np.testing.assert_allclose(simulated, y[2:], rtol=1e-12)
        # From the third sample of the hold on the output only decays, over 20 periods less 3 samples.
        begin = y[-20 * PERIOD + 2]
        expected = 100 * abs(begin) * (1 - 0.9999 ** (20 * PERIOD - 3)) / 8.0
        assert drift == pytest.approx(expected, rel=1e-9)
    assert checked.hold_drift_percent == max(drifts.values()) > 20.0
    assert not any(entry.constant for entry in checked.holds)
    assert all(entry.bounded for entry in checked.holds)


def test_divergence_gives_infinite_values_without_a_warning():
    checked = check_physics(model({"y(k-1)": 1.0, "y(k-1)^3*u(k-1)^2": 1.0}), record())
    assert not any(entry.bounded or entry.constant for entry in checked.holds)
    assert {entry.drift_percent for entry in checked.holds} == {np.inf}
    assert checked.hold_drift_percent == np.inf
    for entry in checked.excursions:
        assert (entry.bounded, entry.closure_percent, entry.range_percent) == (False, np.inf, np.inf)
    assert checked.property_1 is False


# Excursions.


# At five times the rate, these have 32 to 38 samples per period. Those with 34 and 38 samples have no sample
# at a crest, but two adjacent samples of equal height.
@pytest.mark.parametrize("period", [160, 165, 170, 175, 180, 190])
def test_rate_independent_model_closes_its_loops(period):
    found = excursions(check_physics(model(HYSTERESIS), record(period)))
    # At half the amplitude the memory fades more slowly: by exp(-0.3 * 20) per period.
    assert found["amplitude x 0.5"].closure_percent < 1e-4
    assert found["rate x 0.25"].closure_percent < 1e-9
    assert found["rate x 5"].closure_percent < 1e-9
    # A nested loop only stays open by one sample of lag on legs of different steepness.
    assert found["minor-loops"].closure_percent < 0.1


def test_closure_of_a_ratchet_is_its_gain_per_period():
    # The output rises by a hundredth of the path of the input: four amplitudes per period.
    ratchet = model({"y(k-1)": 1.0, "abs(u(k-1) - u(k-2))": 0.01})
    found = excursions(check_physics(ratchet, record(160)))
    per_period = 100 * 0.01 * 4 * AMPLITUDE / 8
    assert found["amplitude x 0.5"].closure_percent == pytest.approx(per_period / 2, rel=1e-9)
    assert found["rate x 0.25"].closure_percent == pytest.approx(per_period, rel=1e-9)
    assert found["rate x 5"].closure_percent == pytest.approx(per_period, rel=1e-9)


# What the record gives: the period, the range, a place to start from.


def test_drift_relative_to_a_constant_output_is_zero_or_infinite():
    data = Dataset(record().u, np.full(record().samples, 2.0), 0.01)
    constant = check_physics(model({"y(k-1)": 1.0}), data)
    assert constant.property_1 is True
    assert constant.hold_drift_percent == 0.0
    assert {(entry.bounded, entry.closure_percent, entry.range_percent) for entry in constant.excursions} == {
        (True, 0.0, 0.0)
    }
    moved = check_physics(model({"y(k-1)": 0.9999, "u(k-1) - u(k-2)": 0.5}), data)
    assert moved.property_1 is False
    assert moved.hold_drift_percent == np.inf
    assert all(entry.bounded and entry.range_percent == np.inf for entry in moved.excursions)


def test_record_without_a_measured_output_is_refused():
    data = Dataset(record().u, np.full(record().samples, np.nan), 0.01)
    with pytest.raises(RecordError, match="the output is missing at sample 0, where a simulation starts"):
        check_physics(model(HYSTERESIS), data)


def test_a_bilinear_model_that_escapes_beyond_the_recorded_levels_is_found():
    """y(k) = (0.5 - 0.5 u) y(k-1) + u(k-1) has a pole of 1 at u = -1, and was "bounded at held inputs"."""
    bilinear = model({"y(k-1)": 0.5, "y(k-1)*u(k-1)": -0.5, "u(k-1)": 1.0})
    u = np.random.default_rng(0).uniform(-1.0, 1.0, 2000)
    u[:2] = -1.0, 1.0
    y = np.zeros(2000)
    for k in range(1, 2000):
        y[k] = (0.5 - 0.5 * u[k - 1]) * y[k - 1] + u[k - 1]
    checked = check_physics(bilinear, Dataset(u, y, 0.1))
    assert all(hold.bounded for hold in checked.holds)
    assert all(entry.bounded for entry in checked.excursions)
    by_level = {entry.level: entry for entry in checked.extremes}
    assert list(by_level) == [-1.2, -1.0, 1.0, 1.2]
    assert by_level[-1.0].bounded
    assert by_level[-1.0].ranges > 100.0
    assert not by_level[-1.2].bounded
    assert [entry.plausible for entry in checked.extremes] == [False, False, True, True]


def test_the_output_at_an_extreme_is_compared_with_its_recorded_range():
    """A static gain of 4 at 1.2 of the amplitude is a tenth of the range above it."""
    checked = check_physics(
        model({"u(k-1)": 4.0 / AMPLITUDE, "1": 3.0 - 4.0 * MIDPOINT / AMPLITUDE}), record()
    )
    assert [entry.ranges for entry in checked.extremes] == pytest.approx([0.1, 0.0, 0.0, 0.1], abs=1e-3)


@pytest.mark.parametrize(
    ("terms", "drift"),
    [
        ({"y(k-1)": 1.0, "u(k-1)": 0.001}, "grows"),
        ({"y(k-1)": 0.9, "u(k-1)": 0.1}, "settles"),
        ({"y(k-1)": -1.0, "u(k-1)": 0.1}, "settles"),
    ],
)
def test_an_integrator_drifts_at_held_inputs_and_an_oscillation_does_not(terms, drift):
    for entry in check_physics(model(terms), record()).extremes:
        assert entry.bounded
        assert (entry.drift > 0.05) == (drift == "grows")
        assert drift == "grows" or entry.drift < 0.01

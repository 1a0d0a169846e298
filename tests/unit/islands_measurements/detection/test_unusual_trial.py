"""Records with unusual causes: their misfit, their plants, and the errors on fresh records."""

import numpy as np
import pytest

from islands_measurements.detection import unusual_trial
from islands_measurements.detection.injection.unusual.misfit import compute_misfit
from islands_measurements.detection.injection.unusual.table import UNUSUAL_CAUSES
from islands_measurements.detection.unusual_trial import (
    MISFIT,
    MOST_NOISE,
    FreshErrors,
    UnusualTrial,
    draw_record,
    run_unusual_trial,
)

CAUSES = [name for name, cause in UNUSUAL_CAUSES.items() if not cause.is_clean]
CLEAN = [name for name, cause in UNUSUAL_CAUSES.items() if cause.is_clean]


@pytest.mark.parametrize("name", CAUSES)
def test_the_misfit_of_a_cause_is_well_above_the_noise(name: str) -> None:
    """It is above 20 standard deviations only where the noise is as large as it may be."""
    drawn, misfit = draw_record(UNUSUAL_CAUSES[name], 1)
    assert misfit >= MISFIT[0]
    assert misfit <= MISFIT[1] or drawn.sigma == pytest.approx(MOST_NOISE * np.std(drawn.clean))
    noise = drawn.record.y - drawn.clean
    assert np.std(noise) == pytest.approx(drawn.sigma, rel=0.1)
    again = compute_misfit(UNUSUAL_CAUSES[name].simulation, drawn.record.u[:, 0], drawn.clean)
    assert again == pytest.approx(misfit * drawn.sigma)


@pytest.mark.parametrize("name", CLEAN)
def test_the_right_simulation_has_no_misfit_without_a_cause(name: str) -> None:
    """The force of the machine is band-limited, but linear between samples in the fit."""
    drawn, misfit = draw_record(UNUSUAL_CAUSES[name], 1)
    rest = compute_misfit(UNUSUAL_CAUSES[name].simulation, drawn.record.u[:, 0], drawn.clean)
    assert rest < 5e-3 * np.std(drawn.clean)
    assert misfit == 0.0


@pytest.mark.parametrize("name", ["quantised-valve", "swept-force", "clean-loop"])
def test_a_fresh_record_is_one_of_the_same_plant_with_another_input(name: str) -> None:
    cause = UNUSUAL_CAUSES[name]
    (first, _), (again, _), (fresh, _) = (draw_record(cause, 3, number) for number in (0, 0, 1))
    np.testing.assert_array_equal(first.record.y, again.record.y)
    assert abs(np.corrcoef(first.record.u[:, 0], fresh.record.u[:, 0])[0, 1]) < 0.5
    assert fresh.sigma == first.sigma
    assert fresh.record.input_names == first.record.input_names


def test_a_fresh_record_has_the_gains_of_the_first_one() -> None:
    cause = UNUSUAL_CAUSES["asymmetric-gain"]
    gains = []
    for number in (0, 1):
        drawn, _ = draw_record(cause, 5, number)
        u, y = drawn.record.u[:, 0], drawn.clean
        # Regression of the rate on output and on both parts of the input: x' = (g u - x) / T.
        pole = np.exp(-0.1 / 2.0)
        change = (y[1:] - pole * y[:-1]) / (1.0 - pole)
        parts = np.column_stack([np.maximum(u, 0.0), np.minimum(u, 0.0)])[:-1]
        gains.append(np.linalg.lstsq(parts, change, rcond=None)[0])
    np.testing.assert_allclose(gains[0], gains[1], rtol=1e-6)
    assert abs(gains[0][0] / gains[0][1] - 1.0) > 0.05


def test_an_extension_is_worse_if_it_diverges_or_if_noise_makes_it_worse() -> None:
    assert not FreshErrors(10.0, 1.0, 10.0, 1.0).is_worse
    assert FreshErrors(10.0, 11.0, 10.0, 1.0).is_worse
    assert FreshErrors(10.0, 1.0, 10.0, 11.0).is_worse
    assert FreshErrors(10.0, float("inf"), 10.0, float("inf")).is_worse
    assert FreshErrors(10.0, 1.0, 10.0, 1.0).ratio == 0.1


def test_an_error_of_the_analysis_is_an_outcome(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_arguments: object) -> None:
        raise ZeroDivisionError("no noise")

    monkeypatch.setattr(unusual_trial, "diagnose", fail)
    outcome = run_unusual_trial(UnusualTrial("clean-pink", 1))
    assert outcome.verdict == "error"
    assert outcome.error.rstrip().endswith("ZeroDivisionError: no noise")


@pytest.mark.ci
def test_an_extension_is_measured_on_a_fresh_record() -> None:
    """An actuator with another gain for positive commands has its curve in the extension."""
    outcome = run_unusual_trial(UnusualTrial("asymmetric-gain", 8_100_000))
    assert outcome.fresh is not None
    assert outcome.fresh.base > 3.0
    assert outcome.fresh.ratio < 0.3
    assert not outcome.fresh.is_worse
    assert outcome.claims[0].loss is not None
    assert outcome.claims[0].loss > 3.0


@pytest.mark.ci
@pytest.mark.nightly
def test_a_simulation_that_diverges_with_a_larger_step_is_calibrated_again() -> None:
    """Of a mass that sticks and slips, the damping alone is determined: too large for the first step."""
    outcome = run_unusual_trial(UnusualTrial("stick-slip", 8_600_000))
    assert outcome.error == ""
    assert outcome.verdict == "named"

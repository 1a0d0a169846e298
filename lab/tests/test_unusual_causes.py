"""Records with unusual causes: their misfit, and fresh records of the same plant."""

import numpy as np
import pytest

from lab.diagnosis.injection.unusual.misfit import compute_misfit
from lab.diagnosis.injection.unusual.table import UNUSUAL_CAUSES
from lab.diagnosis.unusual_trial import (
    MISFIT,
    MOST_NOISE,
    draw_record,
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

"""Free forms: the shape of a record is found, and known shapes keep their names."""

from collections.abc import Sequence

import numpy as np
import pytest

import islands
from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.effects import Effect
from islands.effects.catalogue import CATALOGUE
from islands.effects.filters import low_pass
from islands.effects.free_forms import FREE_FORMS
from islands.effects.interface.context import SimulationContext
from islands.kernels.curve import PLACES
from islands.report.documents.extension import extended_document
from islands.report.figures.diagnosis import draw_free_forms
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.external import RecordedOutput
from lab.diagnosis.trial import Trial, run_trial
from support.simulated_records import recorded, wave

U = wave(2000) / 20.0
THEIRS = low_pass(U, 0.05, 0.01)
NOISE = 0.01 * np.random.default_rng(4).standard_normal(U.size)


def diagnose(y: np.ndarray, names: Sequence[str] = tuple(CATALOGUE)) -> islands.DiagnosisResult:
    return islands.diagnose(
        recorded(U, y + NOISE),
        "column:theirs",
        columns={"theirs": THEIRS},
        effects=[CATALOGUE[name] for name in names],
    )


@pytest.mark.nightly
def test_curve_of_no_listed_form_is_a_family_with_its_shape() -> None:
    peak = float(np.max(np.abs(THEIRS)))

    def characteristic(place: np.ndarray) -> np.ndarray:
        return 0.1 * np.sin(2 * np.pi * place) * (1.0 - place**2) + 0.1 * np.cos(np.pi * place / 2) ** 4

    found = diagnose(THEIRS + characteristic(THEIRS / peak))
    assert str(found.verdict) == "family"
    (form, *_) = found.effects
    assert (form.name, form.family) == ("output-curve", "shape")
    assert form.resembles is None
    values = [each.value for each in form.parameters.values()]
    np.testing.assert_allclose(values, characteristic(PLACES), atol=0.01)
    assert found.gain is not None
    assert found.gain.after.rmse == pytest.approx(0.01, rel=0.2)
    assert len(draw_free_forms(found).axes) == 1
    # The extended simulation contains the shape.
    document = extended_document(found.best, found.record)
    saved = simulate_spec(document, found.record, columns={"theirs": THEIRS})
    np.testing.assert_allclose(saved, found.best.output, rtol=1e-9)


@pytest.mark.nightly
def test_effect_in_addition_to_a_free_form_is_named() -> None:
    place = THEIRS / float(np.max(np.abs(THEIRS)))
    curve = 0.1 * np.sin(2 * np.pi * place) * (1.0 - place**2) + 0.1 * np.cos(np.pi * place / 2) ** 4
    names = ("output-curve", "periodic-disturbance", "offset", "linear-drift", "jump", "cubic-stiffness")
    found = diagnose(THEIRS + curve + 0.05 * np.sin(0.09 * np.arange(U.size)), names)
    assert str(found.verdict) == "family"
    assert {"output-curve", "periodic-disturbance"} <= {each.name for each in found.effects}
    assert found.gain is not None
    assert found.gain.after.rmse < 0.02


@pytest.mark.nightly
def test_uneven_lag_is_a_family_with_its_time_constants() -> None:
    """A valve opens with a time constant of 0.3 s and closes with 0.1 s, ahead of a first-order process."""

    def follow(u: np.ndarray, dt: float, gain: float = 1.0) -> np.ndarray:
        return gain * low_pass(u, 0.05, dt)

    y = follow(lag_unevenly(U, 0.1, 0.3), 0.01)
    found = islands.diagnose(recorded(U, y + NOISE), islands.function_simulator(follow))
    assert_uneven_lag(found, "input-lag-curve", 0.1, 0.3)


def lag_unevenly(signal: np.ndarray, falling: float, rising: float) -> np.ndarray:
    """Lag a signal that is linear between samples, in steps of 0.5 ms."""
    fine, at, lagged = 20, signal[0], []
    for value in np.interp(np.arange(fine * signal.size) / fine, np.arange(signal.size), signal).tolist():
        at += (value - at) * 0.01 / fine / (rising if value > at else falling)
        lagged.append(at)
    return np.array(lagged)[::fine]


def assert_uneven_lag(found: islands.DiagnosisResult, name: str, falling: float, rising: float) -> None:
    assert str(found.verdict) == "family"
    (form,) = found.causes
    assert (form.name, form.family) == (name, "timing")
    values = [form.parameters[f"{side} slowly"].value for side in ("falling", "rising")]
    assert values == [pytest.approx(falling, rel=0.1), pytest.approx(rising, rel=0.1)]


@pytest.mark.parametrize("form", FREE_FORMS, ids=lambda form: form.name)
def test_free_form_vanishes_at_its_nominal_values(form: Effect) -> None:
    assert CATALOGUE[form.name] is form
    context = SimulationContext(U, 0.01, {}, {}, 2.0, 2.0, "V", "V", 15.0)
    simulation = ExtendedSimulator(RecordedOutput("theirs", U), (form,), context)
    np.testing.assert_allclose(simulation.simulate(simulation.nominal), U, atol=1e-12)
    moved = simulation.nominal + 0.02 * np.eye(simulation.nominal.size)
    assert (
        np.linalg.matrix_rank(simulation.simulate_batch(moved) - U)
        >= simulation.nominal.size - (form.site == "input map") * simulation.nominal.size
    )


@pytest.mark.nightly
def test_equation_replaces_two_names_that_fit_worse() -> None:
    """A damping curve fits better than two names, and the equation explains as much as the curve."""
    found = run_trial(Trial(("cubic-damping",), 7_715_009, "white", (0.2, 1.0), core="second-order"))
    assert (found.verdict, found.named) == ("discovered", ("missing-term",))

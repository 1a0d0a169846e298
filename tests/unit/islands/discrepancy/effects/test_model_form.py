"""Terms that an identified model lacks: which they are, what they do, and the model with them in it."""

import json

import numpy as np
import pytest

from islands.discrepancy.calibration.levenberg_marquardt import Target, calibrate, evaluate_fit
from islands.discrepancy.calibration.preparation import make_context
from islands.discrepancy.effects.model_form import CORE_SHAPE, SLOPE
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.narx import NarxSimulator
from islands.io.models import model_from_json
from islands.io.simulator_spec.document import extended_document
from islands.io.simulator_spec.factory import simulate_spec
from islands.model.model import Model, make_model
from islands.model.parsing import parse
from islands.performance.trials.cases import CORES
from islands.performance.trials.injection.measurement import FaultyRecord, inject


@pytest.fixture(scope="module")
def hiding() -> FaultyRecord:
    return inject([], np.random.default_rng(804), 20.0)


@pytest.fixture(scope="module")
def extended(hiding: FaultyRecord) -> ExtendedSimulator:
    """Return an identified model with the terms that it lacks."""
    core = CORES["narx"].made(hiding)
    scene = make_context(hiding.record, core, 1500)
    return ExtendedSimulator(core, core.state_effects, scene)


def started(extended: ExtendedSimulator, hiding: FaultyRecord) -> np.ndarray:
    """Return where a search for the terms begins."""
    (effect,) = extended.effects
    values = extended.nominal
    at_rest = extended.with_effects(()).simulate(values[: extended.get_slice(effect).start])
    values[extended.get_slice(effect)] = effect.starting_points(extended.context, hiding.record.y - at_rest)[
        0
    ]
    return values


def model(**terms: str) -> Model:
    split = (term.split(" * ", 1) for term in terms.values())
    return make_model([(parse(text), float(parameter)) for parameter, text in split])


def test_terms_that_are_missing_do_nothing_until_they_have_coefficients(extended: ExtendedSimulator) -> None:
    alone = extended.with_effects(())
    with_slope = extended.simulate(extended.nominal)
    assert with_slope == pytest.approx(alone.simulate(alone.nominal), abs=1e-9)


def test_each_has_a_name_of_its_own_and_none_is_the_model_s(extended: ExtendedSimulator) -> None:
    assert isinstance(extended.simulator, NarxSimulator)
    names = [parameter.name for parameter in extended.parameters]
    assert len(set(names)) == len(names)
    own = {item.text for item in extended.simulator.model.regressors}
    assert not own & {name.removeprefix(f"{CORE_SHAPE} ").replace("u(", "u1(") for name in names}
    assert names[-1] == SLOPE


def test_what_is_found_is_closer_to_the_record(extended: ExtendedSimulator, hiding: FaultyRecord) -> None:
    alone = extended.with_effects(())
    target = Target(hiding.record.y, np.arange(2000) < 1500, None, {})
    before = calibrate(alone, target, alone.nominal)
    after = calibrate(extended, target, started(extended, hiding))
    assert before.mean_square > 1.2 * hiding.sigma**2
    assert after.mean_square < 1.05 * hiding.sigma**2


def test_where_the_search_begins_no_locked_sample_tells(extended: ExtendedSimulator) -> None:
    (effect,) = extended.effects
    seen = np.random.default_rng(1).standard_normal(2000)
    locked = np.where(np.arange(2000) < 1500, seen, 9.0)
    assert effect.starting_points(extended.context, seen) == effect.starting_points(extended.context, locked)


def test_what_holds_still_at_a_constant_input_still_does(
    extended: ExtendedSimulator, hiding: FaultyRecord
) -> None:
    values = started(extended, hiding)
    resting = np.where(np.arange(2000) < 1000, extended.context.u, extended.context.u[999])
    core = extended.simulator
    own = {each.name: value for each, value in zip(extended.parameters[8:], values[8:], strict=True)}
    y = core.simulate(values[:8], resting, extended.context, own, ())
    assert np.ptp(y[1010:]) == 0.0


def test_a_model_is_extended_by_writing_the_terms_into_it(
    extended: ExtendedSimulator, hiding: FaultyRecord
) -> None:
    record, values = hiding.record, started(extended, hiding)
    target = Target(record.y, np.arange(record.samples) < 1500, None, {})
    fit = evaluate_fit(extended, target, values)
    document = extended_document(fit, record)
    assert document["effects"] == []
    written = model_from_json(json.dumps(document["core"]["model"]), "extended")
    assert isinstance(extended.simulator, NarxSimulator)
    assert written.size == extended.simulator.model.size + len(extended.parameters) - 8 - 1
    # It begins a sample later, with what was measured there.
    again = simulate_spec(document, record)
    assert np.std((again - fit.output)[200:]) < 0.3 * hiding.sigma


def test_a_model_of_one_delay_or_of_levels_alone_has_its_terms_too() -> None:
    start = np.zeros(3)
    of_levels = NarxSimulator(model(a="0.5 * y(k-1)", b="0.4 * u(k-1)"), "levels", start)
    (effect,) = of_levels.state_effects
    assert effect.family == "shape"
    output_alone = NarxSimulator(model(a="0.5 * y(k-1)", b="0.1 * y(k-2)"), "output alone", start)
    assert output_alone.state_effects == ()

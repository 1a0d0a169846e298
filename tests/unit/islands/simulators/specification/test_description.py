"""Extended simulations as documents: a document is read without loss and has the same output."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, evaluate_fit
from islands.diagnosis.calibration.preparation import count_fitted_samples, select_effects
from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.procedure import diagnose
from islands.effects.catalogue import CATALOGUE, catalogue_order
from islands.effects.interface.effect import Effect
from islands.errors import ModelError, RecordError, SettingsError
from islands.export.extension import as_json
from islands.records.dataset import Dataset
from islands.report.documents.extension import extended_document, extended_json
from islands.simulators.extended import ExtendedSimulator, SavedExtension, make_context
from islands.simulators.specification.description import describe_extension
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import (
    LocalExtendedSpec,
    ModelSpec,
    innermost,
)
from support.simulated_records import SpecAndRecord, made, names

pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("toy_class")]

#: Samples after which the free run of a model no longer depends on its initial outputs.
TRANSIENT = 100


@pytest.fixture(params=names())
def case(request: pytest.FixtureRequest) -> SpecAndRecord:
    return made()[request.param]


def extend(case: SpecAndRecord, effects: list[Effect]) -> CalibrationResult:
    """Add effects to a simulator, at their first starting points."""
    simulator = case.simulator
    fitted = count_fitted_samples(case.record)
    context = make_context(case.record, simulator, fitted)
    simulation = ExtendedSimulator(simulator, catalogue_order(effects), context)
    values = simulation.nominal
    residual = 0.01 * context.output_peak * np.sin(2 * np.pi * 7.3 * context.time)
    for effect in simulation.effects:
        values[simulation.get_slice(effect)] = effect.starting_points(context, residual)[0]
    target = Target(case.record.y, np.arange(case.record.samples) < fitted, None, {}, fitted=fitted)
    return evaluate_fit(simulation, target, values)


def stateless_effects(case: SpecAndRecord) -> list[Effect]:
    """Return the possible effects that have no initial state.

    Initial states are fitted to the record, so that they differ on another record.
    """
    simulator = case.simulator
    context = make_context(case.record, simulator, count_fitted_samples(case.record))
    return [
        effect
        for effect in select_effects(simulator, context, {})
        if not any(parameter.initial for parameter in effect.parameters(context))
    ]


def effect_of_each_site(case: SpecAndRecord) -> list[Effect]:
    """Return one effect for each site of the simulator."""
    sites: dict[object, Effect] = {}
    for effect in stateless_effects(case):
        sites.setdefault(effect.site, effect)
    return list(sites.values())


def has_initial_states(simulation: ExtendedSimulator) -> bool:
    return any(parameter.initial for parameter in simulation.parameters)


def assert_same_output(case: SpecAndRecord, fit: CalibrationResult) -> None:
    """Compare the simulation of a document with the simulation that was written.

    Both agree to rounding, or to the accuracy of the fit if there are initial states. These are fitted to the
    output of the written simulation.
    """
    document = json.loads(extended_json(fit, case.record))
    fitted = has_initial_states(fit.simulation)
    record = replace(case.record, y=fit.output) if fitted else case.record
    found = simulate_spec(document, record, case.columns)
    tolerance, compared = 1e-5 if fitted else 1e-12, slice(None)
    if isinstance(innermost(case.spec), ModelSpec):
        # The free run of a model starts from measured outputs, which differ between the two records.
        tolerance, compared = 1e-3, slice(TRANSIENT, None)
    assert found[compared] == pytest.approx(
        fit.output[compared], abs=tolerance * float(np.max(np.abs(fit.output)))
    )


def test_a_document_has_the_output_of_the_written_simulation(case: SpecAndRecord) -> None:
    assert_same_output(case, extend(case, effect_of_each_site(case)))


def test_each_single_effect_has_the_output_of_the_written_simulation(case: SpecAndRecord) -> None:
    found = stateless_effects(case)
    if has_initial_states(ExtendedSimulator(case.simulator, (), extend(case, []).simulation.context)):
        found = found[::6]  # each requires a fit
    for effect in found:
        assert_same_output(case, extend(case, [effect]))


def test_effects_of_channels_find_the_columns_of_the_record() -> None:
    case = made()["bouc-wen-piezo"]
    time = np.arange(case.record.samples)
    record = Dataset(
        *(np.column_stack([case.record.u[:, 0], np.sin(0.01 * time), np.cos(0.02 * time)]), case.record.y),
        case.record.dt,
        input_names=("u_V", "T_K", "w_V"),
        input_units=("V", "K", "V"),
        output_name="y_um",
        output_unit="um",
    )
    fit = extend(replace(case, record=record), [CATALOGUE["thermal-drift"], CATALOGUE["cross-coupling"]])
    document = json.loads(extended_json(fit, record))
    assert np.array_equal(simulate_spec(document, record), fit.output)
    resting = replace(record, u=np.where([True, False, True], record.u, 20.0))
    with pytest.raises(RecordError, match="an effect of the simulation needs a channel in K, degC"):
        simulate_spec(document, resting)


def test_a_document_is_unchanged_after_reading_and_writing(case: SpecAndRecord) -> None:
    text = extended_json(extend(case, effect_of_each_site(case)), case.record)
    spec = LocalExtendedSpec.model_validate(json.loads(text))
    assert as_json(spec) == text
    simulator = make_simulator(spec, case.record, case.columns)
    assert isinstance(simulator, SavedExtension)
    values = np.array([parameter.nominal for parameter in simulator.parameters])
    assert as_json(describe_extension(simulator, values, spec.inputs, spec.output)) == text


def test_an_extension_can_be_extended_again(case: SpecAndRecord) -> None:
    """The outer extension contains the effects of the inner one, at their values."""
    first, *_ = effect_of_each_site(case)
    spec = LocalExtendedSpec.model_validate(json.loads(extended_json(extend(case, [first]), case.record)))
    outer = SpecAndRecord(spec, case.record, case.columns)
    assert first.name in outer.simulator.built_in_effects
    further = [each for each in stateless_effects(outer) if each.name != first.name][:1]
    assert_same_output(outer, extend(outer, further))


@pytest.mark.parametrize(
    ("kind", "name", "point"),
    [
        ("column", "jump", (1.0, 2.0)),
        pytest.param("bouc-wen-piezo", "even-nonlinearity", (1e-3,), marks=pytest.mark.nightly),
        pytest.param("linear", "delay", (0.02,), marks=pytest.mark.nightly),
    ],
)
def test_a_second_diagnosis_of_an_extension_finds_no_effect(
    kind: str, name: str, point: tuple[float, ...]
) -> None:
    case = made()[kind]
    fit = extend(case, [CATALOGUE[name]])
    values = fit.values.copy()
    values[fit.simulation.get_slice(CATALOGUE[name])] = point
    y = fit.simulation.simulate(values)
    noise = 0.02 * y.std() * np.random.default_rng(21).standard_normal(y.size)
    record = replace(case.record, y=y + noise)
    found = diagnose(record, case.simulator)
    assert [each.name for each in found.effects][:1] == [name]
    spec = LocalExtendedSpec.model_validate(extended_document(found.best, record))
    second = diagnose(record, make_simulator(spec, record, case.columns))
    assert [each.name for each in second.effects if each.explained_fraction is not None] == []
    assert second.verdict in ("nothing", "named")


INVALID = {
    "an unknown effect": (
        lambda document: document["effects"][0].update(name="wormhole"),
        ModelError,
        "has no effect 'wormhole'",
    ),
    "an effect without a value": (
        lambda document: document["effects"][0]["parameters"].clear(),
        ModelError,
        "effect cubic-stiffness has no value for k: diagnose again",
    ),
    "an unknown parameter": (
        lambda document: document["core"]["parameters"].update(mass=1.0),
        SettingsError,
        "there is no parameter mass: the parameters are m, c, k",
    ),
    "no simulator": (lambda document: document.pop("core"), ValidationError, "core\n"),
    "an unknown simulator": (
        lambda document: document["core"].update(kind="pendulum"),
        ValidationError,
        "pendulum",
    ),
    "an unknown intersample behaviour": (
        lambda document: document.update(hold="third-order"),
        ValidationError,
        "hold\n",
    ),
    "no steps": (lambda document: document.update(times=0), ValidationError, "times\n"),
    "too many steps": (lambda document: document.update(times=10**6), ValidationError, "times\n"),
    "no peak": (lambda document: document["scales"].update(input_peak=0.0), ValidationError, "input_peak\n"),
    "no number": (
        lambda document: document["effects"][0]["parameters"]["k"].update(value="x"),
        ValidationError,
        "value\n",
    ),
    "an unknown field": (lambda document: document.update(effect=[]), ValidationError, "effect\n"),
    "another schema version": (
        lambda document: document.update(schema="islands.extended/2"),
        ValidationError,
        "schema\n",
    ),
}


@pytest.mark.parametrize("reason", INVALID)
def test_an_invalid_document_is_refused_with_a_reason(reason: str) -> None:
    invalidate, error, words = INVALID[reason]
    oscillator = made()["second-order"]
    document = extended_document(extend(oscillator, [CATALOGUE["cubic-stiffness"]]), oscillator.record)
    invalidate(document)
    with pytest.raises(error) as raised:
        simulate_spec(document, oscillator.record)
    assert words in str(raised.value)

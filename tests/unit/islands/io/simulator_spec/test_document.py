"""Extended simulations as documents: what is written is read again, and simulates the same."""

import json
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target, evaluate_fit
from islands.discrepancy.calibration.preparation import count_fitted_samples, make_context, select_effects
from islands.discrepancy.diagnosis import diagnose
from islands.discrepancy.effects import CATALOGUE, catalogue_order
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.saved_extension import SavedExtension
from islands.errors import ModelError, SettingsError
from islands.io.export.extension import as_json
from islands.io.simulator_spec.document import describe_extension, extended_document, extended_json
from islands.io.simulator_spec.factory import make_simulator, simulate_spec
from islands.io.simulator_spec.specification import LocalExtendedSpec, ModelSpec, innermost, parse_spec
from support.simulated_records import Made, made

KINDS = list(made())

#: Those whose effects are simulated one by one at the fast level.
FAST = ("bouc-wen-piezo", "column", "extended")

#: Samples after which a model does not know any more where it began.
FORGOTTEN = 100


@pytest.fixture(params=KINDS)
def asked(request: pytest.FixtureRequest) -> Made:
    return made()[request.param]


def extended(asked: Made, effects: list[Effect]) -> CalibrationResult:
    """Put effects into a simulation, at points that a search would begin from."""
    core = asked.simulator
    fitted = count_fitted_samples(asked.record)
    scene = make_context(asked.record, core, fitted)
    simulation_ = ExtendedSimulator(core, catalogue_order(effects), scene)
    values = simulation_.nominal
    residual = 0.01 * scene.output_peak * np.sin(2 * np.pi * 7.3 * scene.time)
    for effect in simulation_.effects:
        point = effect.starting_points(scene, residual)[0]
        values[simulation_.get_slice(effect)] = point
    target = Target(asked.record.y, np.arange(asked.record.samples) < fitted, None, {})
    return evaluate_fit(simulation_, target, values)


def known(asked: Made) -> list[Effect]:
    """Return the effects that the simulation may get."""
    core = asked.simulator
    scene = make_context(asked.record, core, count_fitted_samples(asked.record))
    return select_effects(core, scene, {})


def chosen(asked: Made) -> list[Effect]:
    """Return an effect of each site that the simulation has."""
    sites: dict[object, Effect] = {}
    for effect in fixed(asked, known(asked)):
        sites.setdefault(effect.site, effect)
    return list(sites.values())


def begins(simulation_: ExtendedSimulator) -> bool:
    return any(parameter.initial for parameter in simulation_.parameters)


def simulates_the_same(asked: Made, fit: CalibrationResult) -> None:
    """Hold what a document simulates against what was written into it.

    To rounding; where states at the first sample are fitted anew, on the record that it would have made.
    """
    document = json.loads(extended_json(fit, asked.record))
    fitted = begins(fit.simulation)
    record = replace(asked.record, y=fit.output) if fitted else asked.record
    found = simulate_spec(document, record, asked.columns)
    rel, behind = 1e-5 if fitted else 1e-12, slice(None)
    if isinstance(innermost(asked.spec), ModelSpec):
        # It begins at the measured samples, which are others in another record, and forgets them.
        rel, behind = 1e-3, slice(FORGOTTEN, None)
    assert found[behind] == pytest.approx(fit.output[behind], abs=rel * float(np.max(np.abs(fit.output))))


def fixed(asked: Made, effects: Iterable[Effect]) -> list[Effect]:
    """Return effects without a state at the first sample.

    Simulations that begin at the measured output begin elsewhere on another record.
    """
    core = asked.simulator
    scene = make_context(asked.record, core, count_fitted_samples(asked.record))
    return [
        effect for effect in effects if not any(parameter.initial for parameter in effect.parameters(scene))
    ]


def test_what_is_written_simulates_the_same(asked: Made) -> None:
    simulates_the_same(asked, extended(asked, chosen(asked)))


@pytest.mark.parametrize(
    "asked",
    [kind if kind in FAST else pytest.param(kind, marks=pytest.mark.ci) for kind in KINDS],
    indirect=True,
)
def test_each_effect_by_itself_simulates_the_same(asked: Made) -> None:
    found = fixed(asked, known(asked))
    if begins(ExtendedSimulator(asked.simulator, (), extended(asked, []).simulation.context)):
        found = found[::6]  # each is a fit
    for effect in found:
        simulates_the_same(asked, extended(asked, [effect]))


def test_a_state_of_an_effect_at_the_first_sample_is_fitted() -> None:
    asked, effect = made()["bouc-wen-piezo"], CATALOGUE["second-hysteresis"]
    fit = extended(asked, [effect])
    values = fit.values.copy()
    values[fit.simulation.get_slice(effect)] = (0.2, 0.05, 0.0, 8.0)
    simulates_the_same(asked, replace(fit, values=values, output=fit.simulation.simulate(values)))


def test_what_is_read_is_written_as_it_was(asked: Made) -> None:
    text = extended_json(extended(asked, chosen(asked)), asked.record)
    spec = LocalExtendedSpec.model_validate(json.loads(text))
    assert as_json(spec) == text
    core = make_simulator(spec, asked.record, asked.columns)
    assert isinstance(core, SavedExtension)
    values = np.array([parameter.nominal for parameter in core.parameters])
    assert as_json(describe_extension(core, values, spec.inputs, spec.output)) == text


def test_a_file_of_it_is_a_model_like_any_other(asked: Made, tmp_path) -> None:
    text = extended_json(extended(asked, chosen(asked)[:1]), asked.record)
    path = tmp_path / "extended.json"
    path.write_text(text)
    assert as_json(parse_spec(f"model:{path}")) == text


def test_with_other_effects_in_it_it_is_extended_once_more(asked: Made) -> None:
    """An extension of an extension holds all of them, at the values that they have."""
    first, *_ = chosen(asked)
    spec = LocalExtendedSpec.model_validate(json.loads(extended_json(extended(asked, [first]), asked.record)))
    outer = Made(spec, asked.record, asked.columns)
    core = outer.simulator
    assert first.name in core.built_in_effects
    further = [each for each in fixed(outer, known(outer)) if each.name != first.name][:1]
    simulates_the_same(outer, extended(outer, further))


@pytest.mark.parametrize(
    ("kind", "name", "point"),
    [
        pytest.param("column", "jump", (1.0, 2.0), marks=pytest.mark.ci),
        pytest.param("bouc-wen-piezo", "even-nonlinearity", (1e-3,), marks=pytest.mark.nightly),
        pytest.param("linear", "delay", (0.02,), marks=pytest.mark.nightly),
    ],
)
def test_diagnosed_again_it_lacks_nothing(kind: str, name: str, point: tuple[float, ...]) -> None:
    asked = made()[kind]
    fit = extended(asked, [CATALOGUE[name]])
    values = fit.values.copy()
    values[fit.simulation.get_slice(CATALOGUE[name])] = point
    y = fit.simulation.simulate(values)
    noise = 0.02 * y.std() * np.random.default_rng(21).standard_normal(y.size)
    record = replace(asked.record, y=y + noise)
    found = diagnose(record, asked.simulator)
    assert [each.name for each in found.effects][:1] == [name]
    spec = LocalExtendedSpec.model_validate(extended_document(found.best, record))
    second = diagnose(record, make_simulator(spec, record, asked.columns))
    assert [each.name for each in second.effects if each.explained_fraction is not None] == []
    assert second.verdict in ("nothing", "named")


WRONG = {
    "an unknown effect": (
        lambda document: document["effects"][0].update(name="wormhole"),
        ModelError,
        "knows no effect 'wormhole'",
    ),
    "an effect without a value": (
        lambda document: document["effects"][0]["parameters"].clear(),
        ModelError,
        "effect cubic-stiffness has no value for k: diagnose again",
    ),
    "no such parameter": (
        lambda document: document["core"]["parameters"].update(mass=1.0),
        SettingsError,
        "there is no parameter mass: the parameters are m, c, k",
    ),
    "no core": (lambda document: document.pop("core"), ValidationError, "core\n"),
    "no such core": (lambda document: document["core"].update(kind="pendulum"), ValidationError, "pendulum"),
    "no such hold": (lambda document: document.update(hold="third-order"), ValidationError, "hold\n"),
    "no steps": (lambda document: document.update(times=0), ValidationError, "times\n"),
    "too many steps": (lambda document: document.update(times=10**6), ValidationError, "times\n"),
    "no peak": (lambda document: document["scales"].update(input_peak=0.0), ValidationError, "input_peak\n"),
    "no number": (
        lambda document: document["effects"][0]["parameters"]["k"].update(value="x"),
        ValidationError,
        "value\n",
    ),
    "something else": (lambda document: document.update(effect=[]), ValidationError, "effect\n"),
    "of another version": (
        lambda document: document.update(schema="islands.extended/2"),
        ValidationError,
        "schema\n",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_with_a_document_is_said(case: str) -> None:
    spoil, kind, words = WRONG[case]
    asked = made()["second-order"]
    document = extended_document(extended(asked, [CATALOGUE["cubic-stiffness"]]), asked.record)
    spoil(document)
    with pytest.raises(kind) as refused:
        simulate_spec(document, asked.record)
    assert words in str(refused.value)

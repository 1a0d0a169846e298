"""Discovery: terms that equations lack are found, and named effects and noise are not replaced by terms."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import islands
from islands.diagnosis.calibration.intersample_selection import get_discretisation
from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.calibration.record_simulation import simulate_spec
from islands.diagnosis.discovery import term_search
from islands.diagnosis.discovery.candidate_terms import (
    MAX_MULTIPLIED_SIGNALS,
    list_candidate_terms,
    shifts_in_time,
)
from islands.diagnosis.discovery.term_search import TermSearchResult, search_terms
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.result import Diagnosis
from islands.diagnosis.run import DiagnosisRun
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Effect
from islands.export.fmu import find_compiler
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.kernels.lagrange import interpolate_at
from islands.records.dataset import Dataset
from islands.report.documents.diagnosis_json import diagnosis_document
from islands.report.documents.extension import extended_json
from islands.report.pages.diagnosis import diagnosis_report
from islands.report.pages.origin import Origin
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.intersample import InterSample
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import LocalExtendedSpec
from support.equation_programs import run_c

DT = 0.01

#: Integration steps per sample; the simulation of the analysis uses fewer.
STEPS = 10

DOCUMENT = {
    "name": "oscillator",
    "input": "F",
    "output": "x",
    "equations": "dx/dt = v\ndv/dt = (F - c*v - k*x - force)/m\n",
    "parameters": {"m": {"value": 1.05}, "c": {"value": 1.8}, "k": {"value": 105.0}},
    "states": {"x": {"unit": "m"}, "v": {"unit": "m/s"}},
    "force": {"coordinate": "x", "rate": "v"},
}

Law = Callable[[float, float, float], float]

#: Forces that resist the motion, and the terms of dv/dt with their coefficients; m is 1.
LAWS: dict[str, tuple[Law, str, float]] = {
    "van der Pol": (lambda x, v, _u: 40.0 * x * x * v, "x**2*v", -40.0),
    "product": (lambda x, v, _u: 6.0 * x * v, "x*v", -6.0),
    "bilinear": (lambda x, _v, u: 0.5 * x * u, "x*F", -0.5),
    "fifth power": (lambda x, _v, _u: 2000.0 * x**5, "x**5", -2000.0),
}


def simulate(law: Callable[..., float], samples: int = 1200, seed: int = 1, timed: bool = False) -> Dataset:
    """Simulate an oscillator with an additional force by the midpoint rule, with noise of one per cent.

    A timed law also reads the time.
    """
    rng = np.random.default_rng(seed)
    time = DT * np.arange(samples)
    frequencies = rng.uniform(0.2, 3.0, 12)
    u = 12.0 * np.sin(2 * np.pi * np.outer(time, frequencies) + rng.uniform(0, 6.3, 12)).sum(axis=1)
    u *= np.minimum(1.0, time)
    # The force at the middle of each step; it is linear between samples.
    fine = np.interp(DT / STEPS * (0.5 + np.arange(samples * STEPS)), time, u)
    x = v = 0.0
    y = np.empty(samples * STEPS)
    h = DT / STEPS
    for k, force in enumerate(fine):
        y[k] = x
        instant = (k * h,) if timed else ()
        middle_x = x + h / 2 * v
        middle_v = v + h / 2 * (force - 2.0 * v - 100.0 * x - law(x, v, force, *instant))
        x, v = (
            x + h * middle_v,
            v + h * (force - 2.0 * middle_v - 100.0 * middle_x - law(middle_x, middle_v, force, *instant)),
        )
    y = y[::STEPS]
    noise = 0.01 * np.std(y) * rng.standard_normal(samples)
    return Dataset(u, y + noise, DT, ("F_N",), output_name="x_m", input_units=("N",), output_unit="m")


def search(
    law: Callable[..., float],
    timed: bool = False,
    effects: tuple[Effect, ...] = (),
    delay: float = 0.0,
    sought: tuple[Effect, ...] = (),
) -> TermSearchResult | None:
    """Search for terms in a record whose input acts later than it is recorded, by a part of a sample."""
    record = simulate(law, timed=timed)
    u = interpolate_at(record.u[:, 0], np.arange(record.samples) + delay)
    record = replace(record, u=u[:, None])
    simulator = make_simulator(OdeSpec.model_validate({"kind": "ode", **DOCUMENT}), record)
    fitted = count_fitted_samples(record)
    simulation = ExtendedSimulator(simulator, effects, make_context(record, simulator, fitted))
    target = make_target(record, fitted, {})
    run = DiagnosisRun().with_effects(sought)
    return search_terms(calibrate(simulation, target, simulation.nominal), target, run)


@pytest.mark.ci
@pytest.mark.parametrize("name", LAWS)
def test_missing_term_is_found_with_its_coefficient(name: str) -> None:
    law, text, coefficient = LAWS[name]
    found = search(law)
    assert found is not None
    assert [(each.term.target, each.term.text) for each in found.terms] == [("v", text)]
    values = {
        parameter.name: value
        for parameter, value in zip(found.fit.simulation.parameters, found.fit.values, strict=True)
    }
    assert values[found.terms[0].parameters[0]] == pytest.approx(coefficient, rel=0.05)
    assert text in found.describe()


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("text", "expected", "law"),
    [
        ("tanh(x/{scale})", 0.1, lambda x, _v, _u: 20.0 * np.tanh(x / 0.1)),
        ("sign(v)*exp(-(v/{scale})**2)", 1.0, lambda _x, v, _u: 6.0 * np.tanh(v / 0.01) * np.exp(-(v**2))),
    ],
)
def test_saturation_and_stribeck_curve_are_found_with_their_scale(
    text: str, expected: float, law: Law
) -> None:
    found = search(law)
    assert found is not None
    assert [each.term.text for each in found.terms] == [text]
    scale = dict(zip((each.name for each in found.fit.simulation.parameters), found.fit.values, strict=True))
    assert scale["s1"] == pytest.approx(expected, rel=0.1)


@pytest.mark.nightly
@pytest.mark.parametrize("is_onset", [True, False])
def test_friction_in_a_part_of_the_time_is_found_with_its_instant(is_onset: bool) -> None:
    found = search(lambda _x, v, _u, t: 6.0 * np.tanh(v / 0.01) * ((t >= 5.2) == is_onset), timed=True)
    assert found is not None
    assert [each.term.text for each in found.terms] == ["sign(v)"]
    values = dict(zip((each.name for each in found.fit.simulation.parameters), found.fit.values, strict=True))
    assert values["a1"] == pytest.approx(-6.0, rel=0.03)
    assert values["s1"] == pytest.approx(5.2, abs=0.05)
    expected = "from t = s1 on" if is_onset else "until t = s1"
    assert found.terms[0].describe() == f"a1*(sign(v)) in dv/dt, {expected}"


@pytest.mark.ci
def test_rate_of_the_input_next_to_another_term_is_a_delay() -> None:
    law, text, coefficient = LAWS["van der Pol"]
    found = search(law, delay=0.4, sought=(CATALOGUE["delay"],))
    assert found is not None
    assert [each.term.text for each in found.terms] == [text]
    assert [each.name for each in found.effects] == ["delay"]
    names = [each.name for each in found.fit.simulation.parameters]
    values = dict(zip(names, found.fit.values, strict=True))
    # An input that is held acts half a sample later as well.
    intersample, _ = get_discretisation(found.fit.simulation.simulator)
    held = 0.5 * DT if intersample == InterSample.ZOH else 0.0
    assert values["tau"] + held == pytest.approx(0.4 * DT, rel=0.1)
    assert values[found.terms[0].parameters[0]] == pytest.approx(coefficient, rel=0.05)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(2))
def test_output_of_semi_implicit_euler_is_a_negative_delay(seed: int) -> None:
    """The output is recorded after the step, which begins with the input of the same row."""
    rng = np.random.default_rng([seed, 57])
    time = DT * np.arange(1500)
    waves = np.outer(rng.uniform(0.2, 4.0, 8), time) + rng.uniform(0.0, 1.0, (8, 1))
    u = np.sin(2.0 * np.pi * waves).sum(axis=0)
    x, v, y = 0.0, 0.0, np.empty(u.size)
    for k, force in enumerate(u):
        v += DT * (force - 4.0 * v - 400.0 * x)
        x += DT * v
        y[k] = x
    y += 0.01 * np.std(y) * rng.standard_normal(u.size)
    sought = [CATALOGUE[name] for name in ("delay", "sensor-lag", "resonance")]
    found = islands.diagnose(Dataset(u, y, DT), "second-order", effects=sought)
    assert [each.name for each in found.causes] == ["delay"]
    assert found.causes[0].parameters["tau"].value == pytest.approx(-DT, rel=0.1)


def test_only_rates_of_the_input_and_of_the_output_shift_in_time() -> None:
    system = OdeSpec.model_validate({"kind": "ode", **DOCUMENT}).make_system()
    candidates = list_candidate_terms(system, dict.fromkeys(("x", "v", "F", "rate(F)"), 1.0), 10.0, {})
    shifts = {(each.target, each.text) for each in candidates if shifts_in_time(each, system)}
    assert {("v", "rate(F)"), ("output", "rate(F)"), ("output", "v")} <= shifts
    # In equations with other terms, a delay may add functions of the rate of the input.
    assert all("rate(F)" in text for _, text in shifts - {("output", "v")})


def test_many_signals_have_no_products() -> None:
    names = [f"x{index}" for index in range(MAX_MULTIPLIED_SIGNALS)]
    equations = "".join(f"d{name}/dt = F - c*{name}\n" for name in names)
    document = {**DOCUMENT, "equations": equations, "parameters": {"c": 1.0}, "states": {}, "output": "x0"}
    system = OdeSpec.model_validate({"kind": "ode", **document, "force": None}).make_system()
    rates = [f"d{name}/dt" for name in names]
    sizes = dict.fromkeys([*names, *rates, "F", "rate(F)"], 1.0)
    texts = {each.text for each in list_candidate_terms(system, sizes, 10.0, {})}
    assert {"x0**2", "t*x7", "rate(F)*x3"} < texts
    assert not any("x0*x1" in text for text in texts)


@cache
def diagnose(name: str) -> Diagnosis:
    law = LAWS[name][0] if name in LAWS else lambda _x, v, _u: 1.5 * np.sign(v)
    return islands.diagnose(simulate(law), OdeSpec.model_validate({"kind": "ode", **DOCUMENT}))


@pytest.mark.nightly
def test_discovered_equations_are_the_diagnosis_if_no_effect_explains_as_much() -> None:
    found = diagnose("bilinear")
    assert found.verdict == Verdict.DISCOVERED
    assert found.discovery is not None
    assert found.discovery.worse_by > 9.0
    assert found.gain is not None
    assert found.gain.ci95[0] > 0.0
    (value,) = found.effects[0].parameters.values()
    assert value.ci95 is not None
    assert value.ci95[0] < -0.5 < value.ci95[1]
    document = diagnosis_document(found)
    assert document["discovered"]["equations"].startswith("dv/dt = ")
    said = DiagnosisResult.from_diagnosis(found).summary
    assert "dv/dt = (F - c*v - k*x)/m + a1*(x*F)" in said
    assert "a1 = -0.4" in said.partition("Its values: ")[2]
    assert b"x*F" in diagnosis_report(Origin("record"), found)


@pytest.mark.nightly
def test_named_effect_wins_over_terms_that_explain_as_much() -> None:
    found = diagnose("dry friction")
    assert [each.name for each in found.effects][:1] == ["coulomb-friction"]
    assert found.discovery is None


def add_jump(record: Dataset, size: float) -> Dataset:
    """Add a jump of the output at two fifths of the record, in standard deviations of the output."""
    jump = size * np.std(record.y) * (np.arange(record.samples) > 0.4 * record.samples)
    return replace(record, y=record.y + jump)


@cache
def diagnose_with_jump(name: str) -> Diagnosis:
    spec = OdeSpec.model_validate({"kind": "ode", **DOCUMENT})
    return islands.diagnose(add_jump(simulate(LAWS[name][0]), 0.05), spec)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["bilinear", "fifth power"])
def test_effect_and_missing_term_are_found_together(name: str) -> None:
    found = diagnose_with_jump(name)
    assert found.verdict == Verdict.DISCOVERED
    assert sorted(each.name for each in found.effects) == ["jump", "missing-term"]
    assert found.discovery is not None
    assert LAWS[name][1] in found.discovery.equations
    assert "jump" not in found.discovery.nearest
    values = {each.name: next(iter(each.parameters.values())) for each in found.effects}
    assert values["missing-term"].value == pytest.approx(LAWS[name][2], rel=0.05)
    assert values["jump"].value == pytest.approx(0.05 * np.std(simulate(LAWS[name][0]).y), rel=0.1)
    assert np.sqrt(found.best.mean_square) < 1.05 * found.noise_floor


@pytest.mark.ci
@pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc")
def test_extension_by_a_term_and_an_effect_is_simulated_and_exported(tmp_path: Path) -> None:
    found = diagnose_with_jump("bilinear")
    document = json.loads(extended_json(found.best, found.record))
    other = add_jump(simulate(LAWS["bilinear"][0], seed=2), 0.05)
    assert np.std(other.y - simulate_spec(document, other)) < 0.02 * np.std(other.y)
    program = run_c(LocalExtendedSpec.model_validate(document), found.record, tmp_path)
    np.testing.assert_allclose(program, found.best.output, atol=1e-9)


@pytest.mark.ci
def test_no_term_is_fitted_to_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    fitted: list[object] = []
    calibrate_all = term_search.calibrate_all

    def count(calibrator, tasks, parallel_map):
        fitted.extend(tasks)
        return calibrate_all(calibrator, tasks, parallel_map)

    monkeypatch.setattr(term_search, "calibrate_all", count)
    assert search(lambda _x, _v, _u: 0.0) is None
    assert not fitted
    assert search(LAWS["fifth power"][0]) is not None
    assert fitted

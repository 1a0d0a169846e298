"""Next experiment: the input separates what a record does not, within what the record has shown or beyond."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import count_fitted_samples, make_target
from islands.diagnosis.inference.screening import ScreenedEffect
from islands.diagnosis.planning.next_experiment import NextExperiment, design_next_experiment
from islands.effects.interface.context import Signal
from islands.records.dataset import Dataset
from islands.report.documents.plan_json import (
    describe_next_experiment,
    get_suggested_input,
    write_advice,
)
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.external import RecordedOutput
from islands.simulators.interface import Simulator
from support.planned import DT, amplifier, input_record, take_effects, wave

#: A delay in seconds, and the standard deviation of the noise.
DELAY, NOISE = 0.03, 0.05


def measure(u: Signal, seed: int = 0) -> Dataset:
    """Return the record of an amplifier with a delay."""
    t = DT * np.arange(u.size)
    y = 2.0 * np.interp(t - DELAY, t, u) + NOISE * np.random.default_rng(seed).standard_normal(u.size)
    return replace(input_record(u), y=y)


def design(u: Signal, simulator: Simulator | None = None, names: tuple[str, ...] = ("sensor-lag",)) -> object:
    """Design the experiment that separates a delay from other causes."""
    record, simulator = measure(u), simulator or amplifier()
    fitted = count_fitted_samples(record)
    target, context = make_target(record, fitted, {}), make_context(record, simulator, fitted)
    found = []
    for effect in take_effects("delay", *names):
        simulation = ExtendedSimulator(simulator, (effect,), context)
        found.append(ScreenedEffect(effect, calibrate(simulation, target, simulation.nominal + 0.02)))
    return design_next_experiment(record, found[0].fit, found[1:], target)


def designed(u: Signal) -> NextExperiment:
    experiment = design(u)
    assert isinstance(experiment, NextExperiment)
    return experiment


def test_a_slow_record_needs_a_faster_input_and_the_document_says_by_how_much() -> None:
    experiment = designed(wave((0.25,)))
    assert experiment.input is not None
    assert not experiment.input.is_within
    ((pair,), chosen) = (experiment.pairs, experiment.input)
    assert pair.causes == ("delay", "sensor-lag")
    assert pair.recorded is not None
    assert pair.predicted is not None
    assert pair.recorded.sufficiency < 1.0 <= pair.predicted.sufficiency
    range_excess, rate_excess = chosen.excess
    assert (range_excess, chosen.dt) == (pytest.approx(1.0), DT)
    assert f"a rate {rate_excess:.3g} times that of the record" in write_advice(experiment)
    document = describe_next_experiment(experiment)["input"]
    assert document["limits"]["rate"] == pytest.approx(rate_excess * document["recorded_limits"]["rate"])


def test_a_record_with_a_fast_part_needs_no_input_beyond_it() -> None:
    u = wave((0.25,))
    u[150:154] = np.linspace(u[150], -1.0, 4)
    experiment = designed(u)
    assert experiment.input is not None
    assert experiment.input.is_within
    (pair,) = experiment.pairs
    assert pair.recorded is not None
    # The record itself separates the causes.
    assert pair.recorded.sufficiency >= 1.0
    assert not write_advice(experiment)
    assert describe_next_experiment(experiment)["input"] is None
    assert get_suggested_input(experiment) is None
    slow = replace(pair, recorded=replace(pair.recorded, distance=0.0))
    advice = write_advice(replace(experiment, pairs=(slow,)))
    assert "within the range and the rate of the record" in advice


def test_a_recorded_simulation_predicts_no_other_input() -> None:
    u = wave((0.25,))
    experiment = design(u, RecordedOutput("theirs", 2.0 * u))
    assert isinstance(experiment, NextExperiment)
    assert experiment.input is None
    assert "depends on this record" in write_advice(experiment)


@pytest.mark.nightly
def test_a_diagnosis_of_the_designed_experiment_names_the_cause_alone() -> None:
    """The prediction holds: causes that it separates are no equivalents in the new record."""
    t = DT * np.arange(2000)
    slow = measure(np.sin(2 * np.pi * 0.25 * t) + 0.3 * np.sin(2 * np.pi * 0.4 * t), seed=1)
    first = islands.diagnose(slow, amplifier())
    assert "sensor-lag" in first.effects[0].equivalents
    assert first.next_experiment is not None
    assert first.next_experiment.input is not None
    again = islands.diagnose(measure(first.next_experiment.input.u, seed=2), amplifier())
    separated = {
        pair.causes[1]
        for pair in first.next_experiment.pairs
        if pair.predicted is not None and pair.predicted.sufficiency >= 1.0
    }
    assert separated
    assert again.effects[0].name == "delay"
    assert not separated & set(again.effects[0].equivalents)

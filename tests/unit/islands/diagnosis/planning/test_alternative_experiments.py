"""Changes of an experiment: order of costs, limits, and further channels of written equations."""

import numpy as np
import pytest

from islands.diagnosis.planning.alternative_experiments import (
    Cost,
    choose_cheapest,
    compare_alternatives,
    list_state_channels,
)
from islands.diagnosis.planning.experiment_setup import make_experiment
from islands.diagnosis.planning.pair_separation import CausePair, separate_pairs
from islands.diagnosis.planning.planned_input import InputLimits
from islands.simulators.specification.factory import make_simulator
from support.planned import (
    amplifier_experiment,
    coloured_noise,
    input_record,
    make_cause,
    make_pair,
    wave,
    with_noise,
)
from support.repository import ROOT


@pytest.mark.ci
def test_changes_are_sorted_by_cost_and_a_faster_input_separates_delay_from_lag() -> None:
    experiment = amplifier_experiment(wave((0.25,)))
    pair = make_pair(experiment, "delay", "sensor-lag")
    found = compare_alternatives(experiment, pair, InputLimits(-2.0, 2.0))
    costs = [each.cost for each in found]
    assert costs == sorted(costs)
    assert found[0].change == "as given"
    assert found[0].separation.sufficiency < 1.0
    cheapest = choose_cheapest(found)
    assert cheapest is not None
    assert cheapest.cost == Cost.INPUT
    by_change = {each.change: each.separation.distance for each in found}
    assert by_change["the same input 16 times as fast"] > by_change["as given"]
    assert "the same input 2 times as large" in by_change


@pytest.mark.ci
def test_another_state_separates_a_sensor_from_the_process() -> None:
    record = input_record(3.0 * wave((1.0, 3.0), 400, 0.002), 0.002)
    simulator = make_simulator(f"ode:{ROOT}/examples/simulations/dc-motor.toml", record)
    experiment, effects = make_experiment(record, simulator, 0.5, {})
    states = {channel.name: channel for channel in list_state_channels(experiment)}
    assert set(states) == {"i", "phi"}
    slow = with_noise(experiment, coloured_noise(0.1, 0.9))
    for channel in list_state_channels(slow):
        assert channel.noise.model.coefficients == pytest.approx([0.9])
        relative = slow.noise.std / slow.context.output_peak
        assert channel.noise.std == pytest.approx(relative * channel.context.output_peak)
    assert states["i"].unit == "A"
    offset = next(effect for effect in effects if effect.name == "input-offset:i")
    other = next(effect for effect in effects if effect.name == "input-offset:omega")
    pair = CausePair(make_cause(experiment, offset), make_cause(experiment, other))
    before, after = (
        separate_pairs(each, [pair])[0] for each in (experiment, experiment.with_channel(states["i"]))
    )
    assert before.sufficiency < 1.0 < after.sufficiency
    assert np.isfinite(after.distance)

"""Every simulator: the simulation of joined recordings is that of each recording, bit for bit."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy

from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import SimulationContext
from islands.effects.interface.effect import Effect
from islands.records.dataset import Dataset, join
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import LinearSpec
from support.simulated_records import SAMPLES, made, names

pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("toy_class")]

#: First sample of every recording, and the sample after the last.
EDGES = (0, 250, 330, SAMPLES)

#: Effects with memory: those of a recording must not reach into the next one.
WITH_MEMORY = ("delay", "backlash", "second-hysteresis", "exponential-creep", "sensor-lag", "resonance")

PARTS = [slice(*edges) for edges in pairwise(EDGES)]


def make_simulation(name: str, part: slice, context: SimulationContext | None = None) -> ExtendedSimulator:
    """Make the simulation of a part of the record with effects, from the samples of that part alone."""
    spec, record, columns = made()[name].spec, made()[name].record[part], made()[name].columns
    simulator = make_simulator(spec, record, {key: values[part] for key, values in columns.items()})
    if name == "bouc-wen-piezo":
        simulator = ResampledSimulator(simulator, InterSample.BAND_LIMITED, 4)
    effects = [CATALOGUE[each] for each in WITH_MEMORY]
    supported = tuple(effect for effect in effects if effect.site in simulator.sites)
    if context is None:
        context = make_context(record, simulator, record.samples)
    return ExtendedSimulator(simulator, supported, context)


def draw_values(effect: Effect, context: SimulationContext) -> tuple[float, ...]:
    return effect.starting_points(context, np.zeros(context.u.size))[-1]


def take_part(record: Dataset) -> list[Dataset]:
    return [replace(record[part], start=0.0) for part in PARTS]


@pytest.mark.parametrize("name", names())
def test_simulation_of_joined_recordings_is_that_of_each(name: str) -> None:
    record, columns = made()[name].record, made()[name].columns
    alone = make_simulation(name, slice(0, SAMPLES))
    joined = join(tuple(take_part(record)))
    simulator = make_simulator(made()[name].spec, joined, columns)
    if name == "bouc-wen-piezo":
        simulator = ResampledSimulator(simulator, InterSample.BAND_LIMITED, 4)
    scales = replace(alone.context, segments=joined.segments)
    whole = ExtendedSimulator(simulator, alone.effects, scales)
    rng = np.random.default_rng(1)
    values = whole.nominal + 0.1 * whole.scales * rng.standard_normal(whole.scales.size)
    for effect in whole.effects:
        values[whole.get_slice(effect)] = whole.expand(effect, draw_values(effect, scales))
    values = np.clip(values, *whole.bounds)
    names = [parameter.name for parameter in whole.parameters]
    expected = []
    for number, part in enumerate(PARTS, start=1):
        context = replace(scales, u=scales.u[part], segments=(), reference_duration=scales.duration)
        single = make_simulation(name, part, context)
        if name == "rigid-axis":
            # The steps of its finite differences are relative to the sizes of the states, and the number of
            # integration steps depends on the estimated friction.
            same = replace(simulator, shots=single.simulator.shots)  # type: ignore[type-var, attr-defined]
            single = replace(single, simulator=same)
        own = values[[not each.endswith(")") for each in names]]
        is_initial = np.array([each.initial for each in single.parameters], dtype=bool)
        if number > 1:
            own[is_initial] = values[[each.endswith(f" (recording {number})") for each in names]]
        expected.append(single.simulate(own))
    assert np.isfinite(np.concatenate(expected)).all()
    assert whole.simulate(values).tolist() == np.concatenate(expected).tolist()


@pytest.mark.parametrize("name", names())
def test_one_segment_is_a_single_recording(name: str) -> None:
    alone = make_simulation(name, slice(0, SAMPLES))
    given = replace(alone, context=replace(alone.context, segments=(SAMPLES,)))
    assert given.parts == ()
    assert given.parameters == alone.parameters
    assert given.simulate(given.nominal).tolist() == alone.simulate(alone.nominal).tolist()


@pytest.mark.parametrize(
    "name", ["linear-drift", "jump", "periodic-disturbance", "thermal-drift", "cross-coupling"]
)
def test_time_and_the_reference_of_a_channel_are_common_to_all_recordings(name: str) -> None:
    rng = np.random.default_rng(2)
    # Either channel is constant in the first recording, and the other one comes before it.
    channels = {"w_V": rng.standard_normal(SAMPLES), "T_K": 300.0 + rng.standard_normal(SAMPLES)}
    for signal in channels.values():
        signal[: EDGES[1]] = signal[0]
    context = SimulationContext(
        *(rng.standard_normal(SAMPLES), 0.01, channels, {"w_V": "V", "T_K": "K"}),
        *(1.0, 1.0, "V", "um", 4.5, None, SAMPLES * 0.01),
        segments=tuple(part.stop - part.start for part in PARTS),
    )
    effect, y = CATALOGUE[name], np.ones(SAMPLES)
    values = np.array(effect.starting_points(context, rng.standard_normal(SAMPLES))[-1])
    parts = [effect.form(y[part], values, each) for part, each in zip(PARTS, context.split(), strict=True)]
    assert np.concatenate(parts) == pytest.approx(effect.form(y, values, context), rel=1e-12)
    assert np.ptp(np.concatenate(parts)) > 0.0


def test_recordings_of_a_linear_model_have_one_level_at_any_first_input() -> None:
    u = 3.0 + np.sign(np.sin(0.2 * np.arange(SAMPLES)))
    y = scipy.signal.lfilter([0.2], [1.0, -0.8], u)
    record = Dataset(u[:, None], y, 0.01)[50:]
    cut = next(place for place in range(300, SAMPLES) if record.u[place, 0] != record.u[0, 0])
    joined = join((replace(record[:cut], start=0.0), replace(record[cut:], start=0.0)))
    simulator = make_simulator(LinearSpec(kind="linear", order=1), joined, {})
    simulation = ExtendedSimulator(simulator, (), make_context(joined, simulator, joined.samples))
    settled = slice(cut + 40, None)
    assert simulation.simulate(simulation.nominal)[settled] == pytest.approx(joined.y[settled], abs=1e-3)

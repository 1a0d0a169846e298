"""Shipped equations in records with channels: each effect and each error of a channel gets a verdict."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.procedure import diagnose
from islands.effects.catalogue import EFFECTS
from islands.effects.interface.context import Signal
from islands.errors import IslandsError
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator
from support.simulated_records import EQUATIONS, wave

SAMPLES = 400

#: Sampling time, size of the input, and units of input and output of each example.
SIGNALS = {
    "axis-speed": (0.01, 40.0, "N", "m/s"),
    "bouc-wen-piezo": (0.01, 40.0, "V", "um"),
    "cascaded-tanks": (4.0, 3.0, "V", "V"),
    "dc-motor": (2e-3, 12.0, "V", "rad/s"),
    "hydraulic-actuator": (2e-3, 2.0, "V", "m"),
    "second-order": (0.01, 40.0, "N", "m"),
    "thermal-process": (1.0, 60.0, "W", "degC"),
    "two-mass": (0.01, 40.0, "N", "m/s"),
}

#: The example that every change diagnoses, which reads a channel.
ESSENTIAL = "thermal-process"

ROOM = 20.0 + 3.0 * np.sin(0.1 * np.arange(SAMPLES))
PRESSURE = 5.0 * np.sign(np.sin(0.23 * np.arange(SAMPLES)))

#: Places of the channels among the inputs.
CHANNELS = {"thermal-drift": 1, "cross-coupling": 2}


def simulate_record(name: str) -> Dataset:
    """Return the record of an example with white noise, a room temperature and a further channel."""
    dt, size, input_unit, output_unit = SIGNALS[name]
    is_positive = name in ("cascaded-tanks", "thermal-process")
    u = size * (0.8 + wave(SAMPLES) / 50 if is_positive else wave(SAMPLES) / 50)
    record = Dataset(
        u=np.column_stack([u, ROOM, PRESSURE]),
        y=np.full(SAMPLES, 20.0 if output_unit == "degC" else 5.0 if is_positive else 0.0),
        dt=dt,
        input_names=("drive", "room_degC", "p_hPa"),
        input_units=(input_unit, "degC", "hPa"),
        output_name="y",
        output_unit=output_unit,
    )
    simulator = make_simulator(f"ode:{EQUATIONS / name}.toml", record)
    simulation = ExtendedSimulator(simulator, (), make_context(record, simulator, SAMPLES))
    y = simulation.simulate(simulation.nominal)
    return replace(record, y=y + 0.01 * np.std(y) * np.random.default_rng(3).standard_normal(SAMPLES))


def couple(record: Dataset, effect: str) -> Dataset:
    """Return the record with an output that a channel couples into, half as large as the output itself."""
    channel = record.u[:, CHANNELS[effect]]
    return replace(record, y=record.y + 0.5 * np.std(record.y) / np.std(channel) * (channel - channel[0]))


def exchange(record: Dataset, first: int, second: int) -> Dataset:
    """Return the record with the values of two columns exchanged; the output is the last one."""
    columns = np.column_stack([record.u, record.y])
    columns[:, [first, second]] = columns[:, [second, first]]
    return replace(record, u=columns[:, :-1], y=columns[:, -1])


EXAMPLES = [
    pytest.param(path.stem, marks=pytest.mark.ci if path.stem == ESSENTIAL else pytest.mark.nightly)
    for path in sorted(EQUATIONS.glob("*.toml"))
]


@pytest.mark.parametrize(
    "places", [(0, 1), (0, 3), (1, 3)], ids=["drive-room", "drive-output", "room-output"]
)
@pytest.mark.parametrize("name", EXAMPLES)
def test_exchanged_columns_are_found(name: str, places: tuple[int, int]) -> None:
    record = exchange(simulate_record(name), *places)
    simulator = make_simulator(f"ode:{EQUATIONS / name}.toml", record)
    tolerance = {each.name: 0.05 for each in simulator.parameters if not each.initial}
    found = diagnose(record, simulator, tolerance, catalogue=())
    if (name, places) == ("thermal-process", (0, 1)):  # 1 W and 1 K of the room have almost the same response
        assert found.effects[0].name == "wrong-parameter"
        return
    assert (found.verdict, found.effects[0].name) == (Verdict.GROSS_ERROR, "swapped-channels")


@pytest.mark.nightly
@pytest.mark.parametrize("effect", CHANNELS)
@pytest.mark.parametrize("name", EXAMPLES)
def test_effect_of_a_channel_is_named(name: str, effect: str) -> None:
    record = couple(simulate_record(name), effect)
    own = [each for each in EFFECTS if each.name in CHANNELS]
    found = diagnose(record, make_simulator(f"ode:{EQUATIONS / name}.toml", record), catalogue=own)
    assert found.verdict in (Verdict.NAMED, Verdict.REMAINDER)
    assert found.effects[0].name == effect


def change_column(record: Dataset, place: int, change: Callable[[Signal], Signal]) -> Dataset:
    """Return the record with another signal in a column; the output is the last one."""
    columns = np.column_stack([record.u, record.y])
    columns[:, place] = change(columns[:, place])
    return replace(record, u=columns[:, :-1], y=columns[:, -1])


#: Errors of a column.
ERRORS: dict[str, Callable[[Signal], Signal]] = {
    "offset": lambda signal: signal + 3.0 * np.std(signal),
    "gain": lambda signal: 1.5 * signal,
    "unit": lambda signal: 1e3 * signal,
    "sign": np.negative,
    "delay": lambda signal: np.concatenate([np.full(40, signal[0]), signal[:-40]]),
    "step": lambda signal: signal + np.where(np.arange(SAMPLES) < SAMPLES // 2, 0.0, 2.0 * np.std(signal)),
    "stuck": lambda signal: np.where(np.arange(SAMPLES) < SAMPLES // 3, signal, signal[SAMPLES // 3]),
    "constant": lambda signal: np.full(SAMPLES, signal[0]),
    "overflow": lambda signal: 1e200 * signal,
    "underflow": lambda signal: 1e-200 * signal,
}

#: Errors of the output, or of any column, that a sentence refuses.
REFUSED_OUTPUT, REFUSED = {"constant"}, {"overflow", "underflow"}


@pytest.mark.parametrize("place", [0, 1, 2, 3], ids=["drive", "room", "pressure", "output"])
@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize(
    "name",
    [pytest.param(path.stem, marks=pytest.mark.nightly) for path in sorted(EQUATIONS.glob("*.toml"))],
)
def test_error_of_a_column_has_a_diagnosis_or_a_sentence(name: str, error: str, place: int) -> None:
    record = change_column(simulate_record(name), place, ERRORS[error])
    own = [each for each in EFFECTS if each.name in CHANNELS]
    try:
        simulator = make_simulator(f"ode:{EQUATIONS / name}.toml", record)
        rmse, refusal = diagnose(record, simulator, catalogue=own).nominal_rmse, ""
    except IslandsError as refused:
        rmse, refusal = 0.0, str(refused)
    assert np.isfinite(rmse)
    assert bool(refusal) == (error in REFUSED or (place == 3 and error in REFUSED_OUTPUT)), refusal
    assert not refusal or [*record.input_names, record.output_name][place] in refusal

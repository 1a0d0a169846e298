"""Swapped channels: what a simulation reads stays in the record, and exchanged columns are named."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from islands.diagnosis.gross_errors.channel_corrections import correct_swapped_channels
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.records.dataset import Dataset
from islands.simulators.external import PythonFunctionSimulator
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator
from support.simulated_records import wave

DT, SAMPLES = 1.0, 500
TOLERANCE = {"gain": 0.05, "loss": 0.05, "tau": 0.05}
#: A heated tank in a room, through which water flows.
EQUATIONS = {
    "name": "tank",
    "input": "power",
    "channels": ["room", "water"],
    "output": "T",
    "equations": "dT/dt = (gain*power + loss*water - (T - room))/tau\n",
    "parameters": {"gain": {"value": 0.08}, "loss": {"value": -0.5}, "tau": {"value": 15.0}},
}
RNG = np.random.default_rng(7)
POWER = 300.0 + 4.0 * wave(SAMPLES)
ROOM = 20.0 + 5.0 * np.sin(np.arange(SAMPLES) / 37.0)
WATER = 6.0 + 3.0 * np.sign(np.sin(np.arange(SAMPLES) / 11.0))
OTHER = 400.0 + np.cumsum(RNG.normal(size=SAMPLES))


def simulate_tank(room: np.ndarray) -> np.ndarray:
    """Return the temperature of the tank by short Euler steps of linearly interpolated signals."""
    parts, value = 100, 30.0
    drive = np.interp(
        np.arange(SAMPLES * parts) / parts, np.arange(SAMPLES), 0.08 * POWER - 0.5 * WATER + room
    )
    output = np.empty(SAMPLES * parts)
    for step, level in enumerate(drive.tolist()):
        output[step] = value
        value += DT / parts / 15.0 * (level - value)
    return output[::parts]


NOISE = 0.05 * RNG.normal(size=SAMPLES)
RECORD = Dataset(
    u=np.column_stack([POWER, ROOM, WATER, OTHER]),
    y=simulate_tank(ROOM) + NOISE,
    dt=DT,
    input_names=("power_W", "room_degC", "water", "other_hPa"),
    input_units=("W", "degC", "", "hPa"),
    output_name="T_degC",
    output_unit="degC",
)


def run(record: Dataset) -> Diagnosis:
    simulator = make_simulator(OdeSpec.model_validate({"kind": "ode", **EQUATIONS}), record)
    return diagnose(record, simulator, TOLERANCE, catalogue=())


def exchange(first: int, second: int) -> Callable[[Dataset], Dataset]:
    """Return the exchange of two columns; the output is the last one."""

    def spoil(record: Dataset) -> Dataset:
        columns = np.column_stack([record.u, record.y])
        columns[:, [first, second]] = columns[:, [second, first]]
        return replace(record, u=columns[:, :-1], y=columns[:, -1])

    return spoil


def scale(place: int, factor: float) -> Callable[[Dataset], Dataset]:
    """Return the multiplication of one of the inputs by a factor."""
    return lambda record: replace(
        record, u=record.u * np.where(np.arange(record.inputs) == place, factor, 1.0)
    )


#: Injected error, its name, and the columns that its description names.
ERRORS: dict[str, tuple[Callable[[Dataset], Dataset], str, set[str]]] = {
    "input and channel": (exchange(0, 1), "swapped-channels", {"power_W", "room_degC"}),
    "channel and output": (exchange(1, 4), "swapped-channels", {"room_degC", "T_degC"}),
    "two channels": (exchange(1, 2), "swapped-channels", {"room_degC", "water"}),
    "channel and unused channel": (exchange(2, 3), "swapped-channels", {"water", "other_hPa"}),
    "input and unused channel": (exchange(0, 3), "swapped-channels", {"power_W", "other_hPa"}),
    "unit of a channel": (scale(2, 1e3), "input-unit", {"water"}),
    "sign of a channel": (scale(1, -1.0), "sign", {"room_degC"}),
}


@pytest.mark.ci
@pytest.mark.parametrize("case", ERRORS)
def test_gross_error_of_a_channel_that_the_simulation_reads_is_named(case: str) -> None:
    spoil, name, columns = ERRORS[case]
    found = run(spoil(RECORD))
    assert (found.verdict, found.effects[0].name) == (Verdict.GROSS_ERROR, name)
    description = found.record_findings[0].description
    assert {each for each in (*RECORD.input_names, RECORD.output_name) if each in description} == columns


def test_every_exchange_keeps_the_channels_that_the_simulation_reads() -> None:
    read = {"room_degC", "water"}
    corrections = list(correct_swapped_channels(RECORD, read))
    columns = {np.column_stack([each.record.u, each.record.y]).tobytes() for each in corrections}
    assert len(columns) == len(corrections) == 10  # every pair of five columns
    assert all(read <= set(each.record.input_names[1:]) for each in corrections)


@pytest.mark.ci
def test_correction_on_which_the_simulation_fails_is_rejected() -> None:
    def heat(u: np.ndarray, dt: float, gain: float = 1.0) -> np.ndarray:
        if (gain * u > 700.0).any():
            raise ValueError("too hot")
        return gain * u

    u, channel = wave(SAMPLES), 200.0 + 100.0 * np.sin(np.arange(SAMPLES) / 23.0)
    record = Dataset(
        u=np.column_stack([u, channel]),
        y=3.0 * channel,
        dt=DT,
        input_names=("u", "channel"),
        input_units=("", ""),
    )
    found = diagnose(record, PythonFunctionSimulator(heat, "heat"), catalogue=())
    assert found.verdict != Verdict.GROSS_ERROR

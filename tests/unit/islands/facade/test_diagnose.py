"""`islands.diagnose`: user-defined effects, and simulators from Python functions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import islands
from islands.effects import Effect, Parameter, Site
from islands.effects.interface.context import Signal, SimulationContext
from support import own_primitive


def _multiply(y: Signal, values: Signal, context: SimulationContext) -> Signal:
    temperature = context.channels["T_degC"]
    return y * (1.0 + values[0] * (temperature - temperature[0]))


def _coefficient(_context: SimulationContext) -> tuple[Parameter, ...]:
    return (Parameter("k", "1/K", 0.0, 0.001),)


def _start(_context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.005,),)


THERMAL_GAIN = Effect(
    name="thermal-gain",
    summary="The sensitivity of the sensor changes with the temperature: y (1 + k (T - T(0)))",
    family="change",
    site=Site.OUTPUT,
    parameters=_coefficient,
    starting_points=_start,
    form=_multiply,
    source="Doebelin, Measurement Systems, section 3",
)


@pytest.fixture(scope="module")
def record() -> tuple[islands.Dataset, Signal]:
    """Record of a sensor that is sensitive to the temperature, and the simulation without that."""
    rng = np.random.default_rng(3)
    time = 0.01 * np.arange(800)
    u = 6 * np.sin(2 * np.pi * 0.7 * time) * np.sin(2 * np.pi * 0.17 * time + 1)
    simulated = 0.8 * u
    temperature = 21.0 + 3.0 * np.sin(2 * np.pi * 0.3 * time)
    y = simulated * (1.0 + 0.01 * (temperature - 21.0)) + 0.02 * rng.standard_normal(time.size)
    return islands.Dataset(np.column_stack([u, temperature]), y, 0.01, ("u_V", "T_degC"), "y_um"), simulated


@pytest.mark.ci
def test_user_defined_effect_is_named(record: tuple[islands.Dataset, Signal]) -> None:
    data, simulated = record
    found = islands.diagnose(
        data, "column:theirs", columns={"theirs": simulated}, effects=(*islands.EFFECTS, THERMAL_GAIN)
    )
    (finding,) = found.effects
    assert finding.name == "thermal-gain"
    assert finding.parameters["k"].value == pytest.approx(0.01, rel=0.05)


def _proportional(u: Signal, dt: float, gain: float = 0.8) -> Signal:
    del dt
    return gain * u


@pytest.mark.ci
def test_function_simulator_is_diagnosed_like_the_function_of_a_file(
    record: tuple[islands.Dataset, Signal], tmp_path: Path
) -> None:
    data, _ = record
    file = tmp_path / "stage.py"
    file.write_text("def proportional(u, dt, gain=0.8):\n    return gain * u\n")
    found = islands.diagnose(data, islands.function_simulator(_proportional), effects=(THERMAL_GAIN,))
    same = islands.diagnose(data, f"python:{file}:proportional", effects=(THERMAL_GAIN,))
    assert [each.name for each in found.effects] == ["thermal-gain"]
    assert found.best.values.tolist() == same.best.values.tolist()


def test_simulator_of_the_user_derives_from_the_base_class(record: tuple[islands.Dataset, Signal]) -> None:
    with pytest.raises(islands.SettingsError, match=r"derive .* islands.Simulator"):
        islands.diagnose(record[0], _proportional)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="abstract"):
        islands.Simulator()  # type: ignore[abstract]


def test_function_simulator_takes_nominal_values_by_name() -> None:
    (parameter,) = islands.function_simulator(_proportional, gain=0.7).parameters
    assert (parameter.name, parameter.nominal) == ("gain", 0.7)
    with pytest.raises(islands.SettingsError, match="no parameter offset"):
        islands.function_simulator(_proportional, offset=1.0)


def test_model_with_a_primitive_of_the_user_is_diagnosed() -> None:
    data = own_primitive.record(400)
    model = own_primitive.law()
    measured = replace(data, y=data.y + 0.2 + 0.01 * np.random.default_rng(0).standard_normal(400))
    offset = tuple(effect for effect in islands.EFFECTS if effect.name == "offset")
    found = islands.diagnose(measured, model, effects=offset)
    (finding,) = found.effects
    (value,) = finding.parameters.values()
    assert value.value == pytest.approx(0.2, abs=0.02)

"""`islands.diagnose`: user-defined effects, and simulators from Python functions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import islands
from islands.discrepancy.interfaces.effect import Signal, SimulationContext
from support import own_primitive

PITCH = 2.0


def _error(y: Signal, values: Signal, _context: SimulationContext) -> Signal:
    return y + values[0] * np.sin(2 * np.pi * y / PITCH)


def _amplitude(context: SimulationContext) -> tuple[islands.Parameter, ...]:
    return (islands.Parameter("a", context.output_unit, 0.0, 0.01),)


def _start(_context: SimulationContext, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.1,),)


ENCODER_ERROR = islands.Effect(
    name="encoder-error",
    summary="The encoder errs periodically: y + a sin(2 pi y / p)",
    family="sensor",
    site=islands.Site.OUTPUT,
    parameters=_amplitude,
    starting_points=_start,
    form=_error,
    source="Birch, Optical fringe subdivision with nanometric accuracy, 1990",
)


@pytest.fixture(scope="module")
def record() -> tuple[islands.Dataset, Signal]:
    """Record of an encoder with a periodic error, and the simulation without it."""
    rng = np.random.default_rng(3)
    time = 0.01 * np.arange(800)
    u = 6 * np.sin(2 * np.pi * 0.7 * time) * np.sin(2 * np.pi * 0.17 * time + 1)
    simulated = 0.8 * u
    y = simulated + 0.15 * np.sin(2 * np.pi * simulated / PITCH) + 0.02 * rng.standard_normal(time.size)
    return islands.Dataset(u, y, 0.01, ("u_V",), "y_um"), simulated


def test_user_defined_effect_is_named(record: tuple[islands.Dataset, Signal]) -> None:
    data, simulated = record
    found = islands.diagnose(
        data, "column:theirs", columns={"theirs": simulated}, effects=(*islands.EFFECTS, ENCODER_ERROR)
    )
    (finding,) = found.effects
    assert finding.name == "encoder-error"
    assert finding.parameters["a"].value == pytest.approx(0.15, rel=0.05)


@pytest.mark.ci
def test_catalogue_is_the_default_and_is_not_changed(record: tuple[islands.Dataset, Signal]) -> None:
    data, simulated = record
    found = islands.diagnose(data, "column:theirs", columns={"theirs": simulated})
    assert "encoder-error" not in {each.name for each in found.candidates}
    assert len(islands.EFFECTS) == len({effect.name for effect in islands.EFFECTS})


def _proportional(u: Signal, dt: float, gain: float = 0.8) -> Signal:
    del dt
    return gain * u


def test_function_simulator_is_diagnosed_like_the_function_of_a_file(
    record: tuple[islands.Dataset, Signal], tmp_path: Path
) -> None:
    data, _ = record
    file = tmp_path / "stage.py"
    file.write_text("def proportional(u, dt, gain=0.8):\n    return gain * u\n")
    found = islands.diagnose(data, islands.function_simulator(_proportional), effects=(ENCODER_ERROR,))
    same = islands.diagnose(data, f"python:{file}:proportional", effects=(ENCODER_ERROR,))
    assert [each.name for each in found.effects] == ["encoder-error"]
    assert found.best.values.tolist() == same.best.values.tolist()


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

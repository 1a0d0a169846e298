"""Contradictions of an extended simulation with the limits of states that the simulation states."""

from collections.abc import Mapping
from typing import cast

import numpy as np
import pytest

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.effects.catalogue import CATALOGUE, catalogue_order
from islands.records.dataset import Dataset
from islands.report.documents.extension import list_contradictions
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.factory import make_simulator

TANK = {
    "kind": "ode",
    "name": "tank",
    "input": "u",
    "equations": "dlevel/dt = u - outflow\noutflow = k*sqrt(max(level, 0))",
    "output": "level",
    "parameters": {"k": 0.5},
    "states": {"level": {"initial": 1.0, "lower": 0.0, "upper": 9.0}},
}


class ExtendedFit:
    """Simulation with effects of given values, and its output."""

    def __init__(self, simulation: ExtendedSimulator, given: Mapping[str, float]) -> None:
        self.simulation, self.values = simulation, simulation.nominal
        for effect in simulation.effects:
            self.values[simulation.get_slice(effect)] = given[effect.name]
        self.output = simulation.simulate(self.values)


def contradictions(given: Mapping[str, float], **changes: object) -> tuple[str, ...]:
    u = 1.0 + np.sin(np.arange(400) / 20.0)
    record = Dataset(u[:, None], u, 0.1, ("u",), "level_m", ("m/s",), "m")
    simulator = make_simulator(OdeSpec.model_validate({**TANK, **changes}), record, {})
    known = {**CATALOGUE, **{each.name: each for each in simulator.state_effects}}
    effects = catalogue_order([known[name] for name in given])
    extended = ExtendedSimulator(simulator, effects, make_context(record, simulator, 300))
    return list_contradictions(cast("CalibrationResult", ExtendedFit(extended, given)))


def test_a_constant_outflow_of_an_empty_tank_is_stated() -> None:
    (said,) = contradictions({"input-offset:level": -0.2})
    assert said.startswith(
        "Offset of the input at level: with u = 0 and level at its limit of 0, the extended simulation still "
        "takes away 0.2/s."
    )


@pytest.mark.parametrize("limit", [{"lower": 0.0}, {}])
def test_an_inflow_or_a_state_without_a_limit_has_no_contradiction(limit: dict[str, float]) -> None:
    states = {"level": {"initial": 1.0, **limit}}
    assert contradictions({"input-offset:level": 0.2 if limit else -0.2}, states=states) == ()


def test_an_outflow_that_the_simulation_has_itself_is_not_that_of_the_offset() -> None:
    assert contradictions({"input-offset:level": -0.2}, equations="dlevel/dt = u - k") == ()


def test_a_balance_that_depends_on_time_is_not_judged() -> None:
    assert contradictions({"input-offset:level": -0.2}, equations="dlevel/dt = u - k*t*level") == ()


@pytest.mark.parametrize(("offset", "limit"), [(-6.0, "of 0 m"), (8.0, "of 9 m")])
def test_an_output_beyond_the_limits_of_its_state_is_stated(offset: float, limit: str) -> None:
    (said,) = contradictions({"offset": offset})
    assert limit in said
    assert "error of the sensor only" in said
    assert contradictions({"offset": 0.0}) == ()
    assert contradictions({"offset": offset}, output="2*level") == ()

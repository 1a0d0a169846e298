"""Simulation of a specification on a record."""

import numpy as np

from islands.data.dataset import Dataset
from islands.io.simulator_spec.factory import simulate_spec
from islands.io.simulator_spec.ode_spec import OdeSpec

DT = 0.01


def test_initial_states_are_found_with_friction_from_those_of_another_record() -> None:
    rng = np.random.default_rng(3)
    time = DT * np.arange(600)
    u = 6.0 * np.sin(2 * np.pi * np.outer(time, rng.uniform(0.2, 3.0, 8)) + rng.uniform(0, 6.3, 8)).sum(
        axis=1
    )
    u *= np.minimum(1.0, time)
    document = {
        "kind": "ode",
        "name": "oscillator",
        "input": "u",
        "output": "x",
        "equations": "dx/dt = v\ndv/dt = u - 2*v - 100*x - 6*sign(v)*exp(-(v/0.5)**2)\n",
        "states": {"x": {"unit": "m"}, "v": {"unit": "m/s"}},
    }
    silent = Dataset(u, np.zeros(600), DT, ("u",), output_name="y")
    at_rest = {**document, "states": {name: {"initial": 0.0, "fixed": True} for name in ("x", "v")}}
    y = simulate_spec(OdeSpec.model_validate(at_rest), silent)
    record = Dataset(u, y + 0.002 * rng.standard_normal(600), DT, ("u",), output_name="y")
    moving = {**document, "states": {"x": {"unit": "m"}, "v": {"unit": "m/s", "initial": -2.0}}}
    assert np.max(np.abs(simulate_spec(OdeSpec.model_validate(moving), record) - y)) < 0.002

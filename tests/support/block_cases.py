"""Models, records and start values for exports as blocks of simulators."""

from dataclasses import replace

import numpy as np

from islands.io.export.sampled_state import make_sampled_state
from islands.simulation.predictors import free_run
from support.programs import CASES, model, record, record_of

#: Chosen for their states: past inputs and outputs, several inputs, no past, an input that acts at once.
OF_STATES = {
    **{
        name: replace(CASES[name], dt=CASES[name].dt or 0.1)
        for name in (
            "published 12",
            "many parts",
            "several inputs",
            "a constant, that needs no past",
            "no output",
            "tanh",
        )
    },
    "at once": replace(model({"y(k-1)": 0.5, "u1(k-1)*u2(k-2)": 0.25}, ("a_V+1", "b_A")), dt=0.1),
}


def start_values(exported, data):
    """Return the past samples of a block, in the order of its state, and the number of its first sample."""
    first, signals = max(exported.maximum_lag, 1), [data.y, *data.u.T]
    return [signals[channel][first - lag] for channel, lag in make_sampled_state(exported).samples], first


def block_case(name):
    """Return a model, its record, and start values, inputs and outputs of its block from the first sample."""
    exported = OF_STATES[name]
    data = record(exported.inputs, dt=0.1) if name == "at once" else record_of(name)
    past, first = start_values(exported, data)
    run = free_run(exported, data)
    assert run.outcome
    return exported, data, past, np.ascontiguousarray(data.u[first:]), run.y[first:]

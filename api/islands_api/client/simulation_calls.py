"""Calls that simulate the models of a job."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from islands_api.client.calls import JobRef, RequestSpec, quote_id
from islands_api.client.response_parsing import read_as
from islands_api.model_simulation_schemas import SimulatedOutput
from islands_api.result_schemas import SearchFreeRunView


def simulate(
    which: JobRef,
    rank: int = 1,
    inputs: Mapping[str, Sequence[float] | Mapping[str, Any]] | None = None,
    *,
    samples: int | None = None,
    initial_output: float | None = None,
) -> RequestSpec[SimulatedOutput]:
    """Simulate a model of a job with inputs of choice.

    Parameters
    ----------
    which : str or JobView
    rank : int
        Rank of the model.
    inputs : mapping, optional
        By column, samples at the sampling time of the model (a sequence or an array), or an excitation:
        ``{"kind": "hold", "value": 1}``; ``{"kind": "sine", "amplitude": 2, "offset": 0, "frequency": 0.5}``,
        also ``triangle`` and ``steps``; ``{"kind": "sweep", "amplitude": 2, "first": 0.1, "last": 5}``;
        ``{"kind": "record", "scale": 1.2, "offset": 0}``. Other inputs are held in the middle of their range.
    samples : int, optional
        Number of samples, at most 50 000; by default that of the given samples, or 2000.
    initial_output : float, optional
        Output before the first sample; by default the stable equilibrium at the first values of the inputs,
        or the first measured output if there is no unique one.
    """
    given: dict[str, Any] = {
        "inputs": {
            name: dict(each) if isinstance(each, Mapping) else np.asarray(each, dtype=np.float64).tolist()
            for name, each in (inputs or {}).items()
        },
        "samples": samples,
        "initial_output": initial_output,
    }
    body = {name: value for name, value in given.items() if value is not None}
    path = f"/v1/jobs/{quote_id(which)}/models/{rank}/simulate"
    return RequestSpec("POST", path, read_as(SimulatedOutput), json=body)


def free_run(which: JobRef) -> RequestSpec[SearchFreeRunView]:
    """Return the free run of the best model so far of a running search, with the measured output."""
    return RequestSpec("GET", f"/v1/jobs/{quote_id(which)}/free-run", read_as(SearchFreeRunView))

"""Error of a model on the test of a benchmark, from the outputs that its rule allows only."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from islands.benchmarks.definition import BenchmarkTest
from islands.data.dataset import Dataset
from islands.errors import ModelError
from islands.facade.results.model_simulation import predict
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.simulation.initial_outputs import simulate_freely


def measure_rmse(model: AnyModel, test: BenchmarkTest) -> float:
    """Return the RMSE of the free run over the scored samples and all outputs.

    The simulation begins after the initial samples that the benchmark allows, and reads no later output. A
    latent model estimates its initial states from them. Predictions of a model of means are held.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
    test : BenchmarkTest

    Raises
    ------
    ModelError
        The free run diverges, or the model needs more initial samples.
    RecordError
        The test does not match the model.
    """
    if isinstance(model, LatentModel):
        model = _limit_memory(model, test)
    elif isinstance(model, CoupledLatentModel):
        model = CoupledLatentModel(tuple(_limit_memory(each, test) for each in model.models))
    average = model.average
    warm_up = test.known // average
    if warm_up < model.maximum_lag:
        raise ModelError(
            f"the model needs {model.maximum_lag * average} initial samples, the test allows {test.known}"
        )
    simulated = _simulate(model, test, warm_up)
    scored = np.zeros(test.record.samples, bool)
    for begin, end in test.record.bounds:
        # The last samples may be fewer than those of a mean.
        scored[begin + test.unscored : begin + (end - begin) // average * average] = True
    errors = (simulated - test.record.y)[scored]
    if not np.isfinite(errors).all():
        raise ModelError("the free run diverges")
    return float(np.sqrt(np.mean(errors**2)))


def _limit_memory(model: LatentModel, test: BenchmarkTest) -> LatentModel:
    """Return a model that estimates its initial states from the samples that a test allows."""
    return replace(model, memory=min(model.memory, test.known))


def _simulate(model: AnyModel, test: BenchmarkTest, warm_up: int) -> NDArray[np.float64]:
    """Return the free run, a value for each sample and output; NaN in the warm-up and after a divergence."""
    visible = test.visible
    if isinstance(visible, Dataset) and not isinstance(model, CoupledModel):
        return predict(model, visible, warm_up)
    means = simulate_freely(model, visible, warm_up).y
    simulated, place = np.full(visible.y.shape, np.nan), 0
    for begin, end in visible.bounds:
        count = (end - begin) // model.average
        held = np.repeat(means[place : place + count], model.average, axis=0)
        simulated[begin : begin + len(held)] = held
        place += count
    return simulated

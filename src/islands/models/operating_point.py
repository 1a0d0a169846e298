"""Outputs of a model at rest at constant inputs."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.linearisation import find_rest, read_levels
from islands.models.measured_signals import measured_block
from islands.models.protocol import DynamicModel, no_model_error


def static_characteristic(model: AnyModel, inputs: ArrayLike) -> NDArray[np.float64]:
    """Return the output at rest for constant inputs.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
        Model with parameters.
    inputs : array_like, shape (points,) or (points, inputs)
        Constant inputs.

    Returns
    -------
    ndarray, shape (points,) or (points, outputs)
        The stable equilibrium at each point.

    Raises
    ------
    ModelError
        A point has no stable equilibrium, several of them, or a continuum.
    """
    points = np.atleast_1d(np.asarray(inputs, dtype=np.float64))
    rows = points[:, None] if points.ndim == 1 else points
    found = np.array([find_equilibrium(model, row.tolist()) for row in rows])
    return found if isinstance(model, CoupledModel) else found[:, 0]


def find_equilibrium(model: AnyModel, u: Sequence[float]) -> list[float]:
    """Return the outputs at the unique stable equilibrium at constant inputs; see `find_rest`."""
    if not isinstance(model, DynamicModel | CoupledModel):
        raise no_model_error(model)
    block = measured_block(model)
    return find_rest(block, read_levels(block, u))[: block.outputs]

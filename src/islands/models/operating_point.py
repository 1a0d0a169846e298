"""Operating points: their values as text, and the outputs of a model at rest at constant inputs."""

from collections.abc import Iterable, Sequence
from math import isfinite, nan

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import SettingsError
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


def parse_levels(texts: Iterable[str], option: str) -> dict[str, float]:
    """Return the numbers of texts ``NAME=VALUE`` by name.

    Parameters
    ----------
    texts : iterable of str
    option : str
        Name of the option or of the parameter that has them, for messages.

    Raises
    ------
    SettingsError
        A text is not a name and a finite number.
    """
    found = {}
    for text in texts:
        name, _, number = text.rpartition("=")
        try:
            found[name] = float(number)
        except ValueError:
            found[name] = nan
        if not (name and isfinite(found[name])):
            raise SettingsError(f"{option} {text}: write NAME=VALUE, for example u_V=0.5")
    return found

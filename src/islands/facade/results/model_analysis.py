"""`linearise`: a model about an operating point as a linear system of python-control."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from islands.distribution import describe_missing_extra
from islands.errors import ModelError
from islands.models.narx import require_narx
from islands.models.operating_point import differentiate_model
from islands.models.protocol import DynamicModel

if TYPE_CHECKING:
    import control


def linearise(
    model: DynamicModel, operating_point: ArrayLike, y: float | None = None
) -> "control.StateSpace":
    """Linearise a model about an operating point, as a system of the library python-control.

    Parameters
    ----------
    model : DynamicModel
        Model with parameters.
    operating_point : float or sequence of float
        Constant value of every input.
    y : float, optional
        Output; by default the stable equilibrium at these inputs.

    Returns
    -------
    control.StateSpace
        Discrete system of the deviations from the operating point, in observer canonical form, with the names
        of the columns and the sampling time of the model (True if it has none). ``control.ss2tf`` converts
        it; ``control.bode_plot`` and ``control.step_response`` analyse it.

    Raises
    ------
    ModelError
        python-control is not installed, the model has no unique stable equilibrium and no output is given, or
        it has a kink or a step at the operating point.
    """
    narx = require_narx(model)
    try:
        import control as library  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise ModelError(describe_missing_extra("a linear system", "control")) from error
    found = differentiate_model(narx, operating_point, y)
    order = len(found.outputs)
    direct, past = found.inputs[:, 0], found.inputs[:, 1:].T
    matrix = np.eye(order, k=1)
    matrix[:, 0] = found.outputs
    return library.ss(
        matrix,
        past + np.outer(found.outputs, direct),
        np.eye(1, order),
        direct[None, :],
        True if narx.dt is None else narx.dt,
        inputs=list(narx.column_names),
        outputs=[narx.output_name],
    )

"""`AnalysedModel`: a model as an equation, a linear system, a static characteristic and a step response."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.distribution import describe_missing_extra
from islands.errors import ModelError
from islands.model.equations import equation, latex_equation
from islands.model.model import Model
from islands.model.operating_point import differentiate_model, static_characteristic
from islands.model.signal_statement import describe_signals
from islands.model.sympy_expression import to_sympy
from islands.simulation.step_response import StepResponse, step_response

if TYPE_CHECKING:
    import control
    import sympy
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class AnalysedModel:
    """A model and its analyses."""

    __slots__ = ()

    # Declared only: at run time a property here would be the default of a field of a dataclass.
    if TYPE_CHECKING:

        @property
        def model(self) -> Model:
            """Regressors, parameters, standard errors."""

        @property
        def output_unit(self) -> str:
            """Unit of the output."""

    @property
    def equation(self) -> str:
        """Equation as plain text."""
        return equation(self.model)

    @property
    def latex(self) -> str:
        """Equation in LaTeX."""
        return latex_equation(self.model)

    @property
    def signals(self) -> str:
        """Signals that the equation reads: deviations, filtered samples or means; empty for the record's."""
        return describe_signals(self.model)

    def to_sympy(self) -> "sympy.Eq":
        """Return the model as a SymPy equation; see `to_sympy` (extra ``sympy``)."""
        return to_sympy(self.model)

    def linearise(self, operating_point: ArrayLike, y: float | None = None) -> "control.StateSpace":
        """Linearise the model; see `islands.linearise` (extra ``control``)."""
        return linearise(self.model, operating_point, y)

    def static_characteristic(self, inputs: ArrayLike) -> NDArray[np.float64]:
        """Return the output at rest for constant inputs; see `static_characteristic`."""
        return static_characteristic(self.model, inputs)

    def plot_static_characteristic(self, inputs: Sequence[float], *, ax: "Axes | None" = None) -> "Figure":
        """Draw the output at rest over a constant input, for models with one input.

        Parameters
        ----------
        inputs : sequence of float
        ax : Axes, optional
            Axes to draw into; by default those of a new figure.

        Raises
        ------
        ModelError
            As in `static_characteristic`, or the model has several inputs.
        """
        from islands.figures.model_responses import draw_static_characteristic  # noqa: PLC0415 - matplotlib

        if self.model.inputs > 1:
            raise ModelError(
                "a characteristic curve has one input: draw a section of static_characteristic()"
            )
        return draw_static_characteristic(self.model, inputs, self.static_characteristic(inputs), ax)

    def step_response(
        self, start: ArrayLike, end: ArrayLike, y: float | None = None, samples: int | None = None
    ) -> StepResponse:
        """Simulate the response to a step of the inputs from rest; see `step_response`."""
        return step_response(self.model, start, end, y, samples)

    def plot_step_response(
        self,
        start: ArrayLike,
        end: ArrayLike,
        y: float | None = None,
        samples: int | None = None,
        *,
        ax: "Axes | None" = None,
    ) -> "Figure":
        """Draw the response to a step of the inputs from rest.

        Parameters
        ----------
        start, end, y, samples
            As in `step_response`.
        ax : Axes, optional
            Axes to draw into; by default those of a new figure.
        """
        from islands.figures.model_responses import draw_step_response  # noqa: PLC0415 - matplotlib

        return draw_step_response(self.step_response(start, end, y, samples), ax)


def linearise(model: Model, operating_point: ArrayLike, y: float | None = None) -> "control.StateSpace":
    """Linearise a model about an operating point, as a system of the library python-control.

    Parameters
    ----------
    model : Model
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
    try:
        import control as library  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise ModelError(describe_missing_extra("a linear system", "control")) from error
    found = differentiate_model(model, operating_point, y)
    order = len(found.outputs)
    direct, past = found.inputs[:, 0], found.inputs[:, 1:].T
    matrix = np.eye(order, k=1)
    matrix[:, 0] = found.outputs
    return library.ss(
        matrix,
        past + np.outer(found.outputs, direct),
        np.eye(1, order),
        direct[None, :],
        True if model.dt is None else model.dt,
        inputs=list(model.column_names),
        outputs=[model.output_name],
    )

"""Protocol of dynamic models: what simulation, refinement, bands, exports, files and diagnosis read.

A class of models is one file in this package and an entry of `islands.persistence.models.MODEL_CLASSES`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

from numpy.typing import ArrayLike

from islands.errors import ModelError
from islands.models.block import Block
from islands.models.linearisation import OperatingPoint
from islands.models.state_space import StateSpace
from islands.records.signal_map import SignalReference


def no_model_error(value: object, otherwise: str = "") -> ModelError:
    """Return an error about a value that is given in place of a model, such as a result."""
    return ModelError(f"a {type(value).__name__} is no model: give result.best.model{otherwise}")


class ModelEquation(Protocol):
    """Equation of a model as text; no property is computed before it is read."""

    @property
    def line(self) -> str:
        """One line for each output, with the symbols y, u or u1, u2 ..: ``y(k) = 0.9*y(k-1) + u(k-1)``."""

    @property
    def plain(self) -> str:
        """``line``, and one more that states the signals unless they are those of the record."""

    @property
    def named(self) -> str:
        """One line for each output, with the column names of the record."""

    @property
    def terms(self) -> tuple[str, ...]:
        """Text of what each parameter multiplies, or its name, with the column names of the record."""

    @property
    def latex(self) -> str:
        """The equation in LaTeX, without dollar signs."""

    @property
    def mathml(self) -> str:
        """The equation as a ``math`` element in ASCII."""


@dataclass(frozen=True, slots=True)
class EquationText:
    """Equation that is written already; see `ModelEquation` for the attributes."""

    line: str
    plain: str
    named: str
    terms: tuple[str, ...]
    latex: str
    mathml: str


@runtime_checkable
class DynamicModel(SignalReference, Protocol):
    """Data class of models of one output with parameters, for one sampling time.

    It has the columns, the sampling time, the means and the preprocessing of a `SignalReference`, which every
    simulation applies. An input ``u_V+1`` is read at sample k.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    #: Tag of the class in documents.
    kind: ClassVar[str]

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names of the inputs without the suffix ``+1``."""

    @property
    def inputs(self) -> int:
        """Number of inputs."""

    @property
    def maximum_lag(self) -> int:
        """Number of past samples before the first prediction."""

    @property
    def size(self) -> int:
        """Number of parameters."""

    @property
    def free_size(self) -> int:
        """Number of parameters that the response of the output to the inputs determines."""

    @property
    def parameters(self) -> tuple[float, ...]:
        """Values of the parameters."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, or texts of the terms that they multiply; they identify the structure."""

    @property
    def standard_errors(self) -> tuple[float, ...] | None:
        """Standard errors of the parameters. None if unknown."""

    def with_parameters(
        self, values: Sequence[float], standard_errors: Sequence[float] | None = None
    ) -> Self:
        """Return a copy of the model with the given parameters and standard errors."""

    def block(self) -> Block:
        """Return the difference equations of the model."""

    def linearise(
        self, operating_point: OperatingPoint | None = None, y: ArrayLike | None = None
    ) -> StateSpace:
        """Return the linear system of small deviations from an operating point as measured.

        Parameters
        ----------
        operating_point : float, sequence of float or mapping, optional
            Constant value of every input, in the order of the model or by column; by default, and for columns
            that a mapping leaves out, the point at which an exported program of the model starts.
        y : float or sequence of float, optional
            Outputs there; by default the stable equilibrium.

        Raises
        ------
        ModelError
            The model has no unique stable equilibrium at these inputs and no output is given, or it has a
            kink or a step at the operating point.
        """

    def equation(self) -> ModelEquation:
        """Return the equation as text."""

    def document(self) -> dict[str, Any]:
        """Return the model as JSON values."""

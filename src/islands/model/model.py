"""A NARX model, linear in its parameters: y(k) = theta_1 psi_1 + theta_2 psi_2 + ... (equation (10))."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from islands.errors import ModelError
from islands.model.expression import Expression
from islands.model.regressor import Regressor, regressor


@dataclass(frozen=True, slots=True)
class Model:
    """Regressors, and parameters once they are estimated.

    Attributes
    ----------
    regressors : tuple of Regressor
        In the order of their content, each once.
    theta : tuple of float or None
        One parameter for each; None before estimation.
    input_names, output_name
        Columns of the record that the model speaks of; ``len(input_names)`` is the number of inputs.
    dt : float or None
        Sampling time in seconds that the parameters hold for; None where it does not matter.
    standard_errors : tuple of float or None
        Of the parameters, where they were estimated.
    """

    regressors: tuple[Regressor, ...]
    theta: tuple[float, ...] | None = None
    input_names: tuple[str, ...] = ("u",)
    output_name: str = "y"
    dt: float | None = None
    standard_errors: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if not self.regressors:
            raise ModelError("a model has at least one regressor")
        if list(self.regressors) != canonical_order(self.regressors):
            raise ModelError("a model's regressors stand in the order of their content, each once")
        for name in ("theta", "standard_errors"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.regressors):
                raise ModelError(f"{len(values)} {name} for {len(self.regressors)} regressors")
        deepest = max(channel for item in self.regressors for channel, _ in item.lags | {(0, 0)})
        if deepest > len(self.input_names):
            raise ModelError(
                f"the model reads input {deepest} and has {len(self.input_names)}: {self.input_names}"
            )

    @property
    def size(self) -> int:
        """Number of terms."""
        return len(self.regressors)

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.input_names)

    @property
    def maximum_lag(self) -> int:
        """Samples of history that the model needs before its first prediction."""
        return max(item.maximum_lag for item in self.regressors)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The parameters of an estimated model.

        Raises
        ------
        ModelError
            They have not been estimated.
        """
        if self.theta is None:
            raise ModelError("the model has no parameters yet: estimate them first")
        return self.theta

    def with_parameters(
        self, theta: Sequence[float], standard_errors: Sequence[float] | None = None
    ) -> "Model":
        """Return the model with parameters."""
        errors = None if standard_errors is None else tuple(map(float, standard_errors))
        return replace(self, theta=tuple(map(float, theta)), standard_errors=errors)


def canonical_order(regressors: Iterable[Regressor]) -> list[Regressor]:
    """Return the regressors without repetition, in the order of their content."""
    return sorted(dict.fromkeys(regressors), key=lambda item: item.content)


def model_of(
    terms: Iterable[tuple[Expression, float]],
    input_names: tuple[str, ...] = ("u",),
    output_name: str = "y",
    dt: float | None = None,
) -> Model:
    """Make a model of terms as they are written.

    They are brought into canonical form, factors go into the parameters, and equal regressors are merged.

    Raises
    ------
    ModelError
        Nothing is left, or a term reads the present or the future.
    """
    theta: dict[Regressor, float] = {}
    for expression, parameter in terms:
        factor, item = regressor(expression)
        if item is not None:
            theta[item] = theta.get(item, 0.0) + factor * parameter
    ordered = canonical_order(theta)
    return Model(tuple(ordered), tuple(theta[item] for item in ordered), input_names, output_name, dt)

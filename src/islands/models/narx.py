"""NARX model, linear in its parameters: y(k) = theta_1 psi_1 + theta_2 psi_2 + ... (equation (10))."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import nan
from numbers import Real
from reprlib import repr as abbreviate
from typing import Any, ClassVar

from numpy.typing import ArrayLike

from islands.errors import ModelError
from islands.expressions.primitives import SUB
from islands.expressions.printing import plain
from islands.expressions.tree import Apply, Constant, Expression, Lagged, replace_leaves
from islands.models.block import Block, BlockTerm
from islands.models.equations import (
    equation,
    latex_equation,
    mathml_equation,
    named_equation,
    named_term,
    plain_text,
)
from islands.models.linearisation import OperatingPoint, linearise_block
from islands.models.protocol import DynamicModel, ModelEquation, no_model_error
from islands.models.regressor import Regressor, regressor
from islands.models.signal_statement import describe_values, symbols
from islands.models.state_space import StateSpace
from islands.records.channel_names import parse_channel_name
from islands.records.preprocessing_steps import Preprocessing


@dataclass(frozen=True, slots=True, repr=False)
class Model:
    """Regressors and, after estimation, their parameters.

    Attributes
    ----------
    regressors : tuple of Regressor
        In canonical order, without repetition.
    theta : tuple of float or None
        One parameter per regressor. None before estimation.
    input_names, output_name
        Names of the columns of the record. ``len(input_names)`` is the number of inputs. Of an input named
        ``u_V+1``, the regressor u(k-1) is the column ``u_V`` at sample k.
    dt : float or None
        Sampling time in seconds for which the parameters are valid. None if unspecified.
    standard_errors : tuple of float or None
        Standard errors of the parameters. None if unknown.
    average : int
        Number of consecutive samples of a recording whose mean is one sample of the model. ``dt`` is the
        sampling time of the means.
    preprocessing : Preprocessing or None
        Steps before the means; the regressors read deviations from its offsets. None if there were none.

    Raises
    ------
    ModelError
        There is no regressor, the regressors are not in canonical order, the number of parameters or standard
        errors differs from the number of regressors, or a regressor reads an input without a name.
    """

    kind: ClassVar[str] = "narx"

    regressors: tuple[Regressor, ...]
    theta: tuple[float, ...] | None = None
    input_names: tuple[str, ...] = ("u",)
    output_name: str = "y"
    dt: float | None = None
    standard_errors: tuple[float, ...] | None = None
    average: int = 1
    preprocessing: Preprocessing | None = None

    def __post_init__(self) -> None:
        if not self.regressors:
            raise ModelError("a model has at least one regressor")
        if self.average < 1:
            raise ModelError(f"a mean has at least 1 sample, got average = {self.average}")
        if list(self.regressors) != canonical_order(self.regressors):
            raise ModelError("a model's regressors must be in canonical order without repetition")
        for name in ("theta", "standard_errors"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.regressors):
                raise ModelError(f"{len(values)} {name} for {len(self.regressors)} regressors")
        deepest = max(channel for item in self.regressors for channel, _ in item.lags | {(0, 0)})
        if deepest > len(self.input_names):
            raise ModelError(
                f"the model reads input {deepest} and has {len(self.input_names)}: {self.input_names}"
            )

    def __repr__(self) -> str:
        return f"<Model of {', '.join(item.text for item in self.regressors)}>"

    @property
    def size(self) -> int:
        """Number of terms."""
        return len(self.regressors)

    @property
    def free_size(self) -> int:
        """Number of parameters that the response determines: that of the terms."""
        return self.size

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.input_names)

    @property
    def leads(self) -> tuple[int, ...]:
        """Number of samples that the output and each input are read early: 0, or 1 for ``u_V+1``."""
        return (0, *(int(parse_channel_name(name).at_once) for name in self.input_names))

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names of the inputs without the suffix ``+1``."""
        return tuple(parse_channel_name(name).base for name in self.input_names)

    @property
    def maximum_lag(self) -> int:
        """Number of past samples that the model needs before its first prediction."""
        return max(item.maximum_lag for item in self.regressors)

    @property
    def output_lag(self) -> int:
        """Number of past outputs that the model reads."""
        return max((lag for item in self.regressors for channel, lag in item.lags if channel == 0), default=0)

    @property
    def parameters(self) -> tuple[float, ...]:
        """Parameters of an estimated model.

        Raises
        ------
        ModelError
            The parameters have not been estimated.
        """
        if self.theta is None:
            raise ModelError("the model has no parameters yet: estimate them first")
        return self.theta

    def with_parameters(
        self, theta: Sequence[float], standard_errors: Sequence[float] | None = None
    ) -> "Model":
        """Return a copy of the model with the given parameters and standard errors."""
        errors = None if standard_errors is None else tuple(map(float, standard_errors))
        return replace(self, theta=tuple(map(float, theta)), standard_errors=errors)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Texts of the regressors with numbered inputs, which identify the structure."""
        return tuple(item.text for item in self.regressors)

    def block(self) -> Block:
        """Return the difference equation; the weights of its terms are the parameters."""
        names = [item.text for item in self.regressors]
        terms = tuple(BlockTerm(item.expression, item.text) for item in self.regressors)
        return Block(
            equations=(terms,),
            columns=(self.output_name, *self.column_names),
            signals=symbols(self.inputs),
            starts=(),
            leads=self.leads,
            parameters=dict(zip(names, self.theta or (nan,) * self.size, strict=True)),
            warm_up=self.maximum_lag,
            dt=None if self.dt is None else float(self.dt),
            values=describe_values(self),
            texts=(equation(self),),
        )

    def linearise(
        self, operating_point: OperatingPoint | None = None, y: ArrayLike | None = None
    ) -> StateSpace:
        """Return the linear system of small deviations; see `DynamicModel.linearise`."""
        return linearise_block(
            start_at_offsets(measured_model(self).block(), self, range(1 + self.inputs)), operating_point, y
        )

    def equation(self) -> ModelEquation:
        """Return the equation as text."""
        return NarxEquation(self)

    def document(self) -> dict[str, Any]:
        """Return the model as JSON values; ``equation`` and ``latex`` are for readers."""
        parameters = self.theta or (None,) * self.size
        errors = self.standard_errors or (None,) * self.size
        return {
            "inputs": list(self.input_names),
            "output": self.output_name,
            "dt": self.dt,
            "average": self.average,
            "preprocessing": None if self.preprocessing is None else self.preprocessing.as_document(),
            "equation": equation(self),
            "latex": latex_equation(self),
            "terms": [
                {
                    "regressor": plain(item.expression, self.inputs),
                    "parameter": parameter,
                    "standard_error": error,
                }
                for item, parameter, error in zip(self.regressors, parameters, errors, strict=True)
            ],
        }


@dataclass(frozen=True, slots=True)
class NarxEquation:
    """Equation of a NARX model; see `ModelEquation`."""

    model: Model

    @property
    def line(self) -> str:
        """One line with the symbols y and u."""
        return equation(self.model)

    @property
    def plain(self) -> str:
        """The line, and one that states the signals."""
        return plain_text(self.model)

    @property
    def named(self) -> str:
        """One line with the column names of the record."""
        return named_equation(self.model)

    @property
    def terms(self) -> tuple[str, ...]:
        """Texts of the regressors with the column names of the record."""
        return tuple(named_term(self.model, position) for position in range(self.model.size))

    @property
    def latex(self) -> str:
        """The equation in LaTeX."""
        return latex_equation(self.model)

    @property
    def mathml(self) -> str:
        """The equation in MathML."""
        return mathml_equation(self.model)


def canonical_order(regressors: Iterable[Regressor]) -> list[Regressor]:
    """Return the regressors in canonical order, without repetition."""
    return sorted(dict.fromkeys(regressors), key=lambda item: item.content)


def require_narx(model: DynamicModel) -> Model:
    """Return a model as a NARX model.

    Raises
    ------
    ModelError
        It is of another class, or no model.
    """
    if not isinstance(model, DynamicModel):
        raise no_model_error(model)
    if not isinstance(model, Model):
        raise ModelError(f"a NARX model is needed, this one is of the class {model.kind}")
    return model


def make_model(
    terms: Iterable[tuple[Expression, float]],
    input_names: tuple[str, ...] = ("u",),
    output_name: str = "y",
    dt: float | None = None,
) -> Model:
    """Make a model from (expression, parameter) pairs.

    Each expression is brought into canonical form. Numeric factors are moved into the parameters, and equal
    regressors are merged.

    Raises
    ------
    ModelError
        No term remains, or a term reads the present or the future.
    """
    theta: dict[Regressor, float] = {}
    for expression, parameter in _check_terms(terms):
        factor, item = regressor(expression)
        if item is not None:
            theta[item] = theta.get(item, 0.0) + factor * parameter
    ordered = canonical_order(theta)
    return Model(tuple(ordered), tuple(theta[item] for item in ordered), input_names, output_name, dt)


def _check_terms(terms: Iterable[object]) -> Iterator[tuple[Expression, float]]:
    """Yield pairs of an expression and a number."""
    for term in terms:
        if not (
            isinstance(term, Sequence)
            and len(term) == 2
            and isinstance(term[0], Expression)
            and isinstance(term[1], Real)
        ):
            raise ModelError(
                f"a term is a pair of an expression and a number, got {abbreviate(term)}: write "
                "(islands.parse('y(k-1)'), 0.5)"
            )
        yield term[0], float(term[1])


def measured_model(model: Model) -> Model:
    """Return a model with the offsets of its preprocessing inside its expressions.

    It reads and predicts the signals as measured: y(k-1) becomes y(k-1) less the offset of the output, and
    the offset of the output is a term. Standard errors, which are those of the deviations, are left out.

    Parameters
    ----------
    model : Model
        Model with parameters.

    Returns
    -------
    Model
        The model itself if it has no offsets. The filter and the decimation of its preprocessing remain.
    """
    done = model.preprocessing
    if done is None:
        return model
    offsets = (done.output_offset, *done.input_offsets)
    rate = done.without_offsets if done.has_rate_steps else None
    if not any(offsets):
        return replace(model, preprocessing=rate)

    def subtract(leaf: Lagged) -> Expression:
        offset = offsets[leaf.channel]
        return Apply(SUB, (leaf, Constant(offset))) if offset else leaf

    terms = [
        (replace_leaves(item.expression, subtract), parameter)
        for item, parameter in zip(model.regressors, model.parameters, strict=True)
    ]
    terms.append((Constant(1.0), done.output_offset))
    measured = make_model(terms, model.input_names, model.output_name, model.dt)
    return replace(measured, average=model.average, preprocessing=rate)


def start_at_offsets(block: Block, model: DynamicModel, channels: Iterable[int]) -> Block:
    """Return a block whose past signals are the offsets of a model unless others are given."""
    done = model.preprocessing
    if done is None:
        return block
    offsets = zip(channels, (done.output_offset, *done.input_offsets), strict=True)
    return replace(block, levels={block.signals[channel]: offset for channel, offset in offsets})

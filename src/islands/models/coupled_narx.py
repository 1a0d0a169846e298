"""Coupled model: one equation per output, each of which may read the past of all outputs.

Models of several outputs of other classes are derived from it.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import Any, ClassVar, TypeAlias

from numpy.typing import ArrayLike

from islands.errors import ModelError
from islands.expressions.tree import Apply, Expression, Lagged
from islands.models.block import Block, BlockTerm
from islands.models.equations import (
    equation,
    latex_equation,
    latex_statement,
    mathml_equation,
    mathml_statement,
    named_equation,
    named_term,
    signal_names,
)
from islands.models.linearisation import OperatingPoint, linearise_block
from islands.models.narx import Model, measured_model, require_narx, start_at_offsets
from islands.models.protocol import DynamicModel, EquationText
from islands.models.signal_statement import describe_values, join_statements, symbols
from islands.models.state_space import StateSpace
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.records.preprocessing_steps import Preprocessing


@dataclass(frozen=True, slots=True)
class CoupledModel:
    """One model per output. The other outputs are the last inputs of each, in the order of the outputs.

    Attributes
    ----------
    models : tuple of Model
        Equations of the outputs; at least two.

    Raises
    ------
    ModelError
        There are fewer than two equations, or their outputs, inputs, sampling times, averages or
        preprocessing do not agree.
    """

    kind: ClassVar[str] = "coupled-narx"

    models: tuple[DynamicModel, ...]

    def __post_init__(self) -> None:
        names = self.output_names
        if len(names) < 2:
            raise ModelError("a coupled model has at least two equations, for a single output use a Model")
        if len(set(names)) < len(names):
            raise ModelError(f"two equations have the same output: {', '.join(names)}")
        self._check_classes()
        first = self.models[0]
        for place, model in enumerate(self.models):
            expected = self._list_columns(place)
            if not self.input_names or model.input_names != expected:
                raise ModelError(
                    f"the equation of {model.output_name} has the inputs {', '.join(model.input_names)}; "
                    f"expected are {self._expected}, {', '.join(expected)}"
                )
            if (model.dt, model.average) != (first.dt, first.average):
                raise ModelError(
                    f"the equations of {first.output_name} and {model.output_name} have different sampling "
                    "times: estimate both at the same rate"
                )
        described = [self._describe_signals(place) for place in range(len(names))]
        for name, each in zip(names, described, strict=True):
            if each != described[0]:
                raise ModelError(
                    f"the equations of {first.output_name} and {name} read signals of another preprocessing: "
                    "estimate both from one record"
                )

    #: What the inputs of an equation are, in an error.
    _expected: ClassVar[str] = "inputs and then the other outputs"

    def _check_classes(self) -> None:
        """Check that all equations are NARX models."""
        for model in self.models:
            require_narx(model)

    def _list_columns(self, place: int) -> tuple[str, ...]:
        """Return the columns that one equation has as its inputs."""
        others = (name for name in self.output_names if name != self.output_names[place])
        return (*self.input_names, *others)

    def separate(self, record: CoupledRecord, place: int) -> Dataset:
        """Return the record that one equation reads; see `CoupledRecord.separate`."""
        return record.separate(place)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(model.output_name for model in self.models)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, without the outputs."""
        first = self.models[0]
        return first.input_names[: max(0, len(first.input_names) - len(self.models) + 1)]

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names of the inputs without the suffix ``+1``."""
        return self.models[0].column_names[: len(self.input_names)]

    @property
    def dt(self) -> float | None:
        """Sampling time in seconds. None if unspecified."""
        return self.models[0].dt

    @property
    def average(self) -> int:
        """Number of samples of a record whose mean is one sample of the model."""
        return self.models[0].average

    @property
    def preprocessing(self) -> Preprocessing | None:
        """Steps before the means, and offsets of the inputs and the first output. None if there were none."""
        return self.output_preprocessing(0)

    def output_preprocessing(self, place: int) -> Preprocessing | None:
        """Return the preprocessing with the offsets of the inputs and of one output."""
        done = self.models[place].preprocessing
        return done and done.select_inputs(range(len(self.input_names)))

    def _describe_signals(self, place: int) -> tuple[object, ...]:
        """Return the preprocessing of one equation: steps, sampling time, offsets of all channels."""
        done = self.models[place].preprocessing
        if done is None:
            return ()
        offsets = zip(self.channels(place), (done.output_offset, *done.input_offsets), strict=True)
        return done.steps, done.dt, sorted(offsets)

    @property
    def maximum_lag(self) -> int:
        """Number of past samples that the model needs before its first prediction."""
        return max(model.maximum_lag for model in self.models)

    @property
    def size(self) -> int:
        """Number of terms of all equations."""
        return sum(model.size for model in self.models)

    @property
    def leads(self) -> tuple[int, ...]:
        """Number of samples that every channel is read early: outputs, then inputs."""
        return (0,) * len(self.models) + narx_equations(self)[0].leads[1 : 1 + len(self.input_names)]

    @property
    def parameters(self) -> tuple[float, ...]:
        """Parameters of all equations, one after the other.

        Raises
        ------
        ModelError
            The parameters have not been estimated.
        """
        return tuple(value for model in self.models for value in model.parameters)

    def with_parameters(
        self, theta: Sequence[float], standard_errors: Sequence[float] | None = None
    ) -> "CoupledModel":
        """Return a copy with the given parameters and standard errors of all equations."""
        models, begin = [], 0
        for model in self.models:
            rows = slice(begin, begin + model.size)
            errors = None if standard_errors is None else standard_errors[rows]
            models.append(model.with_parameters(theta[rows], errors))
            begin += model.size
        return replace(self, models=tuple(models))

    @property
    def standard_errors(self) -> tuple[float, ...] | None:
        """Standard errors of all equations, one after the other. None if one equation has none."""
        errors = [model.standard_errors for model in self.models]
        return None if None in errors else tuple(value for each in errors for value in each or ())

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters: the output of the equation, and the term with the signals of the block."""
        return tuple(
            f"y{place + 1}: {_name_signals(name, equation_signals(self, place))}"
            for place, model in enumerate(self.models)
            for name in model.parameter_names
        )

    def block(self) -> Block:
        """Return the difference equations; the weights of their terms are the parameters."""
        equations, texts = [], []
        parameters: dict[str, float] = {}
        for place, model in enumerate(narx_equations(self)):
            names = [f"{place}: {item.text}" for item in model.regressors]
            equations.append(tuple(map(BlockTerm, self.expressions(place), names)))
            parameters.update(zip(names, model.theta or (nan,) * model.size, strict=True))
            texts.append(self._equation(place))
        return Block(
            equations=tuple(equations),
            columns=(*self.output_names, *self.column_names),
            signals=(*output_signals(self), *input_signals(self)),
            starts=(),
            leads=self.leads,
            parameters=parameters,
            warm_up=self.maximum_lag,
            dt=None if self.dt is None else float(self.dt),
            values=describe_values(self),
            texts=tuple(texts),
        )

    def linearise(
        self, operating_point: OperatingPoint | None = None, y: ArrayLike | None = None
    ) -> StateSpace:
        """Return the linear system of small deviations; see `DynamicModel.linearise`."""
        return linearise_block(self.measured_block(), operating_point, y)

    def measured_block(self) -> Block:
        """Return the block of the measured signals, with the offsets in its equations."""
        block = measured_coupled_model(self).block()
        return start_at_offsets(block, self.models[0], self.channels(0))

    def _equation(self, place: int) -> str:
        """Return the text of one equation with the signals of the block."""
        return _name_signals(equation(narx_equations(self)[place]), equation_signals(self, place))

    def equation(self) -> EquationText:
        """Return the equations as text, one line for each output."""
        return EquationText(
            line="\n".join(map(self._equation, range(len(self.models)))),
            plain=coupled_text(self),
            named=coupled_equation(self),
            terms=tuple(
                f"{signal_names(model)[0]}: {named_term(model, place)}"
                for model in narx_equations(self)
                for place in range(model.size)
            ),
            latex=coupled_latex(self),
            mathml=coupled_mathml(self),
        )

    def document(self) -> dict[str, Any]:
        """Return the model as JSON values."""
        written = self.equation()
        return {
            "inputs": list(self.input_names),
            "outputs": list(self.output_names),
            "dt": self.dt,
            "average": self.average,
            "equation": written.named,
            "latex": written.latex,
            "models": [model.document() for model in self.models],
        }

    def channels(self, place: int) -> tuple[int, ...]:
        """Return the channel of the coupled model of every channel of one equation.

        Channels of the coupled model are the outputs in their order and then the inputs.
        """
        outputs = len(self.models)
        others = (other for other in range(outputs) if other != place)
        return (place, *range(outputs, outputs + len(self.input_names)), *others)

    def expressions(self, place: int) -> list[Expression]:
        """Return the terms of one equation, without parameters, in the channels of the coupled model."""
        channels = self.channels(place)
        return [_read_channels(item.expression, channels) for item in narx_equations(self)[place].regressors]


def narx_equations(model: CoupledModel) -> tuple[Model, ...]:
    """Return the equations of a coupled model as NARX models.

    Raises
    ------
    ModelError
        They are of another class.
    """
    return tuple(map(require_narx, model.models))


#: Model of one or several outputs.
AnyModel: TypeAlias = DynamicModel | CoupledModel


def list_models(model: AnyModel) -> tuple[DynamicModel, ...]:
    """Return the model of every output."""
    return model.models if isinstance(model, CoupledModel) else (model,)


def measured_coupled_model(model: CoupledModel) -> CoupledModel:
    """Return a model of NARX equations with its offsets inside its expressions; see `measured_model`."""
    return CoupledModel(tuple(map(measured_model, narx_equations(model))))


def _read_channels(expression: Expression, channels: Sequence[int]) -> Expression:
    """Replace channels. The arguments keep their order, so that a value keeps its last bits."""
    match expression:
        case Lagged(channel, lag):
            return Lagged(channels[channel], lag)
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_read_channels(each, channels) for each in arguments))
    return expression


def output_signals(model: CoupledModel) -> list[str]:
    """Return the names of the outputs: y1, y2, .."""
    return [f"y{place + 1}" for place in range(len(model.models))]


def input_signals(model: CoupledModel) -> list[str]:
    """Return the names of the inputs: u, or u1, u2, .. for several."""
    count = len(model.input_names)
    return ["u"] if count == 1 else [f"u{place + 1}" for place in range(count)]


def equation_signals(model: CoupledModel, place: int) -> dict[str, str]:
    """Return the name in the coupled model of every signal of one equation, ``{"y": "y2", "u2": "y1"}``."""
    names = [*output_signals(model), *input_signals(model)]
    channels = model.channels(place)
    return {
        name: names[channel]
        for name, channel in zip(symbols(model.models[place].inputs), channels, strict=True)
    }


def _name_signals(text: str, names: Mapping[str, str]) -> str:
    """Replace the signals of one equation by those of the block."""
    return re.sub(r"\b(y|u\d*)\(k(?=[-)])", lambda leaf: f"{names[leaf[1]]}(k", text)


def coupled_equation(model: CoupledModel) -> str:
    """Write one line per output, with the column names of the record."""
    return "\n".join(map(named_equation, narx_equations(model)))


def coupled_signals(model: CoupledModel) -> str:
    """State which signals the equations read, with the column names of the record."""
    outputs = (signal_names(single)[0] for single in model.models)
    inputs = signal_names(model.models[0])[1 : 1 + len(model.input_names)]
    return describe_coupled_signals(model, (*outputs, *inputs))


def describe_coupled_signals(model: CoupledModel, names: Sequence[str]) -> str:
    """State which signals the equations read; see `describe_signals`.

    Parameters
    ----------
    model : CoupledModel
    names : sequence of str
        Names of the outputs and of the inputs in the equations.
    """
    offsets = [each.preprocessing.output_offset for each in model.models if each.preprocessing]
    offsets += model.preprocessing.input_offsets if model.preprocessing else ()
    return join_statements(model, names, (*model.output_names, *model.column_names), offsets)


def coupled_text(model: CoupledModel) -> str:
    """Write one line per output, and one that states the signals, unless they are those of the record."""
    statement = coupled_signals(model)
    return f"{coupled_equation(model)}\nwhere {statement}" if statement else coupled_equation(model)


def coupled_latex(model: CoupledModel) -> str:
    """Write the equations as a LaTeX environment ``aligned`` without dollar signs."""
    rows = [
        _name_leaves(
            r"([yu])_\{(?:(\d+),)?k(?=[-}])",
            "{0}_{{{1}k",
            "{},",
            latex_equation(single, statement=""),
            model,
            place,
        )
        for place, single in enumerate(narx_equations(model))
    ]
    rows = [row.replace(" = ", " &= ", 1) for row in rows]
    if statement := _describe_symbols(model):
        rows.append(rf"& {latex_statement(statement)}")
    lines = " \\\\\n".join(rows)
    return f"\\begin{{aligned}}\n{lines}\n\\end{{aligned}}"


def coupled_mathml(model: CoupledModel) -> str:
    """Write one ``math`` element per output, which browsers render without a library.

    The last elements state the signals, unless they are those of the record.
    """
    leaf = r"<mi>([yu])</mi><mrow>(?:<mn>(\d+)</mn><mo>,</mo>)?<mi>k</mi>"
    equations = [
        _name_leaves(
            leaf,
            "<mi>{0}</mi><mrow>{1}<mi>k</mi>",
            "<mn>{}</mn><mo>,</mo>",
            mathml_equation(single, statement=""),
            model,
            place,
        )
        for place, single in enumerate(narx_equations(model))
    ]
    stated = mathml_statement(_describe_symbols(model))
    return "\n".join([*equations, *(f'<math display="block">{row}</math>' for row in stated)])


def _describe_symbols(model: CoupledModel) -> str:
    return describe_coupled_signals(model, (*output_signals(model), *input_signals(model)))


def _name_leaves(pattern: str, leaf: str, index: str, text: str, model: CoupledModel, place: int) -> str:
    """Replace the signals of one equation by those of the coupled model."""
    names = equation_signals(model, place)

    def name(found: re.Match[str]) -> str:
        signal = names[f"{found[1]}{found[2] or ''}"]
        return leaf.format(signal[0], index.format(signal[1:]) if signal[1:] else "")

    return re.sub(pattern, name, text)

"""Coupled model of latent models: one state space per output, each of which reads the inputs only."""

from dataclasses import dataclass, fields, replace
from itertools import accumulate
from typing import ClassVar

from islands.errors import ModelError
from islands.expressions.tree import Apply, Expression, Lagged, Symbol
from islands.models.block import Block, BlockTerm, subtract_offsets
from islands.models.coupled_narx import (
    CoupledModel,
    describe_coupled_signals,
    input_signals,
    output_signals,
)
from islands.models.equations import latex_statement, mathml_statement, signal_names
from islands.models.latent import LatentModel
from islands.models.protocol import EquationText
from islands.models.signal_statement import describe_values
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset


@dataclass(frozen=True, slots=True)
class CoupledLatentModel(CoupledModel):
    """One latent model per output, with the inputs in common.

    The states of an output have no effect on the other outputs. All inputs of all models are read one sample
    early, or none.

    Attributes
    ----------
    models : tuple of LatentModel
        Models of the outputs; at least two.

    Raises
    ------
    ModelError
        As for `CoupledModel`, or a model is of another class.
    """

    kind: ClassVar[str] = "coupled-latent"

    models: tuple[LatentModel, ...]

    _expected: ClassVar[str] = "the inputs that all outputs share"

    def _check_classes(self) -> None:
        """Check that all models are latent models."""
        for model in self.models:
            if not isinstance(model, LatentModel):
                raise ModelError(f"the model of {model.output_name} is no latent model: {model.kind}")

    def _list_columns(self, _place: int) -> tuple[str, ...]:
        return self.input_names

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.models[0].input_names

    def _describe_signals(self, place: int) -> tuple[object, ...]:
        """Return the preprocessing of the inputs of one model; the outputs have their own offsets."""
        done = self.models[place].preprocessing
        return () if done is None else (done.steps, done.dt, done.input_offsets)

    def separate(self, record: CoupledRecord, place: int) -> Dataset:
        """Return the record that one model reads: the inputs and its output."""
        return record.records[place]

    def channels(self, place: int) -> tuple[int, ...]:
        """Return the channel of the coupled model of the output and of the inputs of one model."""
        outputs = len(self.models)
        return (place, *range(outputs, outputs + len(self.input_names)))

    @property
    def leads(self) -> tuple[int, ...]:
        """Number of samples that every channel is read early: outputs, then inputs."""
        first = self.models[0]
        return (0,) * len(self.models) + first.leads[1 + first.order :]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters: the output, and the name in its model, ``y2: a1_1``."""
        return tuple(
            f"{output}: {name}"
            for output, model in zip(output_signals(self), self.models, strict=True)
            for name in model.names
        )

    def block(self) -> Block:
        """Return the difference equations of all models; the states are numbered one after the other."""
        return self._join([model.block() for model in self._number()])

    def measured_block(self) -> Block:
        """Return the block of the measured signals, with the offsets in its equations."""
        found = self._join([subtract_offsets(each.block(), each.preprocessing) for each in self._number()])
        done = [each.preprocessing for each in self.models if each.preprocessing]
        if not any(value for each in done for value in (each.output_offset, *each.input_offsets)):
            return found
        # The text of the equations is in deviations, so that it states which.
        return replace(found, texts=(*found.texts, f"where {_describe_symbols(self)}"))

    def equation(self) -> EquationText:
        """Return the equations as text: those of each output, with its states after them."""
        # Common statements about the signals are made once.
        plain = (replace(each, preprocessing=None, average=1) for each in self._number())
        written = [each.equation() for each in plain]
        symbols = _describe_symbols(self)
        rows = [each.latex for each in written] + ([latex_statement(symbols)] if symbols else [])
        elements = [f'<math display="block">{row}</math>' for row in mathml_statement(symbols)]
        lines = [each.plain for each in written] + ([f"where {symbols}"] if symbols else [])
        return EquationText(
            line="\n".join(each.line for each in written),
            plain="\n".join(lines),
            named="\n".join(each.named for each in written),
            terms=tuple(f"{signal_names(model)[0]}: {name}" for model in self.models for name in model.names),
            latex="\\begin{{gathered}} {} \\end{{gathered}}".format(" \\\\ ".join(rows)),
            mathml="\n".join([*(each.mathml for each in written), *elements]),
        )

    def _number(self) -> list["_NumberedModel"]:
        """Return the models with the names of their signals in the coupled model."""
        states = accumulate((model.order for model in self.models), initial=0)
        units = accumulate((len(model.units) for model in self.models), initial=0)
        return [
            _NumberedModel(
                **{each.name: getattr(model, each.name) for each in fields(model)},
                output=output,
                states_before=before,
                units_before=units_before,
            )
            for output, model, before, units_before in zip(
                output_signals(self), self.models, states, units, strict=False
            )
        ]

    def _join(self, blocks: list[Block]) -> Block:
        """Return one block of those of the models, which have different names of outputs and of states."""
        outputs, states = len(blocks), sum(model.order for model in self.models)
        moved, parameters, first = [], dict[str, float](), outputs
        for place, (output, model, block) in enumerate(
            zip(output_signals(self), self.models, blocks, strict=True)
        ):
            inputs = range(outputs + states, outputs + states + model.inputs)
            channels = (place, *range(first, first + model.order), *inputs)
            moved.append(_Renaming(f"{output}: ", channels).rename(block))
            parameters |= {f"{output}: {name}": value for name, value in block.parameters.items()}
            first += model.order
        names = [name for block in blocks for name in block.signals[1 : block.computed]]
        return Block(
            equations=(
                *(each.equations[0] for each in moved),
                *(equation for each in moved for equation in each.equations[1:]),
            ),
            columns=(*self.output_names, *names, *self.models[0].column_names),
            signals=(*output_signals(self), *names, *input_signals(self)),
            starts=tuple(start for each in moved for start in each.starts),
            leads=(*self.leads[:outputs], *(0,) * states, *self.leads[outputs:]),
            parameters=parameters,
            warm_up=self.maximum_lag,
            dt=None if self.dt is None else float(self.dt),
            values=describe_values(self),
            texts=tuple(text for block in blocks for text in block.texts),
            levels={name: level for block in blocks for name, level in block.levels.items()},
        )


@dataclass(frozen=True, kw_only=True)
class _NumberedModel(LatentModel):
    """Latent model of one of several outputs, whose states and units are numbered after those before.

    Attributes
    ----------
    output : str
        Name of the output in the equations.
    states_before, units_before : int
        Numbers of states and units of the outputs before it.
    """

    output: str
    states_before: int
    units_before: int

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(f"x{self.states_before + place}" for place in range(1, self.order + 1))

    @property
    def unit_signals(self) -> tuple[str, ...]:
        """Names of the values of the units in displayed equations."""
        return tuple(f"h{self.units_before + place}" for place in range(1, len(self.units) + 1))

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the output, of the states and of the inputs in the equations."""
        _, *inputs = super().signals[len(self.states) :]
        return (self.output, *self.states, *inputs)


@dataclass(frozen=True, slots=True)
class _Renaming:
    """New channels of the signals of a block, and the text before the names of its parameters."""

    prefix: str
    channels: tuple[int, ...]

    def rename(self, block: Block) -> Block:
        """Return the equations and the starts of a block with the new names."""
        equations = tuple(
            tuple(
                BlockTerm(
                    self._replace(term.expression), f"{self.prefix}{term.weight}" if term.weight else ""
                )
                for term in equation
            )
            for equation in block.equations
        )
        return replace(block, equations=equations, starts=tuple(map(self._replace, block.starts)))

    def _replace(self, expression: Expression) -> Expression:
        """Replace channels and names. The arguments keep their order, so that a value keeps its last bits."""
        match expression:
            case Lagged(channel, lag):
                return Lagged(self.channels[channel], lag)
            case Symbol(name):
                return Symbol(f"{self.prefix}{name}")
            case Apply(primitive, arguments):
                return Apply(primitive, tuple(map(self._replace, arguments)))
        return expression


def _describe_symbols(model: CoupledLatentModel) -> str:
    return describe_coupled_signals(model, (*output_signals(model), *input_signals(model)))

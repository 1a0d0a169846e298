"""Coupled model of latent models, which read the inputs only: one state space, or one per output."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import accumulate
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

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
from islands.models.linearisation import OperatingPoint
from islands.models.protocol import EquationText
from islands.models.signal_statement import describe_values
from islands.models.state_space import StateSpace
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset


@dataclass(frozen=True, slots=True)
class CoupledLatentModel(CoupledModel):
    """One latent model per output, with the inputs in common.

    The states of an output have no effect on the other outputs, or all outputs have the same states: models
    with equal equations of the states are one state space. All inputs of all models are read one sample
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
    def shares_states(self) -> bool:
        """Whether the equations of the states of all models are equal."""
        first = self.models[0]
        return first.order > 0 and all(
            each.state_equations == first.state_equations for each in self.models[1:]
        )

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters: the output, and the name in its model, ``y2: a1_1``.

        Those of shared states have no output before them.
        """
        return tuple(self._name_parameters(output_signals(self)))

    @property
    def parameters(self) -> tuple[float, ...]:
        """Parameters of all models; those of shared states once."""
        return tuple(self._name_parameters(output_signals(self)).values())

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.parameter_names)

    @property
    def standard_errors(self) -> tuple[float, ...] | None:
        """None: the parameters of latent models have no standard errors."""
        return None

    def with_parameters(
        self,
        theta: Sequence[float],
        standard_errors: Sequence[float] | None = None,  # noqa: ARG002 - as of other models
    ) -> "CoupledLatentModel":
        """Return a copy with the given parameters."""
        named, shares = dict(zip(self.parameter_names, theta, strict=True)), self.shares_states
        return replace(
            self,
            models=tuple(
                model.with_parameters([named[_name_parameter(output, name, shares)] for name in model.names])
                for output, model in zip(output_signals(self), self.models, strict=True)
            ),
        )

    def _name_parameters(self, outputs: Iterable[str]) -> dict[str, float]:
        """Return the parameters by name, with the given names of the outputs."""
        shares = self.shares_states
        return {
            _name_parameter(output, name, shares): value
            for output, model in zip(outputs, self.models, strict=True)
            for name, value in zip(model.names, model.parameters, strict=True)
        }

    def block(self) -> Block:
        """Return the difference equations of all models; the states are numbered one after the other."""
        return _make_block(self)

    def make_block(self) -> Block:
        """Return a new block; `block` returns that of recent models again, since many states take long."""
        return self._join([model.make_block() for model in self._number()])

    def measured_block(self) -> Block:
        """Return the block of the measured signals, with the offsets in its equations."""
        found = self._join(
            [subtract_offsets(each.make_block(), each.preprocessing) for each in self._number()]
        )
        done = [each.preprocessing for each in self.models if each.preprocessing]
        if not any(value for each in done for value in (each.output_offset, *each.input_offsets)):
            return found
        # The text of the equations is in deviations, so that it states which.
        return replace(found, texts=(*found.texts, f"where {_describe_symbols(self)}"))

    def linearise(
        self, operating_point: OperatingPoint | None = None, y: ArrayLike | None = None
    ) -> StateSpace:
        """Return the linear system of small deviations; see `DynamicModel.linearise`."""
        if not self.shares_states:
            return CoupledModel.linearise(self, operating_point, y)
        # A kink at rest has the slope zero, as in the model of one output: an amplitude does not respond.
        systems = [model.linearise(operating_point, y) for model in self.models]
        return replace(
            systems[0],
            C=np.vstack([each.C for each in systems]),
            D=np.vstack([each.D for each in systems]),
            output_names=self.output_names,
            output_units=tuple(each.output_units[0] for each in systems),
            operating_outputs=tuple(each.operating_outputs[0] for each in systems),
        )

    def equation(self) -> EquationText:
        """Return the equations as text: those of each output, with its states after them."""
        # Common statements about the signals are made once.
        plain = [replace(each, preprocessing=None, average=1) for each in self._number()]
        if self.shares_states:
            plain = [plain[0], *(replace(each, is_output_only=True) for each in plain[1:])]
        written = [each.equation() for each in plain]
        symbols = _describe_symbols(self)
        rows = [each.latex for each in written] + ([latex_statement(symbols)] if symbols else [])
        elements = [f'<math display="block">{row}</math>' for row in mathml_statement(symbols)]
        lines = [each.plain for each in written] + ([f"where {symbols}"] if symbols else [])
        return EquationText(
            line="\n".join(each.line for each in written),
            plain="\n".join(lines),
            named="\n".join(each.named for each in written),
            terms=tuple(self._name_parameters([signal_names(model)[0] for model in self.models])),
            latex="\\begin{{gathered}} {} \\end{{gathered}}".format(" \\\\ ".join(rows)),
            mathml="\n".join([*(each.mathml for each in written), *elements]),
        )

    def _number(self) -> list["_NumberedModel"]:
        """Return the models with the names of their signals in the coupled model."""
        own = not self.shares_states
        states = accumulate((own * model.order for model in self.models), initial=0)
        units = accumulate((own * len(model.units) for model in self.models), initial=0)
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
        outputs, shares = len(blocks), self.shares_states
        orders = [0 if shares and place else model.order for place, model in enumerate(self.models)]
        moved, first = [], outputs
        for place, (output, model, block) in enumerate(
            zip(output_signals(self), self.models, blocks, strict=True)
        ):
            inputs = range(outputs + sum(orders), outputs + sum(orders) + model.inputs)
            own = range(outputs, outputs + model.order) if shares else range(first, first + model.order)
            found = _Renaming(output, shares, (place, *own, *inputs)).rename(block)
            if not orders[place] and model.order:
                found = replace(found, equations=found.equations[:1], starts=())
            moved.append(found)
            first += orders[place]
        names = [
            name for block, order in zip(blocks, orders, strict=True) for name in block.signals[1 : 1 + order]
        ]
        return Block(
            equations=(
                *(each.equations[0] for each in moved),
                *(equation for each in moved for equation in each.equations[1:]),
            ),
            columns=(*self.output_names, *names, *self.models[0].column_names),
            signals=(*output_signals(self), *names, *input_signals(self)),
            starts=tuple(start for each in moved for start in each.starts),
            leads=(*self.leads[:outputs], *(0,) * sum(orders), *self.leads[outputs:]),
            parameters=self._name_parameters(output_signals(self)),
            warm_up=self.maximum_lag,
            dt=None if self.dt is None else float(self.dt),
            values=describe_values(self),
            texts=tuple(
                text
                for block, each in zip(blocks, moved, strict=True)
                for text in block.texts[: len(each.equations)]
            ),
            levels={name: level for block in blocks for name, level in block.levels.items()},
        )


@lru_cache(maxsize=16)
def _make_block(model: CoupledLatentModel) -> Block:
    return model.make_block()


@dataclass(frozen=True, kw_only=True)
class _NumberedModel(LatentModel):
    """Latent model of one of several outputs, whose states and units are numbered after those before.

    Attributes
    ----------
    output : str
        Name of the output in the equations.
    states_before, units_before : int
        Numbers of states and units of the outputs before it.
    is_output_only : bool
        Whether the text has the equation of the output only: another model states those of the states.
    """

    output: str
    states_before: int
    units_before: int
    is_output_only: bool = False

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

    def _display(self) -> tuple[dict[str, str], tuple[str, ...]]:
        sides, names = super()._display()
        return ({self.output: sides[self.output]} if self.is_output_only else sides), names


def _name_parameter(output: str, name: str, shares: bool) -> str:
    """Return the name of a parameter of one model in the coupled model."""
    return name if shares and not LatentModel.is_of_output(name) else f"{output}: {name}"


@dataclass(frozen=True, slots=True)
class _Renaming:
    """New channels of the signals of the block of an output, and new names of its parameters."""

    output: str
    shares: bool
    channels: tuple[int, ...]

    def _name(self, name: str) -> str:
        return _name_parameter(self.output, name, self.shares)

    def rename(self, block: Block) -> Block:
        """Return the equations and the starts of a block with the new names."""
        equations = tuple(
            tuple(
                BlockTerm(self._replace(term.expression), self._name(term.weight) if term.weight else "")
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
                return Symbol(self._name(name))
            case Apply(primitive, arguments):
                return Apply(primitive, tuple(map(self._replace, arguments)))
        return expression


def _describe_symbols(model: CoupledLatentModel) -> str:
    return describe_coupled_signals(model, (*output_signals(model), *input_signals(model)))

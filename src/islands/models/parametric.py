"""Base of model classes whose parameters are estimated by the error of the free run.

A subclass states its difference equations as text; simulation, estimation, files, exports, diagnosis and the
service work with them. Add it to ``islands.persistence.models.MODEL_CLASSES``.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, ClassVar, Self

from numpy.typing import ArrayLike

from islands.errors import ModelError
from islands.expressions.parsing import parse_signals
from islands.expressions.printing import (
    LatexSignals,
    MathmlSignals,
    PlainSignals,
    Printer,
)
from islands.expressions.tree import Constant, Expression, Lagged, replace_leaves, substitute
from islands.models.block import Block, BlockTerm, subtract_offsets
from islands.models.equations import latex_statement, mathml_statement, signal_names
from islands.models.linearisation import OperatingPoint, linearise_block
from islands.models.protocol import EquationText
from islands.models.signal_statement import describe_signals, describe_values, symbols
from islands.models.state_space import StateSpace
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset
from islands.records.preprocessing_steps import Preprocessing

#: Significant digits of the parameters in the text of an equation.
_DIGITS = 6


@dataclass(frozen=True, kw_only=True)
class ParametricModel(ABC):
    """Model with named parameters and difference equations of its output and of its states.

    Attributes
    ----------
    parameters : tuple of float
        In the order of ``names``.
    input_names, output_name, dt, average, preprocessing
        As of `DynamicModel`.
    standard_errors : tuple of float or None
        Standard errors of the parameters. None if unknown.

    Raises
    ------
    ModelError
        The number of parameters or of standard errors is not that of ``names``.
    """

    #: Tag of the class in documents.
    kind: ClassVar[str]

    #: Description of the class in one sentence.
    summary: ClassVar[str]

    parameters: tuple[float, ...]
    input_names: tuple[str, ...]
    output_name: str
    dt: float | None = None
    average: int = 1
    preprocessing: Preprocessing | None = None
    standard_errors: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for values in (self.parameters, self.standard_errors):
            if values is not None and len(values) != len(self.names):
                raise ModelError(f"a model {self.kind} has the parameters {', '.join(self.names)}")

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the parameters; an attribute of a class whose models have one structure."""

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states, ``x1``, ``x2``."""
        return ()

    @property
    def starts(self) -> tuple[str, ...]:
        """Values of the states before the first prediction."""
        return ()

    @property
    def maximum_lag(self) -> int:
        """Number of past samples before the first prediction."""
        return 1

    @abstractmethod
    def right_sides(self) -> Mapping[str, str]:
        """Return the right side of the equation of the output, ``y`` or ``signals[0]``, and of each state.

        It reads past samples of signals, ``u(k-1)`` or ``u2(k-1)``, and parameters by name. That of the
        output may also read sample k of the states.
        """

    @classmethod
    def start(cls, _record: Dataset) -> Iterable[Self]:
        """Yield models with parameters from which the estimation on a record starts.

        A class whose structures are searched has none.
        """
        return ()

    @classmethod
    def of_record(cls, record: Dataset, parameters: Sequence[float]) -> Self:
        """Return a model with the columns and the sampling time of a record."""
        return cls(
            parameters=tuple(map(float, parameters)),
            input_names=record.input_names,
            output_name=record.output_name,
            dt=record.dt,
            preprocessing=record.preprocessing,
        )

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.names)

    @property
    def free_size(self) -> int:
        """Number of parameters that the response determines; all of them, unless some are coordinates."""
        return self.size

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.names

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.input_names)

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names of the inputs without the suffix ``+1``."""
        return tuple(parse_channel_name(name).base for name in self.input_names)

    @property
    def leads(self) -> tuple[int, ...]:
        """Number of samples that each signal of the block is read early."""
        early = (int(parse_channel_name(name).at_once) for name in self.input_names)
        return (0,) * (1 + len(self.states)) + tuple(early)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the output, of the states and of the inputs in the equations."""
        output, *inputs = symbols(self.inputs)
        return (output, *self.states, *inputs)

    def with_parameters(
        self, values: Sequence[float], standard_errors: Sequence[float] | None = None
    ) -> Self:
        """Return a copy of the model with the given parameters and standard errors."""
        errors = None if standard_errors is None else tuple(map(float, standard_errors))
        return replace(self, parameters=tuple(map(float, values)), standard_errors=errors)

    def block(self) -> Block:
        """Return the difference equations of the model."""
        sides = self.right_sides()
        texts = [self._parse(sides[name]) for name in self.signals[: 1 + len(self.states)]]
        return Block(
            equations=tuple((BlockTerm(each),) for each in texts),
            columns=(self.output_name, *self.states, *self.column_names),
            signals=self.signals,
            starts=tuple(map(self._parse, self.starts)),
            leads=self.leads,
            parameters=dict(zip(self.names, self.parameters, strict=True)),
            warm_up=self.maximum_lag,
            dt=None if self.dt is None else float(self.dt),
            values=describe_values(self),
            texts=tuple(self._write_lines(sides, self.signals, self.signals)),
        )

    def linearise(
        self, operating_point: OperatingPoint | None = None, y: ArrayLike | None = None
    ) -> StateSpace:
        """Return the linear system of small deviations; see `DynamicModel.linearise`."""
        return linearise_block(subtract_offsets(self.block(), self.preprocessing), operating_point, y)

    def _parse(self, text: str) -> Expression:
        return parse_signals(text, self.signals)

    def equation(self) -> EquationText:
        """Return the equations as text, with the values of the parameters."""
        return self.write_equation(self.right_sides())

    def write_equation(self, sides: Mapping[str, str], further: Sequence[str] = ()) -> EquationText:
        """Return equations as text.

        Parameters
        ----------
        sides : mapping
            Right sides of the output ``y``, of the states and of further signals.
        further : sequence of str
            Names of signals that only the text has.
        """
        output, *inputs = signal_names(self)
        signals = self._insert(further)
        statement = describe_signals(self)
        line = "\n".join(self._write_lines(sides, signals, signals))
        rows = self._write(sides, signals, LatexSignals(signals), " = ")
        rows += [latex_statement(statement)] if statement else []
        written = self._write(sides, signals, MathmlSignals(signals), "<mo>=</mo>")
        elements = [f"<mrow>{each}</mrow>" for each in written] + mathml_statement(statement)
        named = (output, *self.states, *further, *inputs)
        return EquationText(
            line=line,
            plain=f"{line}\nwhere {statement}" if statement else line,
            named="\n".join(self._write_lines(sides, signals, named)),
            terms=self.names,
            latex=rows[0] if len(rows) == 1 else _gather(rows),
            mathml="\n".join(f'<math display="block">{each}</math>' for each in elements),
        )

    def _insert(self, further: Sequence[str]) -> tuple[str, ...]:
        """Return the signals with further ones before the inputs."""
        computed = 1 + len(self.states)
        return (*self.signals[:computed], *further, *self.signals[computed:])

    def _write_lines(
        self, sides: Mapping[str, str], signals: Sequence[str], names: Sequence[str]
    ) -> list[str]:
        """Return the equations as plain text with the given names of the signals."""
        return self._write(sides, signals, PlainSignals(names), " = ")

    def _write(
        self, sides: Mapping[str, str], signals: Sequence[str], printer: Printer, equals: str
    ) -> list[str]:
        """Return the equations as a printer writes them, with numbers and the signals of the record at k."""
        numbers: dict[str, Expression] = {
            name: Constant(float(f"{value:.{_DIGITS}g}"))
            for name, value in zip(self.names, self.parameters, strict=True)
        }
        leads = dict(zip(self.signals, self.leads, strict=True))

        def delay(leaf: Lagged) -> Expression:
            return Lagged(leaf.channel, leaf.lag - leads.get(signals[leaf.channel], 0))

        return [
            f"{printer.write(Lagged(signals.index(name), 0))}{equals}"
            f"{printer.write(substitute(replace_leaves(parse_signals(side, signals), delay), numbers))}"
            for name, side in sides.items()
        ]

    def document(self) -> dict[str, Any]:
        """Return the model as JSON values."""
        errors = self.standard_errors or (None,) * self.size
        return {
            "inputs": list(self.input_names),
            "output": self.output_name,
            "dt": self.dt,
            "average": self.average,
            "preprocessing": None if self.preprocessing is None else self.preprocessing.as_document(),
            "equation": self.equation().line,
            "parameters": [
                {"name": name, "value": value, "standard_error": error}
                for name, value, error in zip(self.names, self.parameters, errors, strict=True)
            ],
        }

    @classmethod
    def read(cls, document: Mapping[str, Any], name: str) -> Self:
        """Return the model of JSON values.

        Parameters
        ----------
        document : mapping
            As of `document`.
        name : str
            Name of the file, for messages.

        Raises
        ------
        ModelError
            A field is missing or invalid.
        """
        try:
            if not document["inputs"]:
                raise KeyError("inputs")
            structure = cls.read_structure(document)
            entries = {entry["name"]: entry for entry in document["parameters"]}
            # A class of one structure has its names as an attribute.
            names: tuple[str, ...] = tuple(entries) if structure else cls.names  # type: ignore[assignment]
            values = tuple(float(entries[each]["value"]) for each in names)
            errors = [entries[each].get("standard_error") for each in names]
            steps = document.get("preprocessing")
            found = cls(
                parameters=values,
                input_names=tuple(map(str, document["inputs"])),
                output_name=str(document["output"]),
                dt=None if document.get("dt") is None else float(document["dt"]),
                average=int(document.get("average", 1)),
                preprocessing=None if steps is None else Preprocessing.from_document(steps),
                standard_errors=None if None in errors else tuple(map(float, errors)),
                **structure,
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ModelError(f"{name} is not a model {cls.kind}: {error!r} is missing or invalid") from error
        if not all(map(isfinite, found.parameters)):
            raise ModelError(f"{name} is not a model {cls.kind}: it needs finite parameters")
        return found

    @classmethod
    def read_structure(cls, _document: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of the structure of JSON values; none if all models of the class have one."""
        return {}


def _gather(rows: Sequence[str]) -> str:
    lines = " \\\\ ".join(rows)
    return f"\\begin{{gathered}} {lines} \\end{{gathered}}"

"""State space with static units: a linear system with a few curves in its feedback.

    x(k+1) = A x(k) + B u(k) + E h(k) + o,    h(k) = f(W x(k) + V u(k) + s)
    y(k)   = C x(k) + D u(k) + F h(k) + level

A unit is a function of one argument (see `unit_functions`). Parameters that are zero are not part of a model,
so that Wiener, Hammerstein and feedback systems are structures of one class (nonlinear linear-fractional
representation: Schoukens and Toth, Automatica 113 (2020) 108731).
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from math import isfinite, nan, prod
from types import MappingProxyType
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import ModelError
from islands.models.block import Block
from islands.models.equations import signal_names
from islands.models.linearisation import OperatingPoint, choose_levels
from islands.models.parametric import ParametricModel
from islands.models.protocol import EquationText
from islands.models.signal_statement import symbols
from islands.models.state_space import Quantity, StateSpace, describe_poles, write_error
from islands.models.state_space_rest import find_rest, linearise
from islands.models.unit_functions import find_codes, parse_unit
from islands.records.channel_names import parse_channel_name
from islands.records.flat_extremes import NO_LIMITS, SensorLimits

#: Blocks of parameters that are zero in the structure of a system: effects of the units on the states or on
#: the output, or weights of the states in the arguments of the units.
ZERO_BLOCKS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"auto": (), "wiener": ("E",), "hammerstein": ("W of the states",), "feedback": ("F",)}
)

#: Meaning of each structure.
STRUCTURE_SUMMARIES: Mapping[str, str] = MappingProxyType(
    {
        "auto": "units read and act anywhere",
        "wiener": "no unit acts on the states",
        "hammerstein": "no unit reads a state",
        "feedback": "no unit acts on the output directly",
    }
)

_Entry = TypeVar("_Entry", bound=np.generic)

#: Writes the product of a parameter, given by name, and the text of a factor; the parameter for no factor.
Factor = Callable[[str, str], str]

#: Significant digits of the numbers in the text of an equation.
_DIGITS = 6


@dataclass(frozen=True, slots=True)
class StateSpaceLayout:
    """Sizes of a state space with units; the names of all of its parameters in the order of the kernel.

    Attributes
    ----------
    order, inputs, units : int
        Numbers of states, inputs and units.
    """

    order: int
    inputs: int
    units: int

    @property
    def blocks(self) -> dict[str, tuple[str, ...]]:
        """Names of the entries of each matrix, row by row."""
        states, inputs, units = (range(1, size + 1) for size in (self.order, self.inputs, self.units))
        one = self.inputs == 1
        return {
            "A": tuple(f"a{i}_{j}" for i in states for j in states),
            "B": tuple(f"b{i}" if one else f"b{i}_{j}" for i in states for j in inputs),
            "C": tuple(f"c{i}" for i in states),
            "D": ("d",) if one else tuple(f"d{j}" for j in inputs),
            "E": tuple(f"e{i}_{unit}" for i in states for unit in units),
            "F": tuple(f"f{unit}" for unit in units),
            "W": tuple(
                name
                for unit in units
                for name in (
                    *(f"w{unit}_{j}" for j in states),
                    *(f"v{unit}" if one else f"v{unit}_{j}" for j in inputs),
                )
            ),
            "s": tuple(f"s{unit}" for unit in units),
            "o": tuple(f"o{i}" for i in states),
            "level": ("level",),
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return tuple(name for names in self.blocks.values() for name in names)

    def split(self, values: NDArray[_Entry]) -> dict[str, NDArray[_Entry]]:
        """Return views of the entries of each matrix in its shape, of a value for each parameter."""
        order, inputs, units = self.order, self.inputs, self.units
        shapes: dict[str, tuple[int, ...]] = {
            "A": (order, order),
            "B": (order, inputs),
            "C": (order,),
            "D": (inputs,),
            "E": (order, units),
            "F": (units,),
            "W": (units, order + inputs),
            "s": (units,),
            "o": (order,),
            "level": (1,),
        }
        found, at = {}, 0
        for name, shape in shapes.items():
            size = prod(shape)
            found[name] = values[at : at + size].reshape(shape)
            at += size
        return found

    def join(self, blocks: Mapping[str, NDArray[_Entry]]) -> NDArray[_Entry]:
        """Return a value for each parameter from the entries of each matrix, as `split` returns them."""
        return np.concatenate([blocks[name].ravel() for name in self.blocks])

    def find_matrices(self, theta: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return views of the parameters by name, as in the equations, with the weights W and V apart.

        The shapes are (states, states) of A, (states, inputs) of B, (states, units) of E, (units, states) of
        W, (units, inputs) of V, and one dimension for C, D, F, s, o and level.
        """
        blocks = self.split(theta)
        weights = blocks["W"]
        return {**blocks, "W": weights[:, : self.order], "V": weights[:, self.order :]}


@dataclass(frozen=True, kw_only=True)
class LatentModel(ParametricModel):
    """State space with static units.

    Attributes
    ----------
    order : int
        Number of states.
    units : tuple of str
        Function of each unit, as `parse_unit` reads it.
    wiring : tuple of str
        Names of the parameters that are not zero, in the order of `StateSpaceLayout`.
    memory : int
        Number of samples from which the initial states of a free run are estimated.
    operating_inputs : tuple of float
        Inputs of the operating point: those of a stated gain, or the means of the estimation data.
    delays : tuple of int
        Dead time of each input in samples; none if empty.
    limits : SensorLimits
        Least and greatest output that the sensor shows.
    quantity_errors : tuple of float or None
        Standard errors of ``quantities``. The parameters have none: a change of the coordinates of the states
        alters them without an effect on the output. NaN of a quantity without one. None if unknown.

    Raises
    ------
    ModelError
        A unit or a name is unknown, the output reads an input at sample k that is not read one sample early,
        or the memory is shorter than a dead time.
    """

    kind: ClassVar[str] = "latent"
    summary: ClassVar[str] = "State space with static units: a linear system with curves in its feedback."

    order: int
    units: tuple[str, ...] = ()
    wiring: tuple[str, ...]
    memory: int
    operating_inputs: tuple[float, ...]
    delays: tuple[int, ...] = ()
    limits: SensorLimits = NO_LIMITS
    quantity_errors: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for unit in self.units:
            parse_unit(unit)
        if tuple(name for name in self.layout.names if name in self.names) != self.names:
            known = ", ".join(self.layout.names)
            raise ModelError(f"the parameters of a model {self.kind} are some of {known}, in this order")
        if len(self.delays) not in (0, self.inputs):
            raise ModelError(f"{len(self.delays)} dead times for {self.inputs} inputs")
        if not all(self.input_lags[place] for place in find_direct(self.names)):
            raise ModelError("the output reads the inputs at sample k: read them one sample early (u+1)")
        if self.memory <= max(self.input_lags):
            raise ModelError(f"a memory of {self.memory} samples is shorter than a dead time of the model")

    @property
    def layout(self) -> StateSpaceLayout:
        """Sizes and names of all parameters."""
        return StateSpaceLayout(self.order, self.inputs, len(self.units))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.wiring

    @property
    def maximum_lag(self) -> int:
        """Number of samples before the first prediction."""
        return self.memory

    @property
    def free_size(self) -> int:
        """Number of parameters that the response determines.

        Those of a linear model are its poles, the numerators and direct paths of every input, its dead times,
        and the level or the drift; the coordinates of the states add further parameters to the equations. Of
        a model with units, the scale of every state is one.
        """
        if self.units:
            return self.size - self.order
        numerators = sum(name[0] in "bd" for name in self.names)
        has_level = any(name[0] in "lo" for name in self.names)
        return self.order + numerators + sum(map(bool, self.delays)) + has_level

    @property
    def structure(self) -> str:
        """Order, units and dead times as text: ``order 2, 2 tanh, dead time of u_V 0.3 s``."""
        step, unit = (1.0, "samples") if self.dt is None else (self.dt, "s")
        late = zip(self.column_names, self.delays, strict=False)
        parts = [f"dead time of {name} {delay * step:.4g} {unit}" for name, delay in late if delay]
        units = [f"{count} {name}" if count > 1 else name for name, count in Counter(self.units).items()]
        return ", ".join([f"order {self.order}", *units, *parts])

    @property
    def input_lags(self) -> tuple[int, ...]:
        """Number of samples by which the output and the states read each column of the inputs late."""
        return tuple(
            delay + parse_channel_name(name).at_once
            for delay, name in zip(self.delays or (0,) * self.inputs, self.input_names, strict=True)
        )

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(f"x{place}" for place in range(1, self.order + 1))

    @property
    def unit_signals(self) -> tuple[str, ...]:
        """Names of the values of the units in displayed equations."""
        return tuple(f"h{unit}" for unit in self._places)

    @property
    def starts(self) -> tuple[str, ...]:
        """The states rest at the operating point before the first prediction, unless they are estimated."""
        return tuple(repr(float(value)) for value in self.rest)

    @property
    def rest(self) -> NDArray[np.float64]:
        """States at rest at the operating point, shape (states,); zeros if they are not found."""
        return np.zeros(self.order) if self._rest is None else self._rest

    @cached_property
    def _rest(self) -> NDArray[np.float64] | None:
        return find_rest(self.matrices, self.codes, np.array(self.operating_inputs), np.zeros(self.order))

    @property
    def operating_point(self) -> str:
        """Where the model is linearised, with the columns of the record: ``rest at u_V = 0.1``."""
        return self._name_point(signal_names(self)[1:])

    def _name_point(self, names: Sequence[str]) -> str:
        pairs = zip(names, self.operating_inputs, strict=True)
        where = "rest" if self._rest is not None else "states of zero, since no rest was found,"
        return f"{where} at {', '.join(f'{name} = {value:.4g}' for name, value in pairs)}"

    @cached_property
    def matrices(self) -> Mapping[str, NDArray[np.float64]]:
        """Blocks of the parameters by name, as in the equations; see `StateSpaceLayout.find_matrices`."""
        return self.layout.find_matrices(self.theta)

    def linearise(
        self, operating_point: OperatingPoint | None = None, y: ArrayLike | None = None
    ) -> StateSpace:
        """Return the linear system of small deviations; see `DynamicModel.linearise`.

        By default the operating point is that of the model, with states of zero if they are not found to rest
        there.
        """
        if y is not None:
            raise ModelError(
                "the states of this model determine its output: leave out the output of the operating point"
            )
        done = self.preprocessing
        offsets = np.array(done.input_offsets if done else (0.0,) * self.inputs)
        levels = choose_levels(self.column_names, (offsets + self.operating_inputs).tolist(), operating_point)
        u, x = np.array(self.operating_inputs), self.rest
        if operating_point is not None:
            u = np.array(levels) - offsets
            found = find_rest(self.matrices, self.codes, u, self.rest)
            if found is None and self.units:
                raise ModelError(
                    f"the model is not found to rest at the inputs {levels}: take another operating point"
                )
            x = self.rest if found is None else found
        of, at = self.matrices, linearise(self.matrices, self.codes, x, u)
        y0 = float(of["C"] @ x + of["D"] @ u + of["F"] @ at.values + of["level"][0])
        return replace(
            at.system,
            dt=self.dt,
            dead_times=tuple(delay * (1.0 if self.dt is None else self.dt) for delay in self.delays),
            input_names=self.column_names,
            output_names=(self.output_name,),
            input_units=tuple(parse_channel_name(name).unit for name in self.column_names),
            output_units=(parse_channel_name(self.output_name).unit,),
            operating_inputs=tuple(levels),
            operating_outputs=(y0 + (done.output_offset if done else 0.0),),
        )

    @staticmethod
    def is_of_output(name: str) -> bool:
        """Return whether a parameter is one of the equation of the output, not of the states or the units."""
        return name[0] in "cdfl"

    @property
    def state_equations(self) -> tuple[object, ...]:
        """What determines the states: two models with equal ones have the same states."""
        pairs = zip(self.names, self.parameters, strict=True)
        values = tuple(pair for pair in pairs if not self.is_of_output(pair[0]))
        return self.order, self.units, self.input_names, self.delays, self.operating_inputs, values

    @property
    def reads_at_once(self) -> bool:
        """Whether the output reads an input at sample k, itself or through a unit."""
        return reads_at_once(self.names, self.delays)

    @property
    def theta(self) -> NDArray[np.float64]:
        """All parameters in the order of the kernel, with zeros."""
        values = dict(zip(self.names, self.parameters, strict=True))
        return np.array([values.get(name, 0.0) for name in self.layout.names])

    @property
    def codes(self) -> NDArray[np.int64]:
        """Codes of the units for the kernel."""
        return find_codes(self.units)

    def block(self) -> Block:
        """Return the difference equations; the inputs are those of the operating point before a start."""
        return _make_block(self)

    def make_block(self) -> Block:
        """Return a new block; `block` returns that of recent models again, since many states take long."""
        found = super().block()
        levels = zip(found.signals[found.computed :], self.operating_inputs, strict=True)
        return replace(found, levels=dict(levels))

    def right_sides(self) -> Mapping[str, str]:
        """Return the equations of the output and of the states, with the units inside."""
        units = {lag: [self._write_unit(unit, lag, _name_factor) for unit in self._places] for lag in (0, 1)}
        return self._write_sides(units, _name_factor, repr)

    def equation(self) -> EquationText:
        """Return the equations as text, with the values of the parameters and with the units as signals."""
        written = self.write_equation(*self._display())
        if self.dt is None:
            return written
        note = "" if self.known_errors is None else " (+- standard errors)"
        plain, named = (
            f"\nabout {self._name_point(names)}{note}: {'; '.join(self._describe_modes(names))}"
            for names in (symbols(self.inputs)[1:], signal_names(self)[1:])
        )
        return replace(written, plain=written.plain + plain, named=written.named + named)

    def describe_modes(self) -> tuple[str, ...]:
        """State the time constants and resonances at rest at the operating point; empty without a time.

        With standard errors, the static gains follow, with the columns of the record.
        """
        return self._describe_modes(signal_names(self)[1:])

    def _describe_modes(self, names: Sequence[str]) -> tuple[str, ...]:
        if self.dt is None:
            return ()
        errors, system = self.known_errors, self.linearise()
        modes = describe_poles(system.poles, self.dt, errors)
        if errors is None:
            return modes
        written = [
            f"{each.name} of {names[each.input - 1]} {each.value:.4g}{write_error(error)}"
            + f" {each.unit}".rstrip()
            for each, error in zip(self.quantities, errors, strict=True)
            if each.input is not None
        ]
        return (*modes, *written)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities of the modes, slowest first, and static gains, at rest at the operating point.

        Empty without a time.
        """
        return self.linearise().quantities

    @property
    def known_errors(self) -> tuple[float, ...] | None:
        """Standard errors of the quantities; None if they are those of other ones.

        A pole that is zero but for rounding may be a delay on one machine, and a mode on another.
        """
        errors = self.quantity_errors
        return errors if errors is not None and len(errors) == len(self.quantities) else None

    def with_parameters(
        self, values: Sequence[float], standard_errors: Sequence[float] | None = None
    ) -> Self:
        """Return a copy of the model with other parameters; standard errors of quantities are unknown."""
        return replace(super().with_parameters(values, standard_errors), quantity_errors=None)

    def list_quantities(self) -> list[dict[str, Any]]:
        """Return the quantities and standard errors as JSON values; the gain of an integrator is null."""
        found = self.quantities
        errors = self.known_errors or (nan,) * len(found)
        return [
            {
                **asdict(each),
                "value": each.value if isfinite(each.value) else None,
                "standard_error": error if isfinite(error) else None,
            }
            for each, error in zip(found, errors, strict=True)
        ]

    def _display(self) -> tuple[dict[str, str], tuple[str, ...]]:
        """Return the right sides of all displayed signals with numbers, and the names of the units."""
        values = {name: _round(value) for name, value in zip(self.names, self.parameters, strict=True)}

        def write(name: str, factor: str) -> str:
            return f"{values[name]}*{factor}" if factor else values[name]

        names = self.unit_signals
        units = {0: [f"{name}(k)" for name in names], 1: [f"{name}(k-1)" for name in names]}
        sides = self._write_sides(units, write, _round)
        for name, unit in zip(names, self._places, strict=True):
            sides[name] = parse_unit(self.units[unit - 1]).display(self._write_argument(unit, 0, write))
        return sides, names

    @property
    def _places(self) -> range:
        return range(1, len(self.units) + 1)

    def _write_sides(
        self, units: Mapping[int, Sequence[str]], write: Factor, number: Callable[[float], str]
    ) -> dict[str, str]:
        """Return the right sides of the output and of the states; ``units`` are the texts by lag."""
        now = [(f"c{place}", f"{name}(k)") for place, name in enumerate(self.states, start=1)]
        now += self._read_inputs("d", "d", 0)
        now += [(f"f{unit}", text) for unit, text in zip(self._places, units[0], strict=True)]
        sides = {self.signals[0]: self.limits.write(self._sum([*now, ("level", "")], write), number)}
        for row, state in enumerate(self.states, start=1):
            past = [(f"a{row}_{place}", f"{name}(k-1)") for place, name in enumerate(self.states, start=1)]
            past += self._read_inputs(f"b{row}", f"b{row}_", 1)
            past += [(f"e{row}_{unit}", text) for unit, text in zip(self._places, units[1], strict=True)]
            sides[state] = self._sum([*past, (f"o{row}", "")], write)
        return sides

    def _write_unit(self, unit: int, lag: int, write: Factor) -> str:
        """Return the text of a unit at sample k - lag."""
        return parse_unit(self.units[unit - 1]).write(self._write_argument(unit, lag, write))

    def _write_argument(self, unit: int, lag: int, write: Factor) -> str:
        """Return the text of the argument of a unit at sample k - lag."""
        at = f"(k-{lag})" if lag else "(k)"
        terms = [(f"w{unit}_{place}", f"{name}{at}") for place, name in enumerate(self.states, start=1)]
        terms += self._read_inputs(f"v{unit}", f"v{unit}_", lag)
        return self._sum([*terms, (f"s{unit}", "")], write)

    def _read_inputs(self, only: str, prefix: str, lag: int) -> list[tuple[str, str]]:
        """Return the parameter and the text of every input at sample k - lag."""
        found = []
        names = symbols(self.inputs)[1:]
        for place, (name, late) in enumerate(zip(names, self.input_lags, strict=True), start=1):
            sample = f"{name}(k-{lag + late})" if lag + late else f"{name}(k)"
            found.append((only if self.inputs == 1 else f"{prefix}{place}", sample))
        return found

    def _sum(self, terms: Iterable[tuple[str, str]], write: Factor) -> str:
        """Return the sum of the terms whose parameters are not zero."""
        written = [write(name, factor) for name, factor in terms if name in self.names]
        return " + ".join(written) or "0"

    def document(self) -> dict[str, Any]:
        """Return the model as JSON values."""
        structure: dict[str, Any] = {"order": self.order, "units": list(self.units), "memory": self.memory}
        structure |= {"operating_inputs": list(self.operating_inputs), "limits": list(self.limits)}
        structure |= {"delays": list(self.delays)}
        return {**structure, **super().document(), "quantities": self.list_quantities()}

    @classmethod
    def read_structure(cls, document: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of the structure of JSON values."""
        errors = [entry.get("standard_error") for entry in document.get("quantities", ())]
        limits = document.get("limits", ())
        return {
            "quantity_errors": None
            if errors == [None] * len(errors)
            else tuple(nan if each is None else float(each) for each in errors),
            "order": int(document["order"]),
            "units": tuple(map(str, document["units"])),
            "memory": int(document["memory"]),
            "operating_inputs": tuple(map(float, document["operating_inputs"])),
            "delays": tuple(map(int, document.get("delays", ()))),
            "limits": SensorLimits(*(None if each is None else float(each) for each in limits)),
            "wiring": tuple(str(entry["name"]) for entry in document["parameters"]),
        }


@lru_cache(maxsize=16)
def _make_block(model: LatentModel) -> Block:
    return model.make_block()


def find_direct(names: Iterable[str]) -> set[int]:
    """Return the places of the inputs that the output reads at sample k if these parameters are not zero."""
    names = tuple(names)
    units = {name[1:] for name in names if name[0] == "f"}
    direct = [name for name in names if name[0] == "d"]
    through = [name for name in names if name[0] == "v" and name[1:].split("_")[0] in units]
    numbers = [*(name[1:] for name in direct), *(name.partition("_")[2] for name in through)]
    return {int(number or 1) - 1 for number in numbers}


def reads_at_once(names: Iterable[str], delays: Sequence[int]) -> bool:
    """Return whether the output reads an input without a dead time if these parameters are not zero."""
    return any(not any(delays[place : place + 1]) for place in find_direct(names))


def _round(value: float) -> str:
    """Return a number for the text of an equation."""
    return f"{value:.{_DIGITS}g}"


def _name_factor(name: str, factor: str) -> str:
    """Return a factor times a parameter by name."""
    return f"{name}*{factor}" if factor else name

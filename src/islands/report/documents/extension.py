"""Extended simulation of a diagnosis: ``extended.json``, its equations, and limits that it contradicts."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from dataclasses import replace as change
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.inference.finding import Finding, Value
from islands.effects import catalogue
from islands.effects.baseline import INPUT_OFFSET
from islands.effects.catalogue import get_title
from islands.effects.interface.effect import Effect, ForceLaw, Formula, FormulaQuantity, Site
from islands.effects.time_variation import GAIN_EFFECTS
from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_formula
from islands.expressions.primitives import ADD, DIV, MUL, NEG, SUB
from islands.expressions.printing import SIMULATION, EquationMathmlPrinter, EquationTextPrinter
from islands.expressions.tree import (
    FMU,
    RATE,
    SIGNAL_FUNCTIONS,
    Apply,
    Constant,
    Expression,
    Symbol,
    name_function,
    replace,
    substitute,
    walk,
)
from islands.records.dataset import Dataset
from islands.records.signal_ranges import measure_ranges
from islands.rounding import RESOLUTION
from islands.sentences import write_one
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Simulator
from islands.simulators.intersample import ResampledSimulator
from islands.simulators.ode.effects import list_terms
from islands.simulators.ode.equation_parser import FORCE, TIME, is_free_name
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.ode.system import OdeSystem, sort_variables
from islands.simulators.ode.system_document import INPUT, SIMULATED
from islands.simulators.output_equation import OutputEquation
from islands.simulators.specification.description import make_effect_spec, make_extended_spec


def extended_json(fit: CalibrationResult, record: Dataset) -> str:
    """Return ``extended.json``: a simulator with its effects and the values of both."""
    return json.dumps(extended_document(fit, record), indent=2, allow_nan=False) + "\n"


def extended_document(fit: CalibrationResult, record: Dataset) -> dict[str, Any]:
    """Return a simulator with its effects and the values of both as a JSON document.

    Wrong parameters are corrected and missing terms of a model are added to it, so that they are no longer
    effects.
    """
    simulation, values = fit.simulation, fit.values.copy()
    names = [parameter.name for parameter in simulation.simulator.parameters]
    for effect in simulation.effects:
        if effect.site == Site.PARAMETER:
            index = names.index(effect.name.partition(":")[2])
            values[index] *= 1.0 + values[simulation.get_slice(effect)][0]
    parts = [(effect, _get_own_slice(simulation, effect)) for effect in simulation.effects]
    shape = {
        parameter.name: float(value)
        for effect, part in parts
        if effect.name == catalogue.CORE_SHAPE
        for parameter, value in zip(simulation.parameters[part], values[part], strict=True)
    }
    found = [
        make_effect_spec(effect, simulation.parameters[part], values[part])
        for effect, part in parts
        if effect.site != Site.PARAMETER and effect.name != catalogue.CORE_SHAPE
    ]
    signals = (record.input_names, record.output_name)
    spec = make_extended_spec(
        simulation.simulator, values[: len(names)], found, simulation.context, *signals, shape
    )
    tested = [asdict(each) for each in measure_ranges(record, fit.output)]
    return spec.model_dump(mode="json", by_alias=True) | {"tested": tested}


def _get_own_slice(simulation: ExtendedSimulator, effect: Effect) -> slice:
    """Return the slice of an effect without its last values, the initial states of further recordings."""
    part = simulation.get_slice(effect)
    return slice(part.start, part.stop - int(np.count_nonzero(simulation.is_copy[part])))


#: Name of the output in the last equation, and of the signals that effects of the output need before it.
_OUTPUT, _BEFORE = "output", "y"

#: Function of a formula that is its first argument at the time of the second one.
_AT = "at"

#: Signal or coordinate in a formula.
_X = Symbol("x")

#: Cell of a table of equations: its alignment and its content.
_CELL = '<mtd style="text-align: {}">{}</mtd>'

_TEXT, _MATHML = EquationTextPrinter(), EquationMathmlPrinter()


class WrittenLine(NamedTuple):
    """An equation, or a condition.

    Attributes
    ----------
    left : str
        Name on the left-hand side; empty for a condition.
    right : Expression
        Right-hand side, or the condition.
    is_derivative : bool
        Whether the left-hand side is the derivative of the name.
    """

    left: str
    right: Expression
    is_derivative: bool = False

    @property
    def text(self) -> str:
        """The equation as text."""
        right = _TEXT.write(self.right)
        if not self.left:
            return right
        return f"d{self.left}/dt = {right}" if self.is_derivative else f"{self.left} = {right}"

    @property
    def mathml(self) -> str:
        """The equation as a row of a table of MathML."""
        name, right = _MATHML.symbol(self.left), _MATHML.write(self.right)
        if self.is_derivative:
            name = f"<mfrac><mrow><mi>d</mi>{name}</mrow><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
        left = f"<mrow>{name}<mo>=</mo></mrow>" if self.left else ""
        return f"<mtr>{_CELL.format('right', left)}{_CELL.format('left', right)}</mtr>"


class WrittenValue(NamedTuple):
    """Value of an effect in the equations.

    Attributes
    ----------
    name : str
        Symbol in the equations.
    effect : str
        Name of the effect.
    estimate : Value
    """

    name: str
    effect: str
    estimate: Value


@dataclass(frozen=True, slots=True)
class WrittenExtension:
    """Equations of an extended simulation.

    Attributes
    ----------
    lines : tuple of WrittenLine
    values : tuple of WrittenValue
        Values of the effects; those of the simulation have their own names.
    notes : tuple of str
        Sentences on what the equations contain, without periods.
    """

    lines: tuple[WrittenLine, ...]
    values: tuple[WrittenValue, ...]
    notes: tuple[str, ...]

    @property
    def mathml(self) -> str:
        """The equations as a ``math`` element in ASCII."""
        rows = "".join(each.mathml for each in self.lines)
        return f'<math display="block"><mtable displaystyle="true">{rows}</mtable></math>'

    def as_document(self) -> dict[str, Any]:
        """Return the equations as a part of ``discrepancy.json``."""
        values = [{"name": each.name, "effect": each.effect, **asdict(each.estimate)} for each in self.values]
        return {
            "equations": [each.text for each in self.lines],
            "values": values,
            "notes": list(self.notes),
        }


def write_extended_equations(
    fit: CalibrationResult, findings: Sequence[Finding], record: Dataset
) -> WrittenExtension:
    """Write the equations of a calibrated simulation with its effects.

    A simulation without equations is the function ``G`` of its input.

    Parameters
    ----------
    fit : CalibrationResult
    findings : sequence of Finding
        Effects with the intervals of their values.
    record : Dataset
        Record whose names the notes explain the equations with.
    """
    return _EquationWriter(fit, findings, record).write()


@dataclass(slots=True)
class _PlacedFormula:
    """Formula of an effect, whose names are those of the equations.

    Attributes
    ----------
    effect : Effect
    names : mapping
        Name in the equations of each name in the formula.
    """

    effect: Effect
    formula: Formula
    names: Mapping[str, str]

    def parse(self, text: str) -> Expression:
        """Parse an expression of the formula."""

        def rename(part: Expression) -> Expression | None:
            match part:
                case Symbol(name) if name in self.names:
                    return Symbol(self.names[name])
                case Apply(function, arguments) if function.name in self.names:
                    own = tuple(replace(each, rename) for each in arguments)
                    return Apply(name_function(self.names[function.name]), own)
            return None

        return replace(parse_formula(text), rename)


@dataclass(slots=True)
class _EquationWriter:
    """Writer of the equations of one fit."""

    fit: CalibrationResult
    findings: Sequence[Finding]
    record: Dataset
    _input: str = INPUT
    _gain: str = ""
    _used: set[str] = field(default_factory=set)
    _values: list[WrittenValue] = field(default_factory=list)
    _notes: list[str] = field(default_factory=list)

    def write(self) -> WrittenExtension:
        simulation = self.fit.simulation
        simulator = _unwrap(simulation.simulator)
        system = simulator.system if isinstance(simulator, OdeSimulator | OutputEquation) else None
        self._used = {each.name for each in simulation.parameters[simulation.simulator_slice]}
        self._used |= {TIME, INPUT, SIMULATED, _OUTPUT, SIMULATION, FORCE}
        self._used |= set(system.find_names()) if system else set()
        placed = [self._place(each) for each in simulation.effects]
        if isinstance(simulator, OdeSimulator):
            self._input, self._gain = simulator.system.input, simulator.system.gain
            lines, output = self._write_system(simulator.system, placed)
        else:
            lines, output = self._write_core(simulator, placed)
        lines += self._write_output(output, [each for each in placed if each.effect.site == Site.OUTPUT])
        tidy = (each._replace(right=_tidy(each.right)) for each in lines)
        notes = dict.fromkeys((*self._name_signals(), *self._notes))
        return WrittenExtension(tuple(tidy), tuple(self._values), tuple(notes))

    def _name_signals(self) -> list[str]:
        """Return a note on the names of the record, if the equations have others."""
        named = ((self._input, self.record.input_names[0]), (_OUTPUT, self.record.output_name))
        listed = [f"{name} is {own}" for name, own in named if name != own]
        return [", ".join(listed)] if listed else []

    def _place(self, effect: Effect) -> _PlacedFormula:
        """Name the values, states and functions of an effect."""
        simulation = self.fit.simulation
        values, context = self.fit.values[simulation.get_slice(effect)], simulation.context
        formula = effect.formula or _describe_function(effect)
        quantities = formula.list_quantities(effect.parameters(context), values, context)
        own = [*(each.symbol for each in quantities), *formula.names, *(name for name, _ in formula.states)]
        names = {name: self._take_name(name) for name in own}
        self._values += [
            WrittenValue(names[each.symbol], effect.name, self._find_estimate(effect, each))
            for each in quantities
        ]
        return _PlacedFormula(effect, formula, names)

    def _find_estimate(self, effect: Effect, quantity: FormulaQuantity) -> Value:
        for each in self.findings:
            if (each.name, each.place) == (effect.cause, effect.place) and quantity.parameter:
                return each.parameters.get(quantity.parameter) or Value(quantity.value, quantity.unit, None)
        return Value(quantity.value, quantity.unit, None)

    def _take_name(self, name: str) -> str:
        """Return a name that nothing else has: the given one, or with a number."""
        base = name if is_free_name(name) else "".join(c if c.isalnum() else "_" for c in name)
        numbered = (f"{base}{number}" for number in count(2))
        found = base if base not in self._used else next(each for each in numbered if each not in self._used)
        self._used.add(found)
        return found

    def _note(self, placed: _PlacedFormula, x: Expression, v: Expression = _X) -> None:
        if placed.formula.note:
            signals = {"x": _TEXT.write(x), "v": _TEXT.write(v)}
            self._notes.append(placed.formula.note.format_map({**signals, **placed.names}))

    def _write_system(
        self, system: OdeSystem, placed: Sequence[_PlacedFormula]
    ) -> tuple[list[WrittenLine], Expression]:
        """Return the equations of a system and its output, with all effects but those of the output."""
        system, conditions = self._insert_into_states(system, placed)
        forces = [each for each in placed if each.effect.site == Site.FORCE]
        named = [*system.variables, *system.derivatives]
        sides = [*(right for _, right in named), system.output]
        states: list[WrittenLine] = []
        if system.force is not None and system.force.rate:
            laws, states = self._write_forces(
                forces, Symbol(system.force.coordinate), Symbol(system.force.rate)
            )
            sides, forces = [_insert_forces(side, laws) for side in sides], []
        u = Symbol(system.input)
        driving, before = self._write_input(u, placed, [*sides, *(u for _ in forces)])
        *sides, output = (substitute(side, {system.input: driving}) for side in sides)
        first = len(system.variables)
        lines = [
            WrittenLine(name, side, at >= first)
            for at, ((name, _), side) in enumerate(zip(named, sides, strict=True))
        ]
        output, further = self._add_forces(output, driving, forces)
        return [*before, *lines, *states, *further, *conditions], output

    def _insert_into_states(
        self, system: OdeSystem, placed: Sequence[_PlacedFormula]
    ) -> tuple[OdeSystem, list[WrittenLine]]:
        """Insert the effects on states, parameters and the gain; return the conditions on states as well."""
        listed = {each.name: each for each in list_terms(system) if each.term is not None}
        replaced: dict[str, Expression] = {}
        conditions: list[WrittenLine] = []
        for each in placed:
            effect = each.effect
            if effect.name in listed:
                system = system.with_effect(listed[effect.name])
                (name,) = each.names.values()
                replaced[effect.name] = Symbol(name)
            elif effect.site == Site.PARAMETER or (effect.name in GAIN_EFFECTS and system.gain):
                name = effect.place or system.gain
                before = replaced.get(name, Symbol(name))
                replaced[name] = substitute(each.parse(each.formula.text), {"x": before})
            state = Symbol(effect.place)
            conditions += [
                WrittenLine("", substitute(each.parse(text), {"x": state}))
                for text in each.formula.conditions
            ]
            if effect.site in (Site.CORE, Site.PARAMETER):
                self._note(each, state)

        def insert(equations: Iterable[tuple[str, Expression]]) -> tuple[tuple[str, Expression], ...]:
            return tuple((name, substitute(right, replaced)) for name, right in equations)

        variables, derivatives = insert(system.variables), insert(system.derivatives)
        output = substitute(system.output, replaced)
        return change(system, variables=variables, derivatives=derivatives, output=output), conditions

    def _write_core(
        self, simulator: Simulator, placed: Sequence[_PlacedFormula]
    ) -> tuple[list[WrittenLine], Expression]:
        """Return the equations around a simulation that has none, and its output."""
        inner = simulator
        terms: Expression = Symbol(SIMULATED)
        if isinstance(simulator, OutputEquation):
            inner, terms = simulator.simulator, simulator.system.output
        own = inner.equations
        self._notes.append(
            f"{SIMULATION} is the simulation {inner.name}" + (f": {own}" * (own != inner.name))
        )
        for each in placed:
            if each.effect.site == Site.PARAMETER:
                (name,) = each.names.values()
                self._notes.append(f"{each.effect.place} of {SIMULATION} is multiplied by (1 + {name})")
            if each.effect.site == Site.CORE:
                self._note(each, Symbol(INPUT))
        u, forces = Symbol(INPUT), [each for each in placed if each.effect.site == Site.FORCE]
        driving, lines = self._write_input(u, placed, [u, terms, *(u for _ in forces)])
        core, further = self._add_forces(Apply(name_function(SIMULATION), (driving,)), driving, forces)
        lines += further
        if terms == Symbol(SIMULATED):
            return lines, core
        return [*lines, WrittenLine(SIMULATED, core)], substitute(terms, {INPUT: driving})

    def _write_input(
        self, u: Symbol, placed: Sequence[_PlacedFormula], sides: Sequence[Expression]
    ) -> tuple[Expression, list[WrittenLine]]:
        """Return the input after its maps, and the lines that define it."""
        maps = [each for each in placed if each.effect.site == Site.INPUT]
        if not self._gain:
            maps += [each for each in placed if each.effect.name in GAIN_EFFECTS]
        driving, lines = self._apply_maps(u, maps, u.name)
        uses = sum(part == u for side in sides for part in walk(side))
        if uses > 1 and not self._is_signal(driving):
            name = self._take_name(u.name)
            return Symbol(name), [*lines, WrittenLine(name, driving)]
        return driving, lines

    def _write_output(self, output: Expression, maps: Sequence[_PlacedFormula]) -> list[WrittenLine]:
        output, lines = self._apply_maps(output, maps, _BEFORE)
        return [*lines, WrittenLine(_OUTPUT, output)]

    def _is_signal(self, expression: Expression) -> bool:
        """Return whether an expression is a name, or the input at another time, which may be repeated."""
        is_shifted = isinstance(expression, Apply) and expression.primitive.name == self._input
        return is_shifted or isinstance(expression, Symbol)

    def _apply_maps(
        self, signal: Expression, maps: Sequence[_PlacedFormula], name: str
    ) -> tuple[Expression, list[WrittenLine]]:
        """Return a signal after maps, and the lines that define signals which occur more than once."""
        lines = list[WrittenLine]()
        for each in maps:
            form = each.parse(each.formula.text)
            states = [(each.names[state], each.parse(right)) for state, right in each.formula.states]
            sides = (form, *(side for _, side in states))
            if sum(part == _X for side in sides for part in walk(side)) > 1 and not self._is_signal(signal):
                own = self._take_name(name)
                lines.append(WrittenLine(own, signal))
                signal = Symbol(own)
            self._note(each, signal)
            lines += [WrittenLine(state, _insert_signal(right, signal), True) for state, right in states]
            signal = _insert_signal(form, signal)
        return signal, lines

    def _write_forces(
        self, placed: Sequence[_PlacedFormula], x: Expression, v: Expression
    ) -> tuple[list[Expression], list[WrittenLine]]:
        """Return the forces on a coordinate, and the equations of their states."""
        laws, lines = list[Expression](), list[WrittenLine]()
        signals = {"x": x, "v": v}
        for each in placed:
            laws.append(substitute(each.parse(each.formula.text), signals))
            lines += [
                WrittenLine(each.names[state], substitute(each.parse(right), signals), True)
                for state, right in each.formula.states
            ]
            self._note(each, x, v)
        return laws, lines

    def _add_forces(
        self, output: Expression, driving: Expression, placed: Sequence[_PlacedFormula]
    ) -> tuple[Expression, list[WrittenLine]]:
        """Add forces on the input to an output, as a simulation without inertia does."""
        laws, lines = self._write_forces(placed, driving, Apply(RATE, (driving,)))
        is_against = self.fit.simulation.context.force_coordinate.sign < 0.0
        for each, law in zip(placed, laws, strict=True):
            assert isinstance(each.effect.form, ForceLaw)
            output = _chain(is_against and each.effect.form.is_dissipative, output, [law])
        return output, lines


def _describe_function(effect: Effect) -> Formula:
    """Return the formula of an effect that is only a function."""
    text = "f(x, v)" if effect.site == Site.FORCE else "f(x)"
    return Formula(text, names=("f",), note=f"{{f}} is the effect {effect.name}: {effect.summary}")


def _unwrap(simulator: Simulator) -> Simulator:
    return _unwrap(simulator.simulator) if isinstance(simulator, ResampledSimulator) else simulator


def _insert_signal(form: Expression, signal: Expression) -> Expression:
    """Insert a signal for ``x`` into a formula, and the time at which it is taken."""

    def find(part: Expression) -> Expression | None:
        match part, signal:
            case Symbol("x"), _:
                return signal
            case Apply(function, (Symbol("x"), time)), Symbol(name) if function.name == _AT:
                return Apply(name_function(name), (time,))
            case Apply(function, (Symbol("x"), time)), Apply(own, (inner,)) if function.name == _AT:
                return Apply(own, (substitute(inner, {TIME: time}),))
        return None

    return replace(form, find)


def _insert_forces(side: Expression, laws: Sequence[Expression]) -> Expression:
    """Insert forces into a right-hand side for ``force``, or remove it if there are none."""

    def find(part: Expression) -> Expression | None:
        match part:
            case Apply(function, (first, Symbol(name))) if name == FORCE and function in (ADD, SUB):
                return _chain(function.name == "sub", replace(first, find), laws)
            case Symbol(name) if name == FORCE:
                return _chain(False, laws[0], laws[1:]) if laws else Constant(0.0)
        return None

    return replace(side, find)


def _chain(is_subtracted: bool, first: Expression, others: Iterable[Expression]) -> Expression:
    """Return a sum or a difference of several expressions without brackets."""
    for each in others:
        for addend in _list_addends(each):
            first = Apply(SUB if is_subtracted else ADD, (first, addend))
    return first


def _list_addends(expression: Expression) -> list[Expression]:
    match expression:
        case Apply(function, arguments) if function == ADD:
            return [addend for each in arguments for addend in _list_addends(each)]
    return [expression]


def _tidy(expression: Expression) -> Expression:
    """Return an expression in which a negative addend is subtracted."""

    def find(part: Expression) -> Expression | None:
        match part:
            case Apply(function, (first, second)) if function == ADD:
                positive = _remove_sign(second)
                if positive is not None:
                    return Apply(SUB, (_tidy(first), _tidy(positive)))
        return None

    return replace(expression, find)


def _remove_sign(expression: Expression) -> Expression | None:
    """Return a product without the sign of its first factor; None if it has none."""
    match expression:
        case Apply(function, (operand,)) if function == NEG:
            return operand
        case Apply(function, (first, *others)) if function in (MUL, DIV):
            positive = _remove_sign(first)
            return None if positive is None else Apply(function, (positive, *others))
    return None


def list_contradictions(fit: CalibrationResult) -> tuple[str, ...]:
    """Return a sentence for each limit of a state that an extended simulation contradicts.

    An offset in the balance of a state with a lower limit, such as a level, may take something away where
    nothing is left. An effect of the output may show values beyond the limits of the state that is measured.
    """
    simulator = _unwrap(fit.simulation.simulator)
    if not isinstance(simulator, OdeSimulator):
        return ()
    return (*_check_offsets(fit, simulator.system), *_check_output(fit, simulator.system))


def _check_offsets(fit: CalibrationResult, system: OdeSystem) -> Iterator[str]:
    """Compare the balance at the lower limits without an input, where the simulation alone loses nothing."""
    states = {each.name: each for each in system.states}
    for effect in fit.simulation.effects:
        state = states.get(effect.place)
        if effect.cause != INPUT_OFFSET.name or state is None or not np.isfinite(state.lower):
            continue
        alone, extended = (_compute_balance(fit, system, effect, each) for each in (False, True))
        if alone is None or extended is None or not alone >= 0.0 > extended:
            continue
        quantities = {"title": get_title(effect.name), "input": system.input, "state": state}
        yield write_one("extension", "offset", loss=-extended, **quantities)


def _compute_balance(
    fit: CalibrationResult, system: OdeSystem, effect: Effect, is_extended: bool
) -> float | None:
    """Return the derivative of a state with all states at their lower limits, or at zero, and no input.

    None if it depends on the time, on a channel, or on what is not an expression.
    """
    simulation = fit.simulation
    part = simulation.simulator_slice
    values = {each.name: each.value for each in system.parameters}
    values |= {
        each.name: float(value)
        for each, value in zip(simulation.parameters[part], fit.values[part], strict=True)
    }
    values |= {each.name: each.lower if np.isfinite(each.lower) else 0.0 for each in system.states}
    values |= {system.input: 0.0, FORCE: 0.0}
    if is_extended:
        listed = {each.name: each for each in list_terms(system)}
        system = system.with_effect(listed[effect.name])
        values[effect.name] = float(fit.values[simulation.get_slice(effect)][0])
    variables = dict(system.variables)
    right = dict(system.derivatives)[effect.place]
    for name in reversed(sort_variables(system)):
        right = substitute(right, {name: variables[name]})
    if not _is_known(right, set(values)):
        return None
    return float(evaluate(right, values))


def _is_known(expression: Expression, names: set[str]) -> bool:
    """Return whether an expression has no other names than these, and no function of a whole signal."""
    for part in walk(expression):
        match part:
            case Symbol(name) if name not in names or name == TIME:
                return False
            case Apply(function, _) if function in (*SIGNAL_FUNCTIONS, FMU):
                return False
    return True


def _check_output(fit: CalibrationResult, system: OdeSystem) -> Iterator[str]:
    """Compare the extended output with the limits of the state that is measured."""
    states = {each.name: each for each in system.states}
    state = states.get(system.output.name) if isinstance(system.output, Symbol) else None
    if state is None or not any(each.site == Site.OUTPUT for each in fit.simulation.effects):
        return
    low, high = float(np.min(fit.output)), float(np.max(fit.output))
    rounding = RESOLUTION * (high - low)
    for limit, is_beyond, end in (
        (state.lower, low < state.lower - rounding, low),
        (state.upper, high > state.upper + rounding, high),
    ):
        if is_beyond:
            unit = fit.simulation.context.output_unit
            yield write_one("extension", "output", end=end, limit=limit, unit=unit, state=state)

"""Candidate terms of an equation: small expressions of states, input, the rate of the input, and time.

The output of an FMU, or of a simulation without equations, is one more signal, in terms that are added to
it.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from islands.diagnosis.discovery.term_unit import divide_units, find_expression_unit, find_factor_unit
from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_expression
from islands.expressions.primitives import ADD
from islands.expressions.printing import render
from islands.expressions.tree import FMU, Apply, Expression, Symbol, find_symbols, substitute
from islands.simulators.ode.equation_parser import FORCE, TIME
from islands.simulators.ode.system import OUTPUT, OdeParameter, OdeSystem

#: Functions of one signal ``a``.
UNARY = ("a", "a**2", "a**3", "a**5", "abs(a)", "abs(a)*a", "sign(a)", "max(a, 0)", "sqrt(abs(a))*sign(a)")

#: Functions of the rate ``a`` of the input.
RATE_FORMS = ("a", "abs(a)", "sign(a)", "abs(a)*a", "a**3")

#: Factors of products of two signals.
FACTORS = ("a", "a**2", "abs(a)", "sign(a)")

#: Factors of the rate in its products with the factors of the input, for damping and friction that depend on
#: the position where the input is the coordinate.
RATE_FACTORS = ("a", "abs(a)", "sign(a)")

#: Largest number of signals of which products are candidates: these grow with the cube of the number.
MAX_MULTIPLIED_SIGNALS = 8


class ScaledForm(NamedTuple):
    """Function of a signal with a scale that is fitted.

    Attributes
    ----------
    text : str
        Expression with ``{signal}`` and ``{scale}``.
    scale : float
        Nominal value of the scale, relative to the largest value of its argument.
    limit : str
        Expression without a scale that the function approaches if the scale is extreme.
    """

    text: str
    scale: float
    limit: str


#: A saturation, and two forms of the Stribeck curve (Armstrong-Helouvry, Dupont and Canudas de Wit, A survey
#: of models, analysis tools and compensation methods for the control of machines with friction, 1994).
SCALED_FORMS = (
    ScaledForm("tanh({signal}/{scale})", 0.3, "sign({signal})"),
    ScaledForm("sign({signal})*exp(-abs({signal}/{scale}))", 0.1, "sign({signal})"),
    ScaledForm("sign({signal})*exp(-({signal}/{scale})**2)", 0.1, "sign({signal})"),
)

#: A parameter that settles as the machine warms up or runs in: the argument of the scale is the time.
FADING_FORM = ScaledForm(f"{{signal}}*exp(-{TIME}/{{scale}})", 0.3, f"{TIME}*{{signal}}")

#: Radiation: the argument of the scale is a temperature, and the scale its distance from the absolute zero.
RADIATION_FORM = ScaledForm("({signal} + {scale})**4", 2.0, "{signal}**4")

#: Elastic stops of a position: on both sides, and on one of them. The argument of the scale is the position.
STOP_FORMS = (
    ScaledForm("sign({signal})*max(abs({signal}) - {scale}, 0)", 0.7, ""),
    ScaledForm("max({signal} - {scale}, 0)", 0.7, ""),
    ScaledForm("max(-{signal} - {scale}, 0)", 0.7, ""),
)

#: Further scales from which a fit starts, relative to the nominal one.
STARTING_SCALES = (0.3, 3.0)

#: Functions of one signal that may act in a part of the time only.
GATED_FORMS = ("a", "a**3", "abs(a)*a", "sign(a)")

#: Number of instants of a gate in time, and the part of the time at each end of the estimation part that has
#: none, since too few samples would show the change.
GATE_INSTANTS, _GATE_MARGIN = 8, 0.08

#: Duration of the change of a gate relative to that of the estimation part.
_GATE_CHANGE = 0.0005

#: Nominal value and bound of a coefficient, relative to that of a term as large as the rest of its equation.
NOMINAL, LIMIT = 1e-3, 1e4


@dataclass(frozen=True, slots=True)
class Gate:
    """Part of the time in which a term acts: from an instant on, or until then.

    Attributes
    ----------
    is_onset : bool
        Whether the term acts from the instant on.
    earliest, latest : float
        Bounds of the instant in seconds.
    change : float
        Duration of the change in seconds; it is not zero, so that the instant has a derivative.
    """

    is_onset: bool
    earliest: float
    latest: float
    change: float

    @property
    def spacing(self) -> float:
        """Distance between the instants from which a search starts, in seconds."""
        return (self.latest - self.earliest) / (GATE_INSTANTS - 1)

    def write(self, instant: str) -> str:
        """Write the factor of the term, 1 while it acts and otherwise 0, given the name of the instant."""
        return f"(1 {'+' if self.is_onset else '-'} tanh(({TIME} - {instant})/{self.change:.4g}))/2"

    def describe(self, instant: str) -> str:
        """State when the term acts."""
        return f"from {TIME} = {instant} on" if self.is_onset else f"until {TIME} = {instant}"


@dataclass(frozen=True, slots=True)
class CandidateTerm:
    """A term that may be missing, without its coefficient.

    Attributes
    ----------
    target : str
        State to whose derivative the term is added, or ``output``.
    text : str
        Expression, with ``{scale}`` for a scale that is fitted.
    size : float
        Typical largest value of the expression.
    scale : float or None
        Nominal scale; None if the expression has none.
    unit, scale_unit : str
        Units of the coefficient and of the scale; empty if they are not known.
    gate : Gate or None
        Part of the time in which the term acts, whose instant is the scale; None if it always acts.
    limit : str
        Expression of the term that it approaches if its scale is extreme; empty if it has none.
    """

    target: str
    text: str
    size: float
    scale: float | None = None
    unit: str = ""
    scale_unit: str = ""
    gate: Gate | None = None
    limit: str = ""

    @property
    def value_count(self) -> int:
        """Number of values that are fitted: the coefficient, and the scale if there is one."""
        return 1 if self.scale is None else 2

    @property
    def depends_on_time(self) -> bool:
        """Whether the term is a function of the time."""
        return self.gate is not None or TIME in find_symbols(parse_expression(self.text.format(scale="a")))

    @property
    def degrees_of_freedom(self) -> int:
        """Number of its values, and one more for an instant, which is selected among all samples."""
        return self.value_count + (self.gate is not None)

    def name_parameters(self, number: int) -> tuple[str, ...]:
        """Return the names of the coefficient, and of the scale if there is one, of a numbered term."""
        return (f"a{number}", f"s{number}")[: self.value_count]

    def write(self, number: int) -> str:
        """Return the term with its coefficient, as it is in its equation."""
        law = self._write_law(number)
        return law if self.gate is None else f"{law}*{self.gate.write(self.name_parameters(number)[1])}"

    def describe(self, number: int) -> str:
        """Return the term with its equation, and the part of the time in which it acts."""
        text = f"{self._write_law(number)} in {name_equation(self.target)}"
        return text if self.gate is None else f"{text}, {self.gate.describe(self.name_parameters(number)[1])}"

    def _write_law(self, number: int) -> str:
        coefficient, *scales = self.name_parameters(number)
        return f"{coefficient}*({self.text.format(scale=''.join(scales))})"

    def add_to(self, system: OdeSystem, number: int, target_size: float) -> OdeSystem:
        """Return a system with this term.

        Parameters
        ----------
        number : int
            Number of the term in the names of its parameters.
        target_size : float
            Largest absolute value of the right-hand side, for the bounds of the coefficient.
        """
        coefficient, *scales = self.name_parameters(number)
        size = target_size / self.size
        # The typical change of a parameter is relative to its nominal value, which is therefore not zero.
        parameters = [
            OdeParameter(coefficient, NOMINAL * size, self.unit, lower=-LIMIT * size, upper=LIMIT * size),
        ]
        bounds = (None, None) if self.gate is None else (self.gate.earliest, self.gate.latest)
        parameters += [
            OdeParameter(name, self.scale, self.scale_unit, None, *bounds)
            for name in scales
            if self.scale is not None
        ]
        return system.with_term(self.target, self.write(number), parameters)


def name_equation(target: str) -> str:
    """Return the left side of the equation of a state, or of the output."""
    return target if target == OUTPUT else f"d{target}/dt"


def list_gated_terms(candidates: Sequence[CandidateTerm], first: float, last: float) -> list[CandidateTerm]:
    """Return the simple terms of one signal that act from an instant on only, for several instants.

    Parameters
    ----------
    first, last : float
        Times at the ends of the estimation part in seconds.
    """
    margin, change = _GATE_MARGIN * (last - first), _GATE_CHANGE * (last - first)
    gate = Gate(True, first + margin, last - margin, change)
    return [
        replace(each, scale=instant, scale_unit="s", gate=gate)
        for each in candidates
        if each.scale is None and _is_gated(each.text)
        for instant in np.linspace(gate.earliest, gate.latest, GATE_INSTANTS).tolist()
    ]


def _is_gated(text: str) -> bool:
    """Return whether a term is a simple function of one signal or of its rate."""
    symbols = set(find_symbols(parse_expression(text)))
    if len(symbols) != 1 or TIME in symbols:
        return False
    (signal,) = symbols
    return text in {_insert(form, each) for form in GATED_FORMS for each in (signal, f"rate({signal})")}


def vary_gate(term: CandidateTerm, halvings: int) -> list[CandidateTerm]:
    """Return a term with a gate, the same until the instant, and both for an earlier and a later instant.

    Parameters
    ----------
    halvings : int
        Number of times that the distance between instants is halved.
    """
    assert term.gate is not None
    assert term.scale is not None
    gate = term.gate
    distance = gate.spacing / 2**halvings
    moved = (
        float(np.clip(term.scale + change, gate.earliest, gate.latest))
        for change in (0.0, -distance, distance)
    )
    gates = [gate, replace(gate, is_onset=not gate.is_onset)] if halvings == 1 else [gate]
    return [replace(term, scale=instant, gate=each) for instant in moved for each in gates]


def acts_on_output(term: CandidateTerm, name: str) -> bool:
    """Return whether a term adds a function of a signal, or of its rate, to the output."""
    return term.target == OUTPUT and name in find_symbols(parse_expression(term.text.format(scale=1.0)))


def shifts_in_time(term: CandidateTerm, system: OdeSystem) -> bool:
    """Return whether a term may be what a small delay adds: the rate of the input, or that of the output.

    For a small tau, ``u(t - tau)`` is ``u - tau*rate(u)``, and an output ``x(t - tau)`` is ``x - tau*dx/dt``.
    In equations with other terms, a delay may add functions of the rate of the input.
    """
    derivatives, is_shift = dict(system.derivatives), f"rate({system.input})" in term.text
    if term.target == OUTPUT and isinstance(system.output, Symbol) and system.output.name in derivatives:
        is_shift = is_shift or term.text == render(derivatives[system.output.name])
    return term.gate is None and is_shift


def find_free_numbers(used: Set[str], count: int) -> list[int]:
    """Return the smallest numbers of terms whose parameters have names that are not used."""
    free = (number for number in itertools.count(1) if not {f"a{number}", f"s{number}"} & used)
    return list(itertools.islice(free, count))


def list_candidate_terms(
    system: OdeSystem, sizes: Mapping[str, float], duration: float, units: Mapping[str, str]
) -> tuple[CandidateTerm, ...]:
    """Return the candidate terms of a system.

    Equations that only define a rate, such as ``dx/dt = v``, get no terms: they are definitions.

    Parameters
    ----------
    sizes : mapping
        Largest absolute values of the states, of their derivatives (``dx/dt``), of the input, and of its rate
        (``rate(u)``).
    duration : float
        Duration of the record in seconds.
    units : mapping
        Units of the states, of the input, and of the output (``output``); empty if they are not known.
    """
    states = [name for name, _ in system.derivatives]
    # Only the output can depend on the output of an FMU or of another simulation.
    outputs = [render(Apply(FMU, (Symbol(name),))) for name in system.of_fmu if name not in states]
    outputs += system.simulated
    rate = f"rate({system.input})"
    values, units = {**sizes, TIME: duration}, {**units, TIME: "s"}
    terms = []
    for target in (*system.balances, OUTPUT):
        own = system.output if target == OUTPUT else dict(system.derivatives)[target]
        unit = units.get(target, "") if target == OUTPUT else divide_units(units.get(target, ""), "s")
        signals = [*states, *(outputs if target == OUTPUT else ()), system.input]
        gains = {render(each) for each in _list_gains(target, own)}
        for text in dict.fromkeys(_list_texts(signals, rate)):
            expression = parse_expression(text)
            # Calibration absorbs gains, which a simulation without equations may have anywhere.
            is_gain = bool(system.simulated) and expression == Symbol(system.input)
            if is_gain or render(expression) in gains:
                continue
            size, own_unit = _compute_size(expression, values), find_factor_unit(unit, expression, units)
            terms.append(CandidateTerm(target, text, size, unit=own_unit))
        if system.force is not None and system.force.rate and FORCE in find_symbols(own):
            terms += _list_stops(target, system.force.coordinate, unit, sizes, units)
        if _is_process(target, system):
            terms += _list_process_terms(target, own, unit, sizes, units)
        for signal in signals:
            scale_unit = find_expression_unit(parse_expression(signal), units)
            own_unit = find_factor_unit(unit, parse_expression(signal), units)
            terms += [
                _make_scaled(target, form, signal, 1.0, sizes[signal], (unit, scale_unit))
                for form in SCALED_FORMS
            ]
            terms.append(_make_scaled(target, FADING_FORM, signal, sizes[signal], duration, (own_unit, "s")))
    return tuple(terms)


def _list_gains(target: str, own: Expression) -> list[Expression]:
    """Return the terms that are a gain of a right-hand side, or of a part of the output, as of ``x + D*u``.

    Calibration absorbs the gain of a state that the output shows.
    """
    match own:
        case Apply(primitive, (first, second)) if primitive == ADD and target == OUTPUT:
            return [own, *_list_gains(target, first), *_list_gains(target, second)]
    return [own]


def write_rate_size(own: Expression) -> str:
    """Write the size of a rate, given the right-hand side of its equation."""
    return f"abs({render(own)})"


def _is_process(target: str, system: OdeSystem) -> bool:
    """Return whether a state is a level, a temperature or the like.

    It is no rate of another state, as a velocity, and nothing that forces act on or that an FMU computes.
    """
    if target == OUTPUT or target in system.of_fmu:
        return False
    own = dict(system.derivatives)[target]
    is_rate = any(right == Symbol(target) for _, right in system.derivatives)
    return not is_rate and FORCE not in find_symbols(own)


def _list_process_terms(
    target: str, own: Expression, unit: str, sizes: Mapping[str, float], units: Mapping[str, str]
) -> list[CandidateTerm]:
    """Return the laws of a process with a right-hand side: another rate in one direction, and radiation."""
    power, largest = parse_expression(f"{target}**4"), sizes[target]
    scale = RADIATION_FORM.scale * largest
    return [
        CandidateTerm(target, write_rate_size(own), sizes[f"d{target}/dt"]),
        CandidateTerm(target, render(power), largest**4, unit=find_factor_unit(unit, power, units)),
        _make_scaled(
            *(target, RADIATION_FORM, target, (largest + scale) ** 4, largest),
            (find_factor_unit(unit, power, units), units.get(target, "")),
        ),
    ]


def _list_stops(
    target: str, position: str, unit: str, sizes: Mapping[str, float], units: Mapping[str, str]
) -> list[CandidateTerm]:
    """Return elastic stops of a position in the equation that forces act in."""
    largest, own_unit = sizes[position], find_factor_unit(unit, Symbol(position), units)
    return [
        _make_scaled(
            *(target, form, position, (1.0 - form.scale) * largest, largest),
            (own_unit, units.get(position, "")),
        )
        for form in STOP_FORMS
    ]


def _make_scaled(
    target: str, form: ScaledForm, signal: str, size: float, largest: float, units: tuple[str, str]
) -> CandidateTerm:
    """Return a term with a scale.

    Parameters
    ----------
    size, largest : float
        Largest values of the expression, and of the argument of the scale.
    units : tuple of str
        Units of the coefficient and of the scale.
    """
    text = form.text.format(signal=signal, scale="{scale}")
    limit = form.limit.format(signal=signal)
    return CandidateTerm(target, text, size, form.scale * largest, *units, limit=limit)


def _list_texts(signals: list[str], rate: str) -> Iterator[str]:
    for signal in signals:
        yield from (_insert(form, signal) for form in UNARY)
    yield from (_insert(form, rate) for form in RATE_FORMS)
    yield TIME
    for signal in signals:
        yield f"{TIME}*{signal}"
        yield f"{rate}*{signal}"
        yield f"abs({rate})*{signal}"
    for first, second in itertools.product(RATE_FACTORS, FACTORS):
        yield f"{_insert(first, rate)}*{_insert(second, signals[-1])}"
    if len(signals) > MAX_MULTIPLIED_SIGNALS:
        return
    for one, other in itertools.combinations(signals, 2):
        for first in FACTORS:
            for second in FACTORS:
                yield f"{_insert(first, one)}*{_insert(second, other)}"
    for three in itertools.combinations(signals, 3):
        yield "*".join(three)


def _insert(form: str, signal: str) -> str:
    """Write a form with a signal in place of ``a``."""
    return render(substitute(parse_expression(form), {"a": parse_expression(signal)}))


def _compute_size(expression: Expression, values: Mapping[str, float]) -> float:
    """Return the value of an expression at the largest values of its signals."""
    found = abs(float(evaluate(expression, {**dict.fromkeys(find_symbols(expression), 1.0), **values})))
    return found if np.isfinite(found) and found > 0.0 else 1.0

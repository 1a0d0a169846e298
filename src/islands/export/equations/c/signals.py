"""Signals between the samples in C: the input, its gain, channels, their rates and delays."""

import re
import textwrap
from collections.abc import Sequence

from islands.export.equations.extended_system import ExtendedEquations
from islands.export.equations.statements import EquationCode
from islands.expressions.printing import render
from islands.expressions.tree import RATE, Apply, Expression, Symbol
from islands.simulators.intersample import REACH, design_low_pass
from islands.simulators.ode.equation_parser import TIME

_INTERPOLATE = """\
/* Return a signal that is linear between its samples, a part of a step after the start of the step. */
static double interpolate(const double *x, size_t samples, size_t step, double part)
{
    const size_t k = step/STEPS, next = k + 1 < samples ? k + 1 : k;
    return x[k] + ((double)(step % STEPS) + part)/STEPS*(x[next] - x[k]);
}

"""

_HOLD = """\
/* Return a signal that is constant between its samples. */
static double hold(const double *x, size_t step)
{
    return x[step/STEPS];
}

"""

_BAND_LIMITED = """\
enum {{ REACH = {reach}, PHASES = {phases} }}; /* samples on each side, values per sample */

/* Return a value of the band-limited interpolation; both ends are extended by reflection. */
static double filter(const double *x, size_t samples, size_t value)
{{
    static const double weights[2*REACH + 1][PHASES] = {{
{weights}}};
    const long k = (long)(value/PHASES), last = (long)samples - 1;
    double sum = 0.0;
    for (long near = -REACH; near <= REACH; ++near) {{
        const long at = k + near;
        const double here = at < 0 ? 2.0*x[0] - x[-at] : at > last ? 2.0*x[last] - x[2*last - at] : x[at];
        sum += weights[near + REACH][value % PHASES]*here;
    }}
    return sum;
}}

/* Return a signal between samples: the parabola through three values of the filter. */
static double limit_band(const double *x, size_t samples, size_t step, double part)
{{
    const size_t value = 2*(step/PART_STEPS);
    const double start = filter(x, samples, value), f = ((double)(step % PART_STEPS) + part)/PART_STEPS;
    const double rise = filter(x, samples, value + 1) - start;
    const double second = filter(x, samples, value + 2) - filter(x, samples, value + 1);
    return start + f*(3.0*rise - second + f*2.0*(second - rise));
}}

"""

_READER = """\
static double read_{name}(const struct parameters *p, const struct record *r, size_t step, double part)
{{
    {lines}
}}

"""

_GAIN = """\
/* Return the factor of the gain at the start of a part of a sample. */
static double read_gain(const struct parameters *p, size_t part)
{{
    const double t = (double)part*PART_STEPS*STEP;
    return {gain};
}}

"""

_GAIN_BETWEEN = """\
/* Return the factor of the gain, which is linear within each part of a sample. */
static double interpolate_gain(const struct parameters *p, const struct record *r, size_t step, double part)
{
    const size_t j = step/PART_STEPS, next = (j + 1)*PART_STEPS < r->samples*STEPS ? j + 1 : j;
    const double f = ((double)(step % PART_STEPS) + part)/PART_STEPS;
    return read_gain(p, j) + f*(read_gain(p, next) - read_gain(p, j));
}

"""

_SIGNAL = """\
/* The signal {name} of the equations. */
static double signal_{name}(const struct parameters *p, const struct record *r, size_t step, double part)
{{
    {unused}return {value};
}}

"""

_POINTER = """\
typedef double (*read_signal)(const struct parameters *p, const struct record *r, size_t step, double part);

"""

_RATE = """\
/* Return the rate of a signal: the derivative of the parabola through the values of a step. */
static double find_rate(
    read_signal read, const struct parameters *p, const struct record *r, size_t step, double part)
{
    const double middle = read(p, r, step, 0.5);
    const double rise = middle - read(p, r, step, 0.0), second = read(p, r, step, 1.0) - middle;
    return (3.0*rise - second + 4.0*part*(second - rise))/STEP;
}

"""

_HELD_RATE = """\
/* Return the rate of a signal that is held: that of a ramp to the next value within the step. */
static double find_held_rate(
    read_signal read, const struct parameters *p, const struct record *r, size_t step)
{
    return step + 1 < r->samples*STEPS ? (read(p, r, step + 1, 0.0) - read(p, r, step, 0.0))/STEP : 0.0;
}

"""

_CENTRAL_RATE = """\
/* Return the rate of a signal at a sample, by central differences. */
static double find_central_rate(
    read_signal read, const struct parameters *p, const struct record *r, size_t step)
{
    const size_t before = step > 0 ? step - 1 : 0, after = step + 1 < r->samples ? step + 1 : step;
    const double change = read(p, r, after, 0.0) - read(p, r, before, 0.0);
    return after > before ? change/((double)(after - before)*DT) : 0.0;
}

"""

_DELAY = """\
/* Return a signal delayed by linear interpolation between half steps; before its start it is constant. */
static double delay(
    read_signal read, const struct parameters *p, const struct record *r, size_t step, double part,
    double tau)
{
    const size_t last = 2*r->samples*STEPS;
    const double at = fmin(fmax(2.0*((double)step + part - fmax(tau, 0.0)/STEP), 0.0), (double)last);
    const size_t lower = at < (double)last ? (size_t)at : last - 1, upper = lower + 1;
    const double first = read(p, r, lower/2, 0.5*(double)(lower % 2));
    const double second = upper < last ? read(p, r, upper/2, 0.5*(double)(upper % 2))
                                       : read(p, r, upper/2 - 1, 1.0);
    return first + (at - (double)lower)*(second - first);
}

"""

_HELD_DELAY = """\
/* Return a held signal delayed by linear interpolation between steps, constant within each step. */
static double delay_held(
    read_signal read, const struct parameters *p, const struct record *r, size_t step, double tau)
{
    const double at = fmax((double)step - fmax(tau, 0.0)/STEP, 0.0);
    const size_t lower = (size_t)at, upper = lower + 1 < r->samples*STEPS ? lower + 1 : lower;
    const double first = read(p, r, lower, 0.0);
    return first + (at - (double)lower)*(read(p, r, upper, 0.0) - first);
}

"""

_SIGNALS = """\
/* Return the signals, a part of a step after its start. */
static struct signals read_signals(
    const struct parameters *p, const struct record *r, size_t step, double part)
{{
    struct signals in = {{0}};
    {lines}
    return in;
}}

"""


#: Functions by what calls them; those behind the first three take a function that reads a signal.
_SHARED = (("interpolate(", _INTERPOLATE), ("hold(", _HOLD))
_POINTED = (
    ("find_rate(", _RATE),
    ("find_held_rate(", _HELD_RATE),
    ("find_central_rate(", _CENTRAL_RATE),
    ("delay(", _DELAY),
    ("delay_held(", _HELD_DELAY),
)


def write_signals(given: ExtendedEquations, code: EquationCode) -> str:
    """Return the functions that read the signals of the equations, and those that they call."""
    names = code.identifiers
    lines = [f"in.{names[render(each)]} = {_write_value(each, given, code)};" for each in code.read_signals]
    unused = find_unused(lines, "p", "r", "step", "part")
    signals = _SIGNALS.format(lines="\n    ".join([*unused, *lines]))
    pointed = "".join(section for name, section in _POINTED if f" {name}" in signals)
    sources = {each.arguments[0] for each in code.signals if isinstance(each, Apply)}
    read = [name for name in given.columns if Symbol(name) in {*code.signals, *sources}]
    if given.forces and given.system.input not in read:
        read.insert(0, given.system.input)
    readers = "".join(_write_reader(name, given, code) for name in read)
    shared = "".join(section for name, section in _SHARED if name in readers)
    if "limit_band(" in readers:
        shared += _write_band_limit(given.times)
    gain = "" if given.gain is None else _GAIN.format(gain=code.write(given.gain, {TIME: "t"}))
    if given.gain_signal:
        gain += _GAIN_BETWEEN
    wrapped = "".join(_write_signal(each, given, code) for each in sorted(sources, key=str))
    return shared + readers + gain + (_POINTER + pointed + wrapped if pointed else "") + signals


def find_unused(lines: Sequence[str], *names: str) -> list[str]:
    """Return statements for arguments that other statements do not read: compilers warn about them."""
    text = "\n".join(lines)
    return [f"(void){name};" for name in names if not re.search(rf"\b{name}\b", text)]


def _write_reader(name: str, given: ExtendedEquations, code: EquationCode) -> str:
    column = f"r->{code.identifiers[name]}"
    value = f"interpolate({column}, r->samples, step, part)"
    if name == given.system.input and given.hold == "zero-order":
        value = f"hold({column}, step)"
    elif name == given.system.input and given.hold == "band-limited":
        value = f"limit_band({column}, r->samples, step, part)"
    lines = [f"return {value};"]
    if name == given.system.input and given.characteristic is not None:
        mapped = code.assign([("const double mapped", given.characteristic)], {"x": "x"})
        lines = [f"const double x = {value};", *mapped, "return mapped;"]
    lines = [*find_unused(lines, "p", "part"), *lines]
    return _READER.format(name=code.identifiers[name], lines="\n    ".join(lines))


def _write_signal(source: Expression, given: ExtendedEquations, code: EquationCode) -> str:
    assert isinstance(source, Symbol)
    value = _write_value(source, given, code)
    unused = "".join(f"{each}\n    " for each in find_unused([value], "p"))
    return _SIGNAL.format(name=code.identifiers[source.name], unused=unused, value=value)


def _write_value(signal: Expression, given: ExtendedEquations, code: EquationCode) -> str:
    """Write the value of a signal at the part ``part`` of the step ``step``."""
    match signal:
        case Symbol(name) if name == TIME:
            return "((double)step + part)*STEP"
        case Symbol(name) if name == given.gain_signal:
            return "interpolate_gain(p, r, step, part)"
        case Symbol(name):
            value = f"read_{code.identifiers[name]}(p, r, step, part)"
            is_multiplied = name == given.system.input and given.gain is not None and not given.gain_signal
            return f"read_gain(p, step/PART_STEPS)*{value}" if is_multiplied else value
        case Apply(function, (Symbol(name), *others)):
            is_held = name == given.system.input and given.hold == "zero-order"
            arguments = f"signal_{code.identifiers[name]}, p, r, step"
            if function == RATE and given.core is not None:
                return f"find_central_rate({arguments})"
            if function == RATE:
                return f"find_held_rate({arguments})" if is_held else f"find_rate({arguments}, part)"
            tau = code.write(others[0])
            return f"delay_held({arguments}, {tau})" if is_held else f"delay({arguments}, part, {tau})"
    raise AssertionError(signal)


def _write_band_limit(times: int) -> str:
    weights = design_low_pass(2 * times)
    rows = "".join(f"        {{{', '.join(map(repr, row))}}},\n" for row in weights.tolist())
    lines = "\n".join(
        line
        for row in rows.splitlines()
        for line in textwrap.wrap(row.strip(), 108, initial_indent=" " * 8, subsequent_indent=" " * 9)
    )
    return _BAND_LIMITED.format(reach=REACH, phases=2 * times, weights=f"{lines}\n    ")

"""Signals between the samples in MATLAB: the input, its gain, channels, their rates and delays."""

from islands.export.equations.extended_system import ExtendedEquations
from islands.export.equations.statements import EquationCode
from islands.expressions.printing import render
from islands.expressions.tree import RATE, Apply, Expression, Symbol
from islands.simulators.intersample import REACH, design_low_pass
from islands.simulators.ode.equation_parser import TIME

_INTERPOLATE = """\
function value = interpolate(x, step, part, c)
% Signal that is linear between its samples, a part of a step after the start of the step.
  k = floor(step/c.steps) + 1;
  value = x(k) + (mod(step, c.steps) + part)/c.steps*(x(min(k + 1, numel(x))) - x(k));
end

"""

_HOLD = """\
function value = hold_sample(x, step, c)
% Signal that is constant between its samples.
  value = x(floor(step/c.steps) + 1);
end

"""

_BAND_LIMITED = """\
function value = filter_at(x, number)
% Value of the band-limited interpolation; both ends are extended by reflection.
  persistent weights
  if isempty(weights)
    weights = [ ...
{weights}];
  end
  last = numel(x);
  at = floor(number/{phases}) + 1 + (-{reach}:{reach});
  near = x(min(max(at, 1), last));
  low = at < 1;
  near(low) = 2*x(1) - x(2 - at(low));
  high = at > last;
  near(high) = 2*x(last) - x(2*last - at(high));
  value = near(:).'*weights(:, mod(number, {phases}) + 1);
end

function value = limit_band(x, step, part, c)
% Signal between samples: the parabola through three values of the filter.
  number = 2*floor(step/c.part_steps);
  start = filter_at(x, number);
  middle = filter_at(x, number + 1);
  rise = middle - start;
  second = filter_at(x, number + 2) - middle;
  f = (mod(step, c.part_steps) + part)/c.part_steps;
  value = start + f*(3*rise - second + f*2*(second - rise));
end

"""

_READER = """\
function value = read_{name}(p, r, step, part, c)
  {lines}
end

"""

_GAIN = """\
function gain = read_gain(p, part, c)
% Factor of the gain at the start of a part of a sample.
  t = part*c.part_steps*c.step;
  gain = {gain};
end

"""

_GAIN_BETWEEN = """\
function gain = interpolate_gain(p, r, step, part, c)
% Factor of the gain, which is linear within each part of a sample.
  j = floor(step/c.part_steps);
  next = min(j + 1, r.samples*c.steps/c.part_steps - 1);
  f = (mod(step, c.part_steps) + part)/c.part_steps;
  gain = read_gain(p, j, c) + f*(read_gain(p, next, c) - read_gain(p, j, c));
end

"""

_RATE = """\
function rate = find_rate(read, step, part, c)
% Rate of a signal: the derivative of the parabola through the values of a step.
  middle = read(step, 0.5);
  rise = middle - read(step, 0);
  second = read(step, 1) - middle;
  rate = (3*rise - second + 4*part*(second - rise))/c.step;
end

"""

_HELD_RATE = """\
function rate = find_held_rate(read, r, step, c)
% Rate of a signal that is held: that of a ramp to the next value within the step.
  rate = (read(min(step + 1, r.samples*c.steps - 1), 0) - read(step, 0))/c.step;
end

"""

_CENTRAL_RATE = """\
function rate = find_central_rate(read, r, step, c)
% Rate of a signal at a sample, by central differences.
  before = max(step - 1, 0);
  after = min(step + 1, r.samples - 1);
  rate = (read(after, 0) - read(before, 0))/(max(after - before, 1)*c.dt);
end

"""

_DELAY = """\
function value = delay(read, r, step, part, tau, c)
% Signal delayed by linear interpolation between half steps; before its start it is constant.
  last = 2*r.samples*c.steps;
  at = min(max(2*(step + part - max(tau, 0)/c.step), 0), last);
  lower = min(floor(at), last - 1);
  upper = lower + 1;
  first = read(floor(lower/2), 0.5*mod(lower, 2));
  if upper < last
    second = read(floor(upper/2), 0.5*mod(upper, 2));
  else
    second = read(floor(upper/2) - 1, 1);
  end
  value = first + (at - lower)*(second - first);
end

"""

_HELD_DELAY = """\
function value = delay_held(read, r, step, tau, c)
% Held signal delayed by linear interpolation between steps, constant within each step.
  at = max(step - max(tau, 0)/c.step, 0);
  lower = floor(at);
  first = read(lower, 0);
  value = first + (at - lower)*(read(min(lower + 1, r.samples*c.steps - 1), 0) - first);
end

"""

_SIGNALS = """\
function in = read_signals(p, r, step, part, c)
% Signals, a part of a step after its start.
  in = struct();
  {lines}
end

"""

_FUNCTIONS = (
    ("interpolate(", _INTERPOLATE),
    ("hold_sample(", _HOLD),
    ("find_rate(", _RATE),
    ("find_held_rate(", _HELD_RATE),
    ("find_central_rate(", _CENTRAL_RATE),
    ("delay(", _DELAY),
    ("delay_held(", _HELD_DELAY),
    ("interpolate_gain(", _GAIN_BETWEEN),
)


def write_matlab_signals(given: ExtendedEquations, code: EquationCode) -> str:
    """Return the functions that read the signals of the equations, and those that they call."""
    names = code.identifiers
    lines = [f"in.{names[render(each)]} = {_write_value(each, given, code)};" for each in code.read_signals]
    signals = _SIGNALS.format(lines="\n  ".join(lines))
    readers = "".join(
        _write_reader(name, given, code)
        for name in given.columns
        if not given.core or name not in given.core.columns
    )
    called = signals + readers
    shared = "".join(section for name, section in _FUNCTIONS if f" {name}" in called)
    if " limit_band(" in readers:
        shared += _write_band_limit(given.times)
    gain = "" if given.gain is None else _GAIN.format(gain=code.write(given.gain, {TIME: "t"}))
    return signals + readers + gain + shared


def _write_reader(name: str, given: ExtendedEquations, code: EquationCode) -> str:
    column = f"r.{code.identifiers[name]}"
    value = f"interpolate({column}, step, part, c)"
    if name == given.system.input and given.hold == "zero-order":
        value = f"hold_sample({column}, step, c)"
    elif name == given.system.input and given.hold == "band-limited":
        value = f"limit_band({column}, step, part, c)"
    lines = [f"value = {value};"]
    if name == given.system.input and given.characteristic is not None:
        lines = [f"x = {value};", *code.assign([("value", given.characteristic)], {"x": "x"})]
    return _READER.format(name=code.identifiers[name], lines="\n  ".join(lines))


def _write_value(signal: Expression, given: ExtendedEquations, code: EquationCode) -> str:
    """Write the value of a signal at the part ``part`` of the step ``step``."""
    match signal:
        case Symbol(name) if name == TIME:
            return "(step + part)*c.step"
        case Symbol(name) if name == given.gain_signal:
            return "interpolate_gain(p, r, step, part, c)"
        case Symbol(name):
            value = f"read_{code.identifiers[name]}(p, r, step, part, c)"
            is_multiplied = name == given.system.input and given.gain is not None and not given.gain_signal
            return f"read_gain(p, floor(step/c.part_steps), c)*{value}" if is_multiplied else value
        case Apply(function, (Symbol(name) as source, *others)):
            read = f"@(step, part) {_write_value(source, given, code)}"
            is_held = name == given.system.input and given.hold == "zero-order"
            if function == RATE and given.core is not None:
                return f"find_central_rate({read}, r, step, c)"
            if function == RATE:
                return (
                    f"find_held_rate({read}, r, step, c)" if is_held else f"find_rate({read}, step, part, c)"
                )
            tau = code.write(others[0])
            if is_held:
                return f"delay_held({read}, r, step, {tau}, c)"
            return f"delay({read}, r, step, part, {tau}, c)"
    raise AssertionError(signal)


def _write_band_limit(times: int) -> str:
    rows = [", ".join(map(repr, row)) for row in design_low_pass(2 * times).tolist()]
    weights = "".join(
        f"      {part}, ...\n" if place + 4 < len(values) else f"      {part}; ...\n"
        for values in (row.split(", ") for row in rows)
        for place in range(0, len(values), 4)
        for part in (", ".join(values[place : place + 4]),)
    )
    return _BAND_LIMITED.format(reach=REACH, phases=2 * times, weights=f"{weights}    ")

"""MATLAB and Octave: their syntax, the operators of maps, and the program of an extended simulation."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from islands.export.equations.extended_system import ExtendedEquations
from islands.export.equations.language import Language
from islands.export.equations.program import EquationProgram, map_function
from islands.export.languages.matlab import matlab_definition
from islands.expressions.tree import Symbol
from islands.records.segments import MAX_RANGE_AT_REST

#: Definition of each operator that is a function.
MATLAB_OPERATORS: Mapping[str, str] = MappingProxyType(
    {
        "low-pass": """\
function z = low_pass(x, tau, c)
% First-order low-pass with a time constant; exact for a cubic through four neighbouring samples.
  z = x;
  if ~(tau > 0), return; end
  lagrange = [0 -1/3 1/2 -1/6; 1 -1/2 -1 1/2; 0 1 1/2 -1/2; 0 -1/6 0 1/6];
  step = c.dt/tau;
  moments = zeros(4, 1);
  for n = 0:3
    if step < 1 % series of the integrals of step*exp(-step*(1 - s))*s^n over s from 0 to 1
      m = 0:19;
      moments(n + 1) = step*exp(-step)*sum(step.^m./(factorial(m).*(n + m + 1)));
    elseif n == 0
      moments(1) = 1 - exp(-step);
    else
      moments(n + 1) = 1 - n/step*moments(n);
    end
  end
  weights = lagrange*moments;
  last = numel(x);
  state = 0;
  for k = 1:last
    near = x([max(k - 1, 1), k, min(k + 1, last), min(k + 2, last)]) - x(1);
    z(k) = x(1) + state;
    state = exp(-step)*state + near(:).'*weights;
  end
end
""",
        "resonance": """\
function z = resonance(x, period, zeta, c)
% Second-order mode in series, by the bilinear transform, prewarped at its frequency.
  z = x;
  if ~(period > 0) || 2*pi/period*c.dt > 2.6, return; end % faster than the record can show
  w = 2*pi/period;
  q = w/tan(w*c.dt/2);
  scale = q*q + 2*zeta*w*q + w*w;
  b = w*w/scale;
  z = x(1) + filter([b, 2*b, b], [1, 2*(w*w - q*q)/scale, (q*q - 2*zeta*w*q + w*w)/scale], x - x(1));
end
""",
        "play": """\
function z = play(x, width)
% Play with a half width.
  z = x;
  if ~(width > 0), return; end
  for k = 2:numel(x)
    z(k) = min(max(z(k-1), x(k) - width), x(k) + width);
  end
end
""",
        "slider": """\
function z = slider(x, breakaway, c)
% Stick-slip slider: z is constant until x, held or continuous, differs from it by the breakaway, and then
% jumps to x.
  z = x;
  if ~(breakaway > 0), return; end
  held = 2*sum(abs(diff(x)) <= c.max_range_at_rest*max(abs(x))) > numel(x) - 1;
  for k = 2:numel(x)
    if ~held
      z(k) = z(k-1) + breakaway*fix((x(k) - z(k-1))/breakaway);
    elseif abs(x(k) - z(k-1)) <= breakaway
      z(k) = z(k-1);
    end
  end
end
""",
        "limit-rate": """\
function z = limit_rate(x, inverse_rate, values, c)
% Rate limiter: z follows x, which is linear between its values, by at most a rate per second. There is one
% value for each sample, or three for each step: at its start, in its middle and at its end.
  z = x;
  if ~(inverse_rate > 0), return; end
  steps = c.dt/inverse_rate;
  if values == 3, steps = [0, c.step/2, c.step/2]/inverse_rate; end
  for k = 2:numel(x)
    step = steps(mod(k - 1, values) + 1);
    change = x(k) - x(k-1);
    gap = x(k-1) - z(k-1);
    met = double(gap ~= 0);
    closing = sign(gap)*step - change;
    if gap*closing > 0, met = gap/closing; end
    if met >= 1
      z(k) = z(k-1) + sign(gap)*step;
    elseif abs(change) > step
      z(k) = x(k-1) + change*met + sign(change)*step*(1 - met);
    end
  end
end
""",
        "lag-unevenly": """\
function z = lag_unevenly(x, slow, falling_fast, falling, rising, rising_fast, c)
% First-order lag of x, which is linear between samples. Its time constants are those of falling fast, falling
% slowly, rising slowly and rising fast: z' is above a rate per second, or below.
  times = max([falling, falling_fast; rising, rising_fast], 1e-9*c.dt);
  z = x;
  gap = 0;
  for k = 2:numel(x)
    slope = (x(k) - x(k-1))/c.dt;
    left = c.dt*(gap ~= 0 || slope ~= 0);
    while left > 0
      side = sign(gap + (gap == 0)*slope);
      tau = times(1 + (side > 0), :);
      distance = side*gap;
      rise = side*slope;
      edge = slow*tau(1);
      fast = distance > edge || (distance == edge && rise > slow);
      lower = fast*edge;
      last = lower + tau(1 + fast)*(rise - fast*slow);
      change = -1;
      if last < lower
        change = lower;
      elseif ~fast && last > edge
        change = edge;
      end
      passed = left;
      if change >= 0, passed = tau(1 + fast)*log((distance - last)/(change - last)); end
      if passed < left
        gap = side*change;
      else
        gap = side*(last + (distance - last)*exp(-left/tau(1 + fast)));
      end
      left = left - passed;
    end
    z(k) = x(k) - gap;
  end
end
""",
        "lag-by-gap": """\
function z = lag_by_gap(x, tau, inverse_rate, c)
% Lag of x, a cubic through four neighbouring samples, that grows with the gap:
% z' = gap/(tau + inverse_rate*abs(gap)).
  z = x;
  if ~(tau > 0), return; end
  tau = max(tau, 1e-9*c.dt);
  ratio = c.dt/8/tau;
  part = -1/expm1(-ratio) - 1/ratio;
  gap = 0;
  for k = 2:numel(x)
    before = x(max(k - 2, 1));
    after = x(min(k + 1, numel(x)));
    at = x(k-1);
    for s = (1:8)/8
      next = s*(s - 1)*((s + 1)*after - (s - 2)*before)/6 ...
        + (s + 1)*(s - 2)*((s - 1)*x(k-1) - s*x(k))/2;
      ahead = gap + part*(next - at);
      half = 0.5*(tau + part*c.dt/8 - inverse_rate*abs(ahead));
      root = sqrt(half*half + inverse_rate*abs(ahead)*tau);
      if half > 0
        middle = abs(ahead)*tau/(half + root);
      else
        middle = (root - half)/inverse_rate;
      end
      gap = gap + (sign(ahead)*middle - gap)/part;
      at = next;
    end
    z(k) = x(k) - gap;
  end
end
""",
        "interpolate": """\
function z = interpolate_at(x, e, tau, cosine, sine, f, c)
% Signal at the time t*(1 + e) - tau - cosine*cos(2*pi*f*t) - sine*sin(2*pi*f*t), by Lagrange's polynomial
% through six samples; its ends are held.
  last = numel(x) - 1;
  angle = 2*pi*f*c.dt*(0:last).';
  at = min(max((0:last).'*(1 + e) - (tau + cosine*cos(angle) + sine*sin(angle))/c.dt, 0), last);
  first = min(floor(at), max(last - 1, 0));
  z = zeros(size(x));
  for here = -2:3
    weight = x(min(max(first + here, 0), last) + 1);
    for other = [-2:here-1, here+1:3]
      weight = weight.*(at - first - other)/(here - other);
    end
    z = z + weight;
  end
end
""",
        "rests": """\
function yes = rests(x, c)
% Whether a signal is constant over the estimation part of the record that was diagnosed.
  x = x(1:min(c.fitted, numel(x)));
  yes = double(max(x) - min(x) <= c.max_range_at_rest*max(abs(x)));
end
""",
    }
)

#: Functions that are complex outside the domain of real numbers.
REAL = {"sqrt": "root", "log": "logarithm", "pow": "raise"}

MATLAB = Language(
    indent=2,
    continuation=" ...",
    member=".",
    declare="",
    variable="",
    alias="",
    define=matlab_definition,
    zero="0",
    functions=REAL,
    power="raise({}, {})",
    add="{0} = {0} + {1};",
    condition="if {}, {} end",
    first=1,
    at="{}({})",
    past="{}(k-{})",
    delayed="max(k - {}, 1)",
    loop="for k = {}:r.samples",
    end="end",
    context=("c",),
    step="c.step",
    time="(step + part)*c.step",
    sample_time="(k - 1)*c.dt",
    part="floor(step/c.part_steps)",
    give="value = {};",
    finish="",
    clear="slope.{} = 0;",
    value="value",
    rests="rests(x, c)",
    output=("y = zeros(r.samples, 1);",),
    simulate_core="y = simulate_core(p, initial, r);",
    add_forces="if r.samples > 1, y = add_forces(p, initial, r, y, c); end",
    program="""\
function y = extended_simulation({columns}, initial, p)
% EXTENDED_SIMULATION  Output of an extended simulation from the columns of a record.
%
{heading}
%
% Arguments are vectors of equal length; y has the size of the first one. The states at the first sample and
% the parameters are those of the diagnosis unless they are given:
%
%   initial = extended_simulation('initial');  p = extended_simulation('parameters');
%
% Save this file as extended_simulation.m; it runs in MATLAB and Octave.

  if ischar({first})
    if strcmp({first}, 'initial'), y = initial_states(); else, y = parameters(); end
    return
  end
  if nargin < {count}, initial = initial_states(); end
  if nargin < {last}, p = parameters(); end
  c = constants();
  shape = size({first});
  {record}
  r.samples = numel({first});
  {before}s = initial;
  {loop}
  {after}y = reshape(y, shape);
end

function c = constants()
% Sampling time and integration step in s, steps per sample and of each part of a sample.
  c.dt = {dt};
  c.steps = {steps};
  c.part_steps = {part_steps};
  c.step = {step};
  c.fitted = {fitted};
  c.max_range_at_rest = {rest};
end

function p = parameters()
% Parameters of the equations and of the effects.
  p = struct();
  {parameters}
end

function s = initial_states()
% States at the first sample.
  s = struct();
  {states}
end

function y = read_output(p, s, in)
% Output of the equations.
  {output}
end

{move}{derivatives}{advance}{core}{signals}{readers}{gain}{between}{rates}{gain_between}{band_limit}{forces}{maps}{operators}""",
    loop_steps="""\
y = zeros(r.samples, 1);
  for step = 0:r.samples*c.steps - 1
    in = read_signals(p, r, step, 0, c);
    if mod(step, c.steps) == 0
      y(step/c.steps + 1) = read_output(p, s, in);
    end
    middle = read_signals(p, r, step, 0.5, c);
    s = advance(p, s, in, middle, read_signals(p, r, step, 1, c), c);
  end""",
    loop_samples="""\
for step = 0:r.samples - 1
    in = read_signals(p, r, step, 0, c);
    in.{simulated} = y(step + 1);
    y(step + 1) = read_output(p, s, in);
  end""",
    derivatives="""\
function slope = differentiate(p, s, in)
% Derivatives of the states.
  slope = s;
  {derivatives}
end

""",
    move="""\
function next = move(s, time, slope)
% States after a time with given slopes.
  next = s;
  {moves}
end

""",
    advance="""\
function s = advance(p, s, start, middle, finish, c)
% States after one step, from the signals at its start, in its middle and at its end.
  first = differentiate(p, s, start);
  second = differentiate(p, move(s, 0.5*c.step, first), middle);
  third = differentiate(p, move(s, 0.5*c.step, second), middle);
  fourth = differentiate(p, move(s, c.step, third), finish);
  {advances}
end

""",
    map="""\
function x = {name}(p, r, x, c)
% {summary}
  {operators}for k = 1:r.samples
    {statements}
  end
end

""",
    forces="""\
function force = sum_forces(p, s, x, v)
% Forces on the output at a coordinate x with the rate v.
  {forces}
  force = {total};
end

{slopes}function y = add_forces(p, s, r, y, c)
% Add the forces to the output; their coordinate is the input, linear within each part of a sample.
  times = c.steps/c.part_steps;
  time = c.part_steps*c.step;
  for j = 0:r.samples*times - 1
    before = max(j - 1, 0);
    after = min(j + 1, r.samples*times - 1);
    x = read_{input}(p, r, j*c.part_steps, 0, c);
    finish = read_{input}(p, r, after*c.part_steps, 0, c);
    v = (finish - read_{input}(p, r, before*c.part_steps, 0, c))/((after - before)*time);
    if mod(j, times) == 0
      y(j/times + 1) = y(j/times + 1) + sum_forces(p, s, x, v);
    end
{steps}  end
end

""",
    force_slopes="""\
function slope = differentiate_forces(p, s, x, v)
% Derivatives of the states of these forces.
  slope = s;
  {slopes}
end

""",
    force_steps="""\
    middle = 0.5*(x + finish);
    rate = (finish - x)/time;
    first = differentiate_forces(p, s, x, rate);
    second = differentiate_forces(p, move(s, 0.5*time, first), middle, rate);
    third = differentiate_forces(p, move(s, 0.5*time, second), middle, rate);
    fourth = differentiate_forces(p, move(s, time, third), finish, rate);
    {advances}
""",
    core="""\
function y = simulate_core(p, s, r)
% Simulated output.
  {lines}
end

{functions}""",
    signals="""\
function in = read_signals(p, r, step, part, c)
% Signals, a part of a step after its start.
  in = struct();
  {lines}
end

""",
    reader="""\
function value = read_{name}(p, r, step, part, c)
  {lines}
end

""",
    gain="""\
function gain = read_gain(p, part, c)
% Factor of the gain at the start of a part of a sample.
  t = part*c.part_steps*c.step;
  gain = {gain};
end

""",
    gain_between="""\
function gain = interpolate_gain(p, r, step, part, c)
% Factor of the gain, which is linear within each part of a sample.
  j = floor(step/c.part_steps);
  next = min(j + 1, r.samples*c.steps/c.part_steps - 1);
  f = (mod(step, c.part_steps) + part)/c.part_steps;
  gain = read_gain(p, j, c) + f*(read_gain(p, next, c) - read_gain(p, j, c));
end

""",
    band_limit="""\
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

""",
    moment="{}(3*step + 2*part + 1)",
    between={
        "first-order": "interpolate({}, step, part, c)",
        "zero-order": "hold_sample({}, step, c)",
        "band-limited": "limit_band({}, step, part, c)",
    },
    pointer="",
    interpolations={
        "interpolate": """\
function value = interpolate(x, step, part, c)
% Signal that is linear between its samples, a part of a step after the start of the step.
  k = floor(step/c.steps) + 1;
  value = x(k) + (mod(step, c.steps) + part)/c.steps*(x(min(k + 1, numel(x))) - x(k));
end

""",
        "hold_sample": """\
function value = hold_sample(x, step, c)
% Signal that is constant between its samples.
  value = x(floor(step/c.steps) + 1);
end

""",
    },
    rates={
        "find_rate": """\
function rate = find_rate(read, step, part, c)
% Rate of a signal: the derivative of the parabola through the values of a step.
  middle = read(step, 0.5);
  rise = middle - read(step, 0);
  second = read(step, 1) - middle;
  rate = (3*rise - second + 4*part*(second - rise))/c.step;
end

""",
        "find_limited_rate": """\
function rate = find_limited_rate(read, step, part, c)
% Rate of a signal with kinks: its integral, and that of its magnitude, are those of the signal by
% Simpson's rule.
  middle = read(step, 0.5);
  rise = middle - read(step, 0);
  second = read(step, 1) - middle;
  largest = 2*(rise + second);
  ends = [rise, second, rise];
  near = ends(1 + (part > 0.5));
  far = ends(2 + (part > 0.5));
  if part == 0.5
    rate = rise + second;
  elseif near*far >= 0
    rate = min(max(3*near - far, min(largest, 0)), max(largest, 0));
  elseif abs(near) >= abs(far)
    rate = 2*near - 4*far;
  else
    rate = 6*near;
  end
  rate = rate/c.step;
end

""",
        "find_held_rate": """\
function rate = find_held_rate(read, r, step, c)
% Rate of a signal that is held: that of a ramp to the next value within the step.
  rate = (read(min(step + 1, r.samples*c.steps - 1), 0) - read(step, 0))/c.step;
end

""",
        "find_central_rate": """\
function rate = find_central_rate(read, r, step, c)
% Rate of a signal at a sample, by central differences.
  before = max(step - 1, 0);
  after = min(step + 1, r.samples - 1);
  rate = (read(after, 0) - read(before, 0))/(max(after - before, 1)*c.dt);
end

""",
        "delay": """\
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

""",
        "delay_held": """\
function value = delay_held(read, r, step, tau, c)
% Held signal delayed by linear interpolation between steps, constant within each step.
  at = max(step - max(tau, 0)/c.step, 0);
  lower = floor(at);
  first = read(lower, 0);
  value = first + (at - lower)*(read(min(lower + 1, r.samples*c.steps - 1), 0) - first);
end

""",
    },
    definitions={
        "less": "function r = less(a, b)\n  r = double(a < b);\nend\n",
        "less_equal": "function r = less_equal(a, b)\n  r = double(a <= b);\nend\n",
        "sign": "function r = sign_of(a)\n  r = double(a > 0) - double(a < 0);\nend\n",
        "min": "function r = minimum(a, b)\n  if a < b, r = a; else, r = b; end\nend\n",
        "max": "function r = maximum(a, b)\n  if b < a, r = a; else, r = b; end\nend\n",
        "where": "function r = choose(condition, a, b)\n  if condition > 0, r = a; else, r = b; end\nend\n",
        "sqrt": "function r = root(a)\n  if a < 0, r = NaN; else, r = sqrt(a); end\nend\n",
        "log": "function r = logarithm(a)\n  if a < 0, r = NaN; else, r = log(a); end\nend\n",
        "pow": "function r = raise(a, b)\n  if a < 0 && b ~= fix(b), r = NaN; else, r = a^b; end\nend\n",
    },
    operators=MATLAB_OPERATORS,
)

#: Names that the arguments of the function cannot have.
_TAKEN = frozenset(("y", "p", "r", "s", "c", "in", "initial", "shape", "step", "middle"))


def matlab_equations(equations: ExtendedEquations) -> str:
    """Return an extended simulation of equations as a MATLAB function in ASCII."""
    return _MatlabProgram(equations).write()


class _MatlabProgram(EquationProgram):
    language = MATLAB

    def describe_data(self) -> dict[str, str]:
        given, code = self.given, self.code
        arguments = [f"{name}_" if name in _TAKEN else name for name in self.columns]
        columns = zip(self.columns, arguments, strict=True)
        return {
            "columns": ", ".join(arguments),
            "first": arguments[0],
            "count": str(len(arguments) + 1),
            "last": str(len(arguments) + 2),
            "heading": "\n".join(f"% {line}".rstrip() for line in code.describe()),
            "record": self._indent([f"r.{name} = double({argument}(:));" for name, argument in columns]),
            "dt": repr(given.dt),
            "steps": str(given.times * given.steps),
            "part_steps": str(given.steps),
            "step": repr(given.dt / (given.times * given.steps)),
            "fitted": str(given.fitted),
            "rest": repr(MAX_RANGE_AT_REST),
            "parameters": self._indent(
                [f"p.{name} = {value}; % {unit}" for name, value, unit in code.list_parameters()]
            ),
            "states": self._indent([f"s.{name} = {value}; % {unit}" for name, value, unit in self.states]),
        }

    def complete(self, text: str) -> str:
        real = [name for name, function in REAL.items() if f"{function}(" in text]
        called = [*self.code.find_functions(text), *real]
        return (text + "\n".join(self.language.definitions[each] for each in called)).rstrip() + "\n"

    def apply_operator(self, function: str, result: str, arguments: Sequence[str]) -> list[str]:
        context = [] if function == "play" else ["c"]
        return [f"{result} = {function}({', '.join(['x', *arguments, *context])});"]

    def map_input(self) -> list[str]:
        column = f"r.{self.input}"
        lines = [
            f"{column} = {map_function(signal_map)}(p, r, {column}, c);"
            for signal_map in self.given.input_maps
        ]
        if not self.given.moment_maps:
            return lines
        moments = f"r.{self.moments}"
        lines += [
            f"{moments} = zeros(3*r.samples*c.steps, 1);",
            "for step = 0:r.samples*c.steps - 1",
            "  for part = [0, 0.5, 1]",
            f"    {self.language.moment.format(moments)} = {self.interpolate(self.given.system.input)};",
            "  end",
            "end",
            "fine = r;",
            f"fine.samples = numel({moments});",
        ]
        return lines + [
            f"{moments} = {map_function(signal_map)}(p, fine, {moments}, c);"
            for signal_map in self.given.moment_maps
        ]

    def map_output(self) -> list[str]:
        return [f"y = {map_function(each)}(p, r, y, c);" for each in self.given.output_maps]

    def copy_output(self, column: str, count: int | None) -> list[str]:
        if count is None:
            return [f"y = {column};"]
        return [f"given = min({count}, r.samples);", f"y(1:given) = {column}(1:given);"]

    def read_signal(self, function: str, source: Symbol, arguments: Sequence[str]) -> str:
        record = [] if function in ("find_rate", "find_limited_rate") else ["r"]
        return self._call(function, f"@(step, part) {self.read(source)}", *record, "step", *arguments)

    def list_weights(self, weights: Sequence[Sequence[float]]) -> str:
        lines = []
        for row in weights:
            for place in range(0, len(row), 4):
                part = ", ".join(map(repr, row[place : place + 4]))
                lines.append(f"      {part}{',' if place + 4 < len(row) else ';'} ...\n")
        return "".join([*lines, "    "])

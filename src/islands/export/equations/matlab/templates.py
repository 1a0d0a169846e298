"""Parts of a MATLAB program of an extended simulation."""

#: Definitions of the functions in `islands.export.equations.statements.DEFINED`, and of functions that
#: are NaN where those of MATLAB are complex.
DEFINITIONS = {
    "less": "function r = less(a, b)\n  r = double(a < b);\nend\n",
    "less_equal": "function r = less_equal(a, b)\n  r = double(a <= b);\nend\n",
    "sign": "function r = sign_of(a)\n  r = double(a > 0) - double(a < 0);\nend\n",
    "min": "function r = minimum(a, b)\n  if a < b, r = a; else, r = b; end\nend\n",
    "max": "function r = maximum(a, b)\n  if b < a, r = a; else, r = b; end\nend\n",
    "where": "function r = choose(condition, a, b)\n  if condition > 0, r = a; else, r = b; end\nend\n",
    "sqrt": "function r = root(a)\n  if a < 0, r = NaN; else, r = sqrt(a); end\nend\n",
    "log": "function r = logarithm(a)\n  if a < 0, r = NaN; else, r = log(a); end\nend\n",
    "pow": "function r = raise(a, b)\n  if a < 0 && b ~= fix(b), r = NaN; else, r = a^b; end\nend\n",
}

FILE = """\
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

{integration}"""

#: Integration over the record.
LOOP = """\
y = zeros(r.samples, 1);
  for step = 0:r.samples*c.steps - 1
    in = read_signals(p, r, step, 0, c);
    if mod(step, c.steps) == 0
      y(step/c.steps + 1) = read_output(p, s, in);
    end
    middle = read_signals(p, r, step, 0.5, c);
    s = advance(p, s, in, middle, read_signals(p, r, step, 1, c), c);
  end"""

#: Equation of the output of a simulation in discrete time.
SAMPLED_LOOP = """\
for step = 0:r.samples - 1
    in = read_signals(p, r, step, 0, c);
    in.{simulated} = y(step + 1);
    y(step + 1) = read_output(p, s, in);
  end"""

MOVE = """\
function next = move(s, time, slope)
% States after a time with given slopes.
  next = s;
  {moves}
end

"""

ADVANCE = """\
function slope = differentiate(p, s, in)
% Derivatives of the states.
  slope = s;
  {derivatives}
end

function s = advance(p, s, start, middle, finish, c)
% States after one step, from the signals at its start, in its middle and at its end.
  first = differentiate(p, s, start);
  second = differentiate(p, move(s, 0.5*c.step, first), middle);
  third = differentiate(p, move(s, 0.5*c.step, second), middle);
  fourth = differentiate(p, move(s, c.step, third), finish);
  {advances}
end

"""

MAP = """\
function x = {name}(p, r, x, c)
% {summary}
  {operators}for k = 1:r.samples
    {statements}
  end
end
"""

FORCES = """\
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

"""

#: Derivatives of the states of forces.
FORCE_SLOPES = """\
function slope = differentiate_forces(p, s, x, v)
% Derivatives of the states of these forces.
  slope = s;
  {slopes}
end

"""

#: Integration of these states over one part of a sample.
FORCE_STEPS = """\
    middle = 0.5*(x + finish);
    rate = (finish - x)/time;
    first = differentiate_forces(p, s, x, rate);
    second = differentiate_forces(p, move(s, 0.5*time, first), middle, rate);
    third = differentiate_forces(p, move(s, 0.5*time, second), middle, rate);
    fourth = differentiate_forces(p, move(s, time, third), finish, rate);
    {advances}
"""

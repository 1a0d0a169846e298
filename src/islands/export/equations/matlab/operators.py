"""Operators of maps as MATLAB functions; see `islands.effects.interface.map_equation.OPERATORS`.

Each function returns its result for the signal ``x``, a column.
"""

from collections.abc import Mapping
from types import MappingProxyType

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

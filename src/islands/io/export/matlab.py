"""A model as a function file that MATLAB and Octave run."""

import textwrap

from islands.io.export.parts import body, functions, heading, signals, terms
from islands.model.expression import Primitive
from islands.model.model import Model

_FILE = """\
function y = narx_model({inputs}, y0)
% NARX_MODEL  Free run of a NARX model over its inputs, from the first outputs y0.
%
{heading}
%
% Inputs are vectors of one length, y is a vector like the first of them, and y0 holds the first {lag} samples
% of y. Keep this file as narx_model.m; it runs in MATLAB and Octave.

  maximum_lag = {lag};
  {conversions}
  samples = numel({first_input});
  y = zeros(size({first_input}));
  given = min(maximum_lag, samples);
  y(1:given) = y0(1:given);
  for k = maximum_lag + 1:samples
    total = 0;
    {terms}
    y(k) = total;
  end
end
{functions}"""


def matlab_source(model: Model) -> str:
    """Write a model as a function of MATLAB, of ASCII: a free run, from vectors to a vector.

    Sums and products stand in the order of this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a primitive of the user's has no body in MATLAB.
    """
    inputs = signals(model)[1:]
    definitions = [_definition(primitive) for primitive in functions(model)]
    written = terms(model, lambda name, lag: f"{name}(k-{lag})", _name)
    return _FILE.format(
        heading=heading(model, "%"),
        inputs=", ".join(inputs),
        first_input=inputs[0],
        lag=model.maximum_lag,
        # Integers would round every product.
        conversions="\n  ".join(f"{name} = double({name});" for name in [*inputs, "y0"]),
        terms="\n    ".join(f"total = total + {term};" for term in written),
        functions="".join(f"\n{text}" for text in definitions),
    )


def _definition(primitive: Primitive) -> str:
    arguments = ", ".join("ab"[: primitive.arity])
    text = textwrap.indent(body(primitive, "matlab"), "  ")
    return f"function r = {_name(primitive)}({arguments})\n{text}\nend\n"


def _name(primitive: Primitive) -> str:
    return f"f_{primitive.name}"

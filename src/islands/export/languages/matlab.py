"""Export of a model as a function file for MATLAB and Octave."""

import textwrap

from islands.export.parts import body, functions, heading, signals, terms
from islands.expressions.tree import Primitive
from islands.model.model import Model

_FILE = """\
function y = narx_model({inputs}, y0)
% NARX_MODEL  Free run of a NARX model from its inputs and the first outputs y0.
%
{heading}
%
% Inputs are vectors of equal length, y has the size of the first input, and y0 holds the first {lag} samples
% of y. Save this file as narx_model.m; it runs in MATLAB and Octave.

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
    """Return a model as an ASCII MATLAB function that computes the free run from input vectors.

    Sums and products are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a user-defined primitive has no MATLAB body.
    """
    inputs = signals(model)[1:]
    definitions = [matlab_definition(primitive) for primitive in functions(model)]
    term_texts = terms(model, lambda name, lag: f"{name}(k-{lag})" if lag else f"{name}(k)", matlab_name)
    return _FILE.format(
        heading=heading(model, "%"),
        inputs=", ".join(inputs),
        first_input=inputs[0],
        lag=model.maximum_lag,
        # With integer inputs MATLAB would round every product.
        conversions="\n  ".join(f"{name} = double({name});" for name in [*inputs, "y0"]),
        terms="\n    ".join(f"total = total + {term};" for term in term_texts),
        functions="".join(f"\n{text}" for text in definitions),
    )


def matlab_definition(primitive: Primitive) -> str:
    """Return the definition of a primitive as a MATLAB function.

    Raises
    ------
    ModelError
        The primitive has no MATLAB body.
    """
    arguments = ", ".join("ab"[: primitive.arity])
    text = textwrap.indent(body(primitive, "matlab"), "  ")
    return f"function r = {matlab_name(primitive)}({arguments})\n{text}\nend\n"


def matlab_name(primitive: Primitive) -> str:
    """Return the name of a primitive's MATLAB function."""
    return f"f_{primitive.name}"

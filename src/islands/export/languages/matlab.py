"""Export of a model as a function file for MATLAB and Octave."""

import textwrap

from islands.export.block import make_block
from islands.export.languages.bodies import body
from islands.expressions.tree import Primitive
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import Model

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

_COUPLED_FILE = """\
function [{outputs}] = coupled_narx_model({inputs}, {starts})
% COUPLED_NARX_MODEL  Free run of a coupled NARX model from its inputs and the first outputs.
%
{heading}
%
% Inputs are vectors of equal length, the outputs have the size of the first input, and {starts} hold the
% first {lag} samples of the outputs. Save this file as coupled_narx_model.m; it runs in MATLAB and Octave.

  maximum_lag = {lag};
  {conversions}
  samples = numel({first_input});
  given = min(maximum_lag, samples);
  {allocations}
  for k = maximum_lag + 1:samples
    {steps}
  end
end
{functions}"""


def matlab_source(model: Model | CoupledModel) -> str:
    """Return a model of one or several outputs as an ASCII MATLAB function: the free run from input vectors.

    Sums and products are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a user-defined primitive has no MATLAB body.
    """
    block = make_block(model)
    outputs, inputs = block.signals[: block.outputs], block.signals[block.outputs :]
    starts = ["y0"] if block.outputs == 1 else [f"first_{output}" for output in outputs]
    shared = {
        "heading": block.heading("%"),
        "inputs": ", ".join(inputs),
        "first_input": inputs[0],
        "lag": block.maximum_lag,
        # With integer inputs MATLAB would round every product.
        "conversions": "\n  ".join(f"{name} = double({name});" for name in [*inputs, *starts]),
        "functions": "".join(f"\n{matlab_definition(primitive)}" for primitive in block.primitives),
    }
    terms = [block.terms(place, _write_sample, matlab_name) for place in range(block.outputs)]
    if block.outputs == 1:
        return _FILE.format(terms="\n    ".join(f"total = total + {term};" for term in terms[0]), **shared)
    steps, allocations = [], []
    for output, start, added in zip(outputs, starts, terms, strict=True):
        steps += [f"{output}(k) = 0;", *(f"{output}(k) = {output}(k) + {term};" for term in added)]
        allocations += [f"{output} = zeros(size({inputs[0]}));", f"{output}(1:given) = {start}(1:given);"]
    return _COUPLED_FILE.format(
        outputs=", ".join(outputs),
        starts=", ".join(starts),
        allocations="\n  ".join(allocations),
        steps="\n    ".join(steps),
        **shared,
    )


def _write_sample(name: str, lag: int) -> str:
    return f"{name}(k-{lag})" if lag else f"{name}(k)"


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

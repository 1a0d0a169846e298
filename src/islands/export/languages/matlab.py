"""Export of a model as a function file for MATLAB and Octave."""

import textwrap
from collections.abc import Iterable

from islands.export.languages.bodies import body, function_name
from islands.expressions.tree import Primitive
from islands.models.block import Block

_FILE = """\
function y = narx_model({inputs}, y0)
% NARX_MODEL  Free run of a NARX model from its inputs and the first outputs y0.
%
{heading}
%
{note}
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

_SIGNALS_FILE = """\
function [{outputs}] = {name}({inputs}, {starts})
% {title}  Free run of a {kind} from its inputs and the first outputs.
%
{heading}
%
{note}
%
% Inputs are vectors of equal length, the outputs have the size of the first input, and {starts} hold the
% first {lag} samples of the outputs. Save this file as {name}.m; it runs in MATLAB and Octave.

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

_STATE_SPACE_FILE = """\
function [{outputs}] = state_model({inputs}, start)
% STATE_MODEL  Free run of a model with states from its inputs and the states at sample 0.
%
{heading}
%
{note}
%
% Inputs are vectors of equal length, the outputs have the size of the first input, and start holds
% {states} at sample 0. Save this file as state_model.m; it runs in MATLAB and Octave.

  if nargin < {arguments}, start = [{start}]; end
  {conversions}
  samples = numel({first_input});
  {allocations}
  for k = 1:samples
    if k == 1
      {first_states}
    else
      {next_states}
    end
    {observations}
  end
end
{functions}"""


def matlab_source(block: Block) -> str:
    """Return a block as an ASCII MATLAB function: the free run from input vectors.

    Sums and products are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a user-defined primitive has no MATLAB body.
    """
    outputs, states = block.signals[: block.outputs], block.signals[block.outputs : block.computed]
    inputs = block.signals[block.computed :]
    starts = ["y0"] if block.computed == 1 else [f"first_{output}" for output in outputs]
    if block.is_state_space:
        starts = ["start"]
    shared = {
        "heading": block.heading("%"),
        "note": block.describe_start("% "),
        "inputs": ", ".join(inputs),
        "first_input": inputs[0],
        "lag": block.maximum_lag,
        # With integer inputs MATLAB would round every product.
        "conversions": "\n  ".join(f"{name} = double({name});" for name in [*inputs, *starts]),
        "functions": "".join(f"\n{matlab_definition(primitive)}" for primitive in block.primitives),
    }
    if block.computed == 1:
        terms = block.terms(0, _write_sample, function_name)
        return _FILE.format(terms="\n    ".join(f"total = total + {term};" for term in terms), **shared)
    allocations = [f"{name} = zeros(size({inputs[0]}));" for name in (*outputs, *states)]
    if block.is_state_space:
        places = range(block.outputs, block.computed)
        return _STATE_SPACE_FILE.format(
            outputs=", ".join(outputs),
            states=", ".join(states),
            arguments=len(inputs) + 1,
            start=", ".join(map(repr, block.first_states())),
            allocations="\n  ".join(allocations),
            first_states="\n      ".join(
                f"{name}(k) = start({place});" for place, name in enumerate(states, start=1)
            ),
            next_states="\n      ".join(_write_equations(block, places)),
            observations="\n    ".join(_write_equations(block, range(block.outputs))),
            **shared,
        )
    allocations += [
        f"{output}(1:given) = {start}(1:given);" for output, start in zip(outputs, starts, strict=True)
    ]
    for place, name in enumerate(states):
        start = block.start_text(place, _write_sample, function_name)
        allocations.append(f"for k = 1:given, {name}(k) = {start}; end")
    name = "state_model" if block.starts else "coupled_narx_model"
    return _SIGNALS_FILE.format(
        name=name,
        title=name.upper(),
        kind="model with states" if block.starts else "coupled NARX model",
        outputs=", ".join(outputs),
        starts=", ".join(starts),
        allocations="\n  ".join(allocations),
        steps="\n    ".join(_write_equations(block, block.order)),
        **shared,
    )


def _write_equations(block: Block, places: Iterable[int]) -> list[str]:
    """Return the statements that compute signals at sample k."""
    steps = []
    for place in places:
        name = block.signals[place]
        terms = block.terms(place, _write_sample, function_name)
        steps += [f"{name}(k) = 0;", *(f"{name}(k) = {name}(k) + {term};" for term in terms)]
    return steps


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
    return f"function r = {function_name(primitive)}({arguments})\n{text}\nend\n"

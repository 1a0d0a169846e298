"""Export of a model to MATLAB and Octave: a function file, and a System object for Simulink."""

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

_SYSTEM_FILE = """\
classdef narx_system < matlab.System
% NARX_SYSTEM  NARX model that is called once per sample.
%
{heading}
%
% Save this file as narx_system.m; select narx_system in a block MATLAB System, or call a System object with
% the inputs of each sample: model = narx_system; {results} = model({inputs}).

  properties (Nontunable)
    % Start  Samples before the first one, newest first:
{past}
    Start = {start};
  end

  properties (DiscreteState)
    Past
  end

  methods (Access = protected)
    function resetImpl(obj)
      obj.Past = reshape(double(obj.Start), 1, {states});
    end

    function {results} = outputImpl(obj, {inputs})
      result = predict(obj, {inputs});
      {assignments}
    end

    function updateImpl(obj, {inputs})
      result = predict(obj, {inputs});
      x = obj.Past;
      obj.Past = [{update}];
    end

    function result = predict(obj, {inputs})
      x = obj.Past;
      {conversions}
      result = zeros(1, {outputs});
      {equations}
    end

    function varargout = isInputDirectFeedthroughImpl(~, {ignored})
      varargout = {{{direct}}};
    end

    function time = getSampleTimeImpl(obj)
      time = createSampleTime(obj, 'Type', 'Discrete', 'SampleTime', {dt!r});
    end

    function [size, class, complex] = getDiscreteStateSpecificationImpl(~, ~)
      size = [1 {states}];
      class = 'double';
      complex = false;
    end

    function varargout = getOutputSizeImpl(~)
      varargout = repmat({{[1 1]}}, 1, {outputs});
    end

    function varargout = getOutputDataTypeImpl(~)
      varargout = repmat({{'double'}}, 1, {outputs});
    end

    function varargout = isOutputComplexImpl(~)
      varargout = repmat({{false}}, 1, {outputs});
    end

    function varargout = isOutputFixedSizeImpl(~)
      varargout = repmat({{true}}, 1, {outputs});
    end
  end
{functions}end
"""

_FUNCTIONS = """
  methods (Static, Access = private)
{definitions}  end
"""


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


def matlab_system_source(block: Block) -> str:
    """Return a block as the source of a MATLAB System object, in ASCII.

    The first sample of the object is the one after the past samples in its property ``Start``. An input that
    acts at once has direct feedthrough.

    Raises
    ------
    ModelError
        The model has no finite parameters or no sampling time, or a user-defined primitive has no MATLAB
        body.
    """
    block.check_names()
    outputs, inputs = block.signals[: block.computed], block.signals[block.computed :]
    used = [textwrap.indent(matlab_definition(primitive), "    ") for primitive in block.primitives]
    equations = []
    for place in block.order:
        equations += [
            f"result({place + 1}) = result({place + 1}) + {term};"
            for term in block.terms(
                place,
                lambda signal, lag: _sample(block, signal, lag),
                lambda primitive: f"narx_system.{function_name(primitive)}",
            )
        ]
    read = [signal for signal, direct in zip(inputs, block.feedthrough, strict=True) if direct]
    return _SYSTEM_FILE.format(
        heading=block.heading("%"),
        inputs=", ".join(inputs),
        results=outputs[0] if len(outputs) == 1 else f"[{', '.join(outputs)}]",
        assignments="\n      ".join(
            f"{name} = result({place});" for place, name in enumerate(outputs, start=1)
        ),
        past=block.describe_state("    %   "),
        outputs=block.computed,
        start=_write_start(block),
        states=block.size,
        update=_update(block),
        # With integer inputs MATLAB would round every product.
        conversions="\n      ".join(f"{name} = double({name});" for name in read) or "% no present input",
        equations="\n      ".join(equations),
        ignored=", ".join("~" for _ in inputs),
        direct=", ".join(str(flag).lower() for flag in block.feedthrough),
        dt=block.dt,
        functions=_FUNCTIONS.format(definitions="\n".join(used)) if used else "",
    )


def _sample(block: Block, signal: str, lag: int) -> str:
    if lag:
        return f"x({block.position(signal, lag) + 1})"
    channel = block.signals.index(signal)
    return signal if channel >= block.computed else f"result({channel + 1})"


def _write_start(block: Block) -> str:
    values = block.start_values()
    return f"[{', '.join(map(repr, values))}]" if any(values) else f"zeros(1, {block.size})"


def _update(block: Block) -> str:
    """Return the elements of the next state: each signal begins with its present sample."""
    parts, place = [], 1
    for channel, (signal, depth) in enumerate(zip(block.signals, block.depths, strict=True)):
        if depth:
            parts.append(f"double({signal})" if channel >= block.computed else f"result({channel + 1})")
        if depth > 1:
            parts.append(f"x({place}:{place + depth - 2})")
        place += depth
    return ", ".join(parts)

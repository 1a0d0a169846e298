"""Export of a model as a MATLAB System object, for the Simulink block MATLAB System."""

import textwrap

from islands.export.languages.bodies import function_name
from islands.export.languages.matlab import matlab_definition
from islands.models.block import Block

_FILE = """\
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
    used = [textwrap.indent(matlab_definition(each), "    ") for each in block.primitives]
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
    return _FILE.format(
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
        direct=", ".join(str(each).lower() for each in block.feedthrough),
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

"""Export of a model as a MATLAB System object, for the Simulink block MATLAB System."""

import textwrap

from islands.io.export.matlab import matlab_definition
from islands.io.export.parts import functions, heading, terms
from islands.io.export.sampled_state import SampledState, make_sampled_state
from islands.model.model import Model

_FILE = """\
classdef narx_system < matlab.System
% NARX_SYSTEM  NARX model that is called once per sample.
%
{heading}
%
% Save this file as narx_system.m; select narx_system in a block MATLAB System, or call a System object with
% the inputs of each sample: model = narx_system; y = model({inputs}).

  properties (Nontunable)
    % Start  Samples before the first one, newest first:
{past}
    Start = zeros(1, {states});
  end

  properties (DiscreteState)
    Past
  end

  methods (Access = protected)
    function resetImpl(obj)
      obj.Past = reshape(double(obj.Start), 1, {states});
    end

    function y = outputImpl(obj, {inputs})
      y = predict(obj, {inputs});
    end

    function updateImpl(obj, {inputs})
      x = obj.Past;
      obj.Past = [{update}];
    end

    function y = predict(obj, {inputs})
      x = obj.Past;
      {conversions}
      total = 0;
      {terms}
      y = total;
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

    function size = getOutputSizeImpl(~)
      size = [1 1];
    end

    function class = getOutputDataTypeImpl(~)
      class = 'double';
    end

    function complex = isOutputComplexImpl(~)
      complex = false;
    end

    function fixed = isOutputFixedSizeImpl(~)
      fixed = true;
    end
  end
{functions}end
"""

_FUNCTIONS = """
  methods (Static, Access = private)
{definitions}  end
"""


def matlab_system_source(model: Model) -> str:
    """Return a model as the source of a MATLAB System object, in ASCII.

    The first sample of the object is the one after the past samples in its property ``Start``. An input that
    acts at once has direct feedthrough.

    Raises
    ------
    ModelError
        The model has no finite parameters or no sampling time, or a user-defined primitive has no MATLAB
        body.
    """
    state = make_sampled_state(model)
    inputs = state.signals[1:]
    used = [textwrap.indent(matlab_definition(each), "    ") for each in functions(model)]
    lines = terms(
        model,
        lambda signal, lag: f"x({state.position(signal, lag) + 1})" if lag else signal,
        lambda primitive: f"narx_system.f_{primitive.name}",
    )
    read = [signal for signal, direct in zip(state.signals, state.feedthrough, strict=True) if direct]
    return _FILE.format(
        heading=heading(model, "%"),
        inputs=", ".join(inputs),
        past=state.describe("    %   "),
        states=state.size,
        update=_update(state),
        # With integer inputs MATLAB would round every product.
        conversions="\n      ".join(f"{name} = double({name});" for name in read) or "% no present input",
        terms="\n      ".join(f"total = total + {term};" for term in lines),
        ignored=", ".join("~" for _ in inputs),
        direct=", ".join(str(each).lower() for each in state.feedthrough[1:]),
        dt=state.dt,
        functions=_FUNCTIONS.format(definitions="\n".join(used)) if used else "",
    )


def _update(state: SampledState) -> str:
    """Return the elements of the next state: each signal begins with its present sample."""
    predicted = f"predict(obj, {', '.join(state.signals[1:])})"
    parts, place = [], 1
    for channel, (signal, depth) in enumerate(zip(state.signals, state.depths, strict=True)):
        if depth:
            parts.append(f"double({signal})" if channel else predicted)
        if depth > 1:
            parts.append(f"x({place}:{place + depth - 2})")
        place += depth
    return ", ".join(parts)

"""Coupled models as programs in Python, C and MATLAB.

The programs evaluate all equations at a sample before they continue with the next one. They add terms in the
order of the kernels.
"""

from islands.export.coupled.coupled_signals import (
    coupled_description,
    coupled_functions,
    coupled_heading,
    equation_signals,
    equation_terms,
    equation_text,
    input_signals,
    output_signals,
)
from islands.export.languages.c import c_name, definition
from islands.export.languages.matlab import matlab_definition, matlab_name
from islands.export.languages.python import escape_name, function_source, python_name, required_globals
from islands.simulation.coupled_model import CoupledModel

_PYTHON = '''"""Coupled NARX model:

{equations}

{description}
"""

import math

MAXIMUM_LAG = {lag}
{constants}

{functions}def predict(k, {signals}):
    """Return {outputs} at sample k from the preceding samples."""
{equations_code}
    return {results}


def simulate({inputs}, {starts}):
    """Return the free run from the inputs and the first MAXIMUM_LAG outputs."""
    {outputs} = ([float(value) for value in first[:MAXIMUM_LAG]] for first in ({starts}))
    for k in range(MAXIMUM_LAG, len({first_input})):
        {results} = predict(k, {signals})
        {appends}
    return {outputs}
'''

_C = """\
/*
{heading}
 *
 * C99. If it is compiled with -ffp-contract=off and without -ffast-math, its results equal those of the
 * search bit for bit. The last bits of exp, log, sin, cos and tanh depend on the C library.
 */

#include <math.h>
#include <stddef.h>

enum {{ MAXIMUM_LAG = {lag} }};

{functions}{predictors}/*
 * Free run: the first MAXIMUM_LAG samples of the outputs are given, the others are computed and written.
 */
void simulate({inputs}, {outputs}, size_t samples)
{{
    for (size_t k = MAXIMUM_LAG; k < samples; ++k) {{
        {steps}
    }}
}}
"""

_C_PREDICTOR = """\
/* Return {output}(k) from the preceding samples. The pointers point to sample k. */
double predict_{output}({pointers})
{{
    double total = 0.0;
    {terms}
    return total;
}}

"""

_MATLAB = """\
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


def coupled_python(model: CoupledModel) -> str:
    """Return a coupled model as a Python module with ``predict`` and ``simulate``.

    Raises
    ------
    ModelError
        As `python_source`.
    """
    used, inputs, outputs = coupled_functions(model), input_signals(model), output_signals(model)
    sources = [function_source(primitive) for primitive in used]
    code = []
    for place, output in enumerate(outputs):
        code.append(f"    next_{output} = 0.0")
        code += [
            f"    next_{output} += {term}"
            for term in equation_terms(
                model, place, lambda name, lag: f"{name}[k-{lag}]" if lag else f"{name}[k]", python_name
            )
        ]
    return _PYTHON.format(
        equations="\n".join(equation_text(model, place) for place in range(len(outputs))),
        description=coupled_description(model, escape_name),
        lag=model.maximum_lag,
        constants="".join(f"{name} = {value}\n" for name, value in required_globals(used).items()),
        functions="\n\n".join(sources) + ("\n\n" if sources else ""),
        signals=", ".join([*outputs, *inputs]),
        outputs=", ".join(outputs),
        inputs=", ".join(inputs),
        first_input=inputs[0],
        starts=", ".join(f"first_{output}" for output in outputs),
        results=", ".join(f"next_{output}" for output in outputs),
        equations_code="\n".join(code),
        appends="\n        ".join(f"{output}.append(next_{output})" for output in outputs),
    )


def coupled_c(model: CoupledModel) -> str:
    """Return a coupled model as C99 source with one ``predict_y1`` per output and ``simulate``.

    Raises
    ------
    ModelError
        As `c_source`.
    """
    inputs, outputs = input_signals(model), output_signals(model)
    definitions = [definition(primitive, c_name(primitive)) for primitive in coupled_functions(model)]
    pointers = ", ".join(f"const double *{name}" for name in [*outputs, *inputs])
    at_k = ", ".join(f"{name} + k" for name in [*outputs, *inputs])
    predictors = []
    for place, output in enumerate(outputs):
        names = equation_signals(model, place)
        single = model.models[place]
        read = {channel for item in single.regressors for channel, _ in item.lags}
        # Compilers warn about unused parameters.
        lines = [f"(void){name};" for channel, name in enumerate(names.values()) if channel not in read]
        lines += [
            f"total += {term};"
            for term in equation_terms(model, place, lambda name, lag: f"{name}[{-lag}]", c_name)
        ]
        predictors.append(_C_PREDICTOR.format(output=output, pointers=pointers, terms="\n    ".join(lines)))
    return _C.format(
        heading=coupled_heading(model, " *"),
        lag=model.maximum_lag,
        functions="".join(f"{text}\n" for text in definitions),
        predictors="".join(predictors),
        inputs=", ".join(f"const double *{name}" for name in inputs),
        outputs=", ".join(f"double *{name}" for name in outputs),
        steps="\n        ".join(f"{output}[k] = predict_{output}({at_k});" for output in outputs),
    )


def coupled_matlab(model: CoupledModel) -> str:
    """Return a coupled model as an ASCII MATLAB function that computes the free run.

    Raises
    ------
    ModelError
        As `matlab_source`.
    """
    inputs, outputs = input_signals(model), output_signals(model)
    starts = [f"first_{output}" for output in outputs]
    steps = []
    for place, output in enumerate(outputs):
        steps.append(f"{output}(k) = 0;")
        steps += [
            f"{output}(k) = {output}(k) + {term};"
            for term in equation_terms(model, place, _matlab_sample, matlab_name)
        ]
    allocations = []
    for output, start in zip(outputs, starts, strict=True):
        allocations += [f"{output} = zeros(size({inputs[0]}));", f"{output}(1:given) = {start}(1:given);"]
    return _MATLAB.format(
        outputs=", ".join(outputs),
        inputs=", ".join(inputs),
        starts=", ".join(starts),
        heading=coupled_heading(model, "%"),
        lag=model.maximum_lag,
        # With integer inputs MATLAB would round every product.
        conversions="\n  ".join(f"{name} = double({name});" for name in [*inputs, *starts]),
        first_input=inputs[0],
        allocations="\n  ".join(allocations),
        steps="\n    ".join(steps),
        functions="".join(f"\n{matlab_definition(primitive)}" for primitive in coupled_functions(model)),
    )


def _matlab_sample(name: str, lag: int) -> str:
    return f"{name}(k-{lag})" if lag else f"{name}(k)"

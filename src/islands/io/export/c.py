"""A model as one file of C99, as it goes into a controller."""

import textwrap

from islands.io.export.parts import body, functions, heading, signals, terms
from islands.model.expression import Primitive
from islands.model.model import Model

_FILE = """\
/*
{heading}
 *
 * C99. Compiled with -ffp-contract=off and without -ffast-math it computes the numbers of the search bit for
 * bit; the last bits of exp, log, sin, cos and tanh are those of the machine's own library.
 */

#include <math.h>
#include <stddef.h>

enum {{ MAXIMUM_LAG = {lag} }};

{functions}/*
 * Return y(k) from the samples before it. The pointers stand at sample k: y[-1] .. y[-MAXIMUM_LAG] and the
 * inputs likewise are read, and nothing from k on.
 */
double predict({signals})
{{
    double total = 0.0;
    {terms}
    return total;
}}

/* Run free over the inputs: y holds its first MAXIMUM_LAG samples, and the others are written. */
void simulate({inputs}, double *y, size_t samples)
{{
    for (size_t k = MAXIMUM_LAG; k < samples; ++k) {{
        y[k] = predict({at_k});
    }}
}}
"""


def c_source(model: Model) -> str:
    """Write a model as C99, of ASCII: ``predict`` one sample, ``simulate`` a free run.

    Sums and products stand in the order of this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a primitive of the user's has no body in C.
    """
    names = signals(model)
    definitions = [definition(primitive, _name(primitive)) for primitive in functions(model)]
    # A compiler warns of an argument that is never read.
    read = {channel for item in model.regressors for channel, _ in item.lags}
    lines = [f"(void){name};" for channel, name in enumerate(names) if channel not in read]
    lines += [f"total += {term};" for term in terms(model, lambda name, lag: f"{name}[-{lag}]", _name)]
    pointers = [f"const double *{name}" for name in names]
    return _FILE.format(
        heading=heading(model, " *"),
        lag=model.maximum_lag,
        functions="".join(f"{text}\n" for text in definitions),
        signals=", ".join(pointers),
        inputs=", ".join(pointers[1:]),
        terms="\n    ".join(lines),
        at_k=", ".join(f"{name} + k" for name in names),
    )


def definition(primitive: Primitive, name: str) -> str:
    """Write a primitive as a function of C.

    Raises
    ------
    ModelError
        It has no body in C.
    """
    arguments = ", ".join(f"double {argument}" for argument in "ab"[: primitive.arity])
    return f"static double {name}({arguments})\n{{\n{textwrap.indent(body(primitive, 'c'), '    ')}\n}}\n"


def _name(primitive: Primitive) -> str:
    # tanh is the library's, and what begins with _ the compiler's.
    return f"f_{primitive.name}"

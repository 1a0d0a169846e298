"""Export of a model as one C99 file, for example for an embedded controller."""

import textwrap

from islands.export.parts import body, functions, heading, signals, terms
from islands.expressions.tree import Primitive
from islands.model.model import Model

_FILE = """\
/*
{heading}
 *
 * C99. If it is compiled with -ffp-contract=off and without -ffast-math, its results equal those of the
 * search bit for bit. The last bits of exp, log, sin, cos and tanh depend on the C library.
 */

#include <math.h>
#include <stddef.h>

enum {{ MAXIMUM_LAG = {lag} }};

{functions}/*
 * Return y(k) from the preceding samples. The pointers point to sample k: the function reads y[-1] ..
 * y[-MAXIMUM_LAG] and the same lags of the inputs, never {present}.
 */
double predict({signals})
{{
    double total = 0.0;
    {terms}
    return total;
}}

/* Free run: the first MAXIMUM_LAG samples of y are given, the others are computed and written. */
void simulate({inputs}, double *y, size_t samples)
{{
    for (size_t k = MAXIMUM_LAG; k < samples; ++k) {{
        y[k] = predict({at_k});
    }}
}}
"""


def c_source(model: Model) -> str:
    """Return a model as C99 source in ASCII.

    The source defines the functions ``predict`` (one sample) and ``simulate`` (free run). Sums and products
    are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a user-defined primitive has no C body.
    """
    names = signals(model)
    definitions = [definition(primitive, c_name(primitive)) for primitive in functions(model)]
    # Compilers warn about unused parameters.
    read = {channel for item in model.regressors for channel, _ in item.lags}
    lines = [f"(void){name};" for channel, name in enumerate(names) if channel not in read]
    lines += [f"total += {term};" for term in terms(model, lambda name, lag: f"{name}[{-lag}]", c_name)]
    pointers = [f"const double *{name}" for name in names]
    return _FILE.format(
        heading=heading(model, " *"),
        lag=model.maximum_lag,
        present=_describe_future(model),
        functions="".join(f"{text}\n" for text in definitions),
        signals=", ".join(pointers),
        inputs=", ".join(pointers[1:]),
        terms="\n    ".join(lines),
        at_k=", ".join(f"{name} + k" for name in names),
    )


def _describe_future(model: Model) -> str:
    present = [name for name, lead in zip(signals(model), model.leads, strict=True) if lead]
    return f"a later sample than {'[0], '.join(present)}[0]" if present else "sample k or later ones"


def definition(primitive: Primitive, name: str) -> str:
    """Return the definition of a primitive as a C function.

    Raises
    ------
    ModelError
        The primitive has no C body.
    """
    arguments = ", ".join(f"double {argument}" for argument in "ab"[: primitive.arity])
    return f"static double {name}({arguments})\n{{\n{textwrap.indent(body(primitive, 'c'), '    ')}\n}}\n"


def c_name(primitive: Primitive) -> str:
    """Return the name of a primitive's C function."""
    # The prefix avoids names of the C library (tanh) and reserved names (leading underscore).
    return f"f_{primitive.name}"

"""Export of a model as C99, for example for an embedded controller, and as an S-function."""

import textwrap

from islands.export.languages.bodies import body, function_name
from islands.expressions.tree import Primitive
from islands.models.block import Block

_HEAD = """\
/*
{heading}
 *
{start}
 *
{exactness}
 */

#include <math.h>
#include <stddef.h>

{constant}

{functions}"""

_ONE_OUTPUT = """\
/*
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

_PREDICTOR = """\
/* Return {output}(k) from {read}. The pointers point to sample k. */
double predict_{output}({pointers})
{{
    double total = 0.0;
    {terms}
    return total;
}}

"""

_SEVERAL_SIGNALS = """\
/*
 * Free run: {start}
 */
void simulate({arguments}, size_t samples)
{{
    {starts}for (size_t k = {first}; k < samples; ++k) {{
        {steps}
    }}
}}
"""

#: What a free run starts from.
_FROM_OUTPUTS = "the first MAXIMUM_LAG samples of the outputs are given, the others are computed and written."
_FROM_STATES = """\
all samples are computed and written, from the states at sample 0, {states}. These are START
 * if the pointer is NULL."""

_FILE = """\
/*
{heading}
 *
 * Level-2 S-function for Simulink. Save this file as narx_model.c, run "mex narx_model.c" in MATLAB, and
 * enter narx_model in a block S-Function. Input ports: {ports}. Output ports: {results}. Its parameter is the
 * vector of the samples before the first one, newest first, or [] for {default}:
{past}
 */

#define S_FUNCTION_NAME narx_model
#define S_FUNCTION_LEVEL 2

#include <math.h>

#include "simstruc.h"

{block}
/* Whether the output reads the present sample of an input. */
static const int DIRECT[INPUTS] = {{{direct}}};

static size_t count_start_values(SimStruct *S) {{ return mxGetNumberOfElements(ssGetSFcnParam(S, 0)); }}

#define MDL_CHECK_PARAMETERS
static void mdlCheckParameters(SimStruct *S)
{{
    size_t given = count_start_values(S);
    if (!mxIsDouble(ssGetSFcnParam(S, 0)) || (given != 0 && given != STATES)) {{
        ssSetErrorStatus(S, "the parameter has to be [] or a vector of {states} samples of class double");
    }}
}}

static void mdlInitializeSizes(SimStruct *S)
{{
    ssSetNumSFcnParams(S, 1);
    if (ssGetNumSFcnParams(S) != ssGetSFcnParamsCount(S)) {{
        return;
    }}
    mdlCheckParameters(S);
    if (ssGetErrorStatus(S) != NULL) {{
        return;
    }}
    ssSetSFcnParamTunable(S, 0, 0);
    ssSetNumContStates(S, 0);
    ssSetNumDiscStates(S, STATES);
    if (!ssSetNumInputPorts(S, INPUTS) || !ssSetNumOutputPorts(S, OUTPUTS)) {{
        return;
    }}
    for (int port = 0; port < INPUTS; ++port) {{
        ssSetInputPortWidth(S, port, 1);
        ssSetInputPortRequiredContiguous(S, port, 1);
        ssSetInputPortDirectFeedThrough(S, port, DIRECT[port]);
    }}
    for (int port = 0; port < OUTPUTS; ++port) {{
        ssSetOutputPortWidth(S, port, 1);
    }}
    ssSetNumSampleTimes(S, 1);
    ssSetOptions(S, SS_OPTION_EXCEPTION_FREE_CODE);
}}

static void mdlInitializeSampleTimes(SimStruct *S)
{{
    ssSetSampleTime(S, 0, STEP);
    ssSetOffsetTime(S, 0, 0.0);
}}

#define MDL_INITIALIZE_CONDITIONS
static void mdlInitializeConditions(SimStruct *S)
{{
    real_T *state = ssGetRealDiscStates(S);
    for (size_t place = 0; place < STATES; ++place) {{
        state[place] = count_start_values(S) ? mxGetPr(ssGetSFcnParam(S, 0))[place] : START_VALUES[place];
    }}
}}

static void mdlOutputs(SimStruct *S, int_T tid)
{{
    double input[INPUTS], result[OUTPUTS];
    (void)tid;
    /* Simulink provides the other inputs only afterwards, to mdlUpdate. */
    for (int port = 0; port < INPUTS; ++port) {{
        input[port] = DIRECT[port] ? ssGetInputPortRealSignal(S, port)[0] : 0.0;
    }}
    compute(ssGetRealDiscStates(S), input, result);
    for (int port = 0; port < OUTPUTS; ++port) {{
        ssGetOutputPortRealSignal(S, port)[0] = result[port];
    }}
}}

#define MDL_UPDATE
static void mdlUpdate(SimStruct *S, int_T tid)
{{
    double input[INPUTS], result[OUTPUTS];
    (void)tid;
    for (int port = 0; port < OUTPUTS; ++port) {{
        result[port] = ssGetOutputPortRealSignal(S, port)[0];
    }}
    for (int port = 0; port < INPUTS; ++port) {{
        input[port] = ssGetInputPortRealSignal(S, port)[0];
    }}
    advance(ssGetRealDiscStates(S), result, input);
}}

static void mdlTerminate(SimStruct *S) {{ (void)S; }}

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
"""


def c_source(block: Block) -> str:
    """Return a block as C99 source in ASCII.

    The source defines the function ``predict`` (one sample; ``predict_y1`` .. for several signals) and
    ``simulate`` (free run). Sums and products are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a user-defined primitive has no C body.
    """
    names = block.signals[: block.computed]
    head = _HEAD.format(
        heading=block.heading(" *"),
        start=block.describe_start(" * "),
        exactness=textwrap.fill(
            _describe_exactness(block), 100, initial_indent=" * ", subsequent_indent=" * "
        ),
        constant=_write_constant(block),
        functions=define_functions(block),
    )
    pointers = [f"const double *{name}" for name in block.signals]
    given, at_k = ", ".join(pointers[block.computed :]), ", ".join(f"{name} + k" for name in block.signals)
    bodies = ["\n    ".join(_list_terms(block, place)) for place in range(block.computed)]
    if block.computed == 1:
        (terms,) = bodies
        return head + _ONE_OUTPUT.format(
            present=_describe_future(block),
            signals=", ".join(pointers),
            inputs=given,
            terms=terms,
            at_k=at_k,
        )
    predictors = (
        _PREDICTOR.format(
            output=name,
            pointers=", ".join(pointers),
            terms=terms,
            read="the states and inputs of sample k"
            if block.is_state_space and place < block.outputs
            else "the preceding samples",
        )
        for place, (name, terms) in enumerate(zip(names, bodies, strict=True))
    )
    by_state = ["const double *start"] if block.is_state_space else []
    simulation = _SEVERAL_SIGNALS.format(
        start=_FROM_STATES.format(states=", ".join(names[block.outputs :])) if by_state else _FROM_OUTPUTS,
        arguments=", ".join([given, *by_state, *(f"double *{name}" for name in names)]),
        starts=_write_starts(block),
        first="0" if by_state else "MAXIMUM_LAG",
        steps="\n        ".join(
            f"{names[place]}[k] = {_write_first(block, place)}predict_{names[place]}({at_k});"
            for place in block.order
        ),
    )
    return head + "".join(predictors) + simulation


def _describe_exactness(block: Block) -> str:
    """State how far the results are those of the simulation in this package."""
    # The simulation feeds back deviations, the program measured outputs.
    adds_offsets = not block.is_state_space and any(map(block.levels.get, block.signals[: block.outputs]))
    difference = (
        "up to rounding, since the program adds the offsets to the outputs that it feeds back: differences "
        "below 1e-14 of the offset were measured"
        if adds_offsets
        else "bit for bit"
    )
    return (
        "C99. If it is compiled with -ffp-contract=off and without -ffast-math, its results equal those of "
        f"`islands simulate` from the same start {difference}. The last bits of exp, log, sin, cos and tanh "
        "depend on the C library."
    )


def _write_constant(block: Block) -> str:
    """Return the constant of the start of a free run."""
    if block.is_state_space:
        return f"static const double START[] = {{{', '.join(map(repr, block.first_states()))}}};"
    return f"enum {{ MAXIMUM_LAG = {block.maximum_lag} }};"


def _write_first(block: Block, place: int) -> str:
    """Return the condition and the value of a state at sample 0; empty if the equation holds there."""
    is_given = block.is_state_space and place >= block.outputs
    return f"k == 0 ? first[{place - block.outputs}] : " if is_given else ""


def _write_starts(block: Block) -> str:
    """Return the statements that write or choose the first samples of the states; empty without states."""
    if not block.starts:
        return ""
    if block.is_state_space:
        return "const double *first = start == NULL ? START : start;\n    "

    def write_sample(signal: str, _lag: int) -> str:
        return f"{signal}[k]"

    lines = [
        f"        {name}[k] = {block.start_text(place, write_sample, function_name)};\n"
        for place, name in enumerate(block.signals[block.outputs : block.computed])
    ]
    loop = "for (size_t k = 0; k < MAXIMUM_LAG && k < samples; ++k) {\n"
    return f"{loop}{''.join(lines)}    }}\n    "


def _list_terms(block: Block, place: int) -> list[str]:
    # Compilers warn about unused parameters.
    unused = [f"(void){name};" for name in block.find_unread(place)]
    terms = block.terms(place, lambda name, lag: f"{name}[{-lag}]", function_name)
    return unused + [f"total += {term};" for term in terms]


def _describe_future(block: Block) -> str:
    present = [name for name, lead in zip(block.signals, block.leads, strict=True) if lead]
    return f"a later sample than {'[0], '.join(present)}[0]" if present else "sample k or later ones"


def define_functions(block: Block) -> str:
    """Return the definitions of the primitives of a block as C functions.

    Raises
    ------
    ModelError
        A primitive has no C body.
    """
    return "".join(f"{definition(primitive, function_name(primitive))}\n" for primitive in block.primitives)


def definition(primitive: Primitive, name: str) -> str:
    """Return the definition of a primitive as a C function.

    Raises
    ------
    ModelError
        The primitive has no C body.
    """
    arguments = ", ".join(f"double {argument}" for argument in "ab"[: primitive.arity])
    return f"static double {name}({arguments})\n{{\n{textwrap.indent(body(primitive, 'c'), '    ')}\n}}\n"


_C_BLOCK = """\
enum {{ OUTPUTS = {outputs}, INPUTS = {inputs}, STATES = {states}, FEEDTHROUGH = {feedthrough} }};

/* Number of past samples of each output and each input in the state, newest first. */
static const int DEPTHS[OUTPUTS + INPUTS] = {{{depths}}};

/* Samples before the first one unless others are given. */
static const double START_VALUES[STATES] = {{{start}}};

/* Sampling time in seconds. */
static const double STEP = {dt!r};

{functions}/* Compute the outputs of sample k from the past samples and the inputs of sample k. */
static void compute(const double *state, const double *input, double *output)
{{
    double total;
    (void)input;
    {equations}
}}

/* Move on to the next sample: the outputs and inputs of sample k become the newest past samples. */
static void advance(double *state, const double *output, const double *input)
{{
    for (int channel = 0; channel < OUTPUTS + INPUTS; ++channel) {{
        for (int place = DEPTHS[channel] - 1; place > 0; --place) {{
            state[place] = state[place - 1];
        }}
        if (DEPTHS[channel] > 0) {{
            state[0] = channel < OUTPUTS ? output[channel] : input[channel - OUTPUTS];
        }}
        state += DEPTHS[channel];
    }}
}}
"""


def c_block(block: Block) -> str:
    """Return the functions ``compute`` and ``advance`` of a block in C99, for inclusion in a program.

    Sums and products are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a user-defined primitive has no C body.
    """

    def read(signal: str, lag: int) -> str:
        if lag:
            return f"state[{block.position(signal, lag)}]"
        channel = block.signals.index(signal)
        is_input = channel >= block.computed
        return f"input[{channel - block.computed}]" if is_input else f"output[{channel}]"

    lines = ["(void)state;"]
    for place in block.order:
        lines += ["total = 0.0;", *(f"total += {term};" for term in block.terms(place, read, function_name))]
        lines.append(f"output[{place}] = total;")
    return _C_BLOCK.format(
        outputs=block.computed,
        inputs=len(block.signals) - block.computed,
        states=block.size,
        feedthrough=int(any(block.feedthrough)),
        depths=", ".join(map(str, block.depths)),
        start=", ".join(map(repr, block.start_values())),
        dt=block.dt,
        functions=define_functions(block),
        equations="\n    ".join(lines),
    )


def s_function_source(block: Block) -> str:
    """Return a block as the C source of a level-2 S-function, in ASCII.

    The first sample of the block is the one after the past samples in its parameter. An input that acts at
    once has direct feedthrough.

    Raises
    ------
    ModelError
        The model has no finite parameters or no sampling time, or a user-defined primitive has no C body.
    """
    block.check_names()
    return _FILE.format(
        heading=block.heading(" *"),
        ports=", ".join(block.signals[block.computed :]),
        results=", ".join(block.signals[: block.computed]),
        past=block.describe_state(" *  "),
        block=c_block(block),
        direct=", ".join(str(int(each)) for each in block.feedthrough),
        states=block.size,
        default="the operating point" if any(block.start_values()) else "zeros",
    )

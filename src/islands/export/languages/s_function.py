"""Export of a model as a Simulink block: a C MEX S-function in one file."""

from islands.export.languages.c import c_block
from islands.models.block import Block

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

"""S-function export: it compiles against a substitute of Simulink, which drives it like the free run."""

import ctypes

import numpy as np
import pytest

from islands.io.export import export, write_export
from islands.io.export.fmu.compiler import find_compiler
from islands.performance.benchmark.compiled_c import compile_model
from support.block_cases import OF_BLOCKS, OF_STATES, block_case
from support.programs import bits

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc")

#: The part of Simulink's interface that the exported files use.
HEADER = """\
#include <stddef.h>
typedef double real_T;
typedef int int_T;
typedef struct { double *values; size_t count; int is_double; } mxArray;
typedef struct {
    mxArray parameter;
    int parameters, states, inputs, outputs, direct[8];
    double state[64], input[8], output[8], period;
    const char *error;
} SimStruct;
#define SS_OPTION_EXCEPTION_FREE_CODE 1
#define mxGetNumberOfElements(array) ((array)->count)
#define mxIsDouble(array) ((array)->is_double)
#define mxGetPr(array) ((array)->values)
#define ssGetSFcnParam(S, place) (&(S)->parameter)
#define ssGetSFcnParamsCount(S) 1
#define ssSetNumSFcnParams(S, n) ((S)->parameters = (n))
#define ssGetNumSFcnParams(S) ((S)->parameters)
#define ssSetSFcnParamTunable(S, place, on) ((void)(S))
#define ssSetErrorStatus(S, text) ((S)->error = (text))
#define ssGetErrorStatus(S) ((S)->error)
#define ssSetNumContStates(S, n) ((void)(S))
#define ssSetNumDiscStates(S, n) ((S)->states = (n))
#define ssGetRealDiscStates(S) ((S)->state)
#define ssSetNumInputPorts(S, n) ((S)->inputs = (n), 1)
#define ssSetNumOutputPorts(S, n) ((S)->outputs = (n), 1)
#define ssSetInputPortWidth(S, port, n) ((void)(S))
#define ssSetInputPortRequiredContiguous(S, port, on) ((void)(S))
#define ssSetInputPortDirectFeedThrough(S, port, on) ((S)->direct[port] = (on))
#define ssSetOutputPortWidth(S, port, n) ((void)(S))
#define ssSetNumSampleTimes(S, n) ((void)(S))
#define ssSetOptions(S, options) ((void)(S))
#define ssSetSampleTime(S, place, time) ((S)->period = (time))
#define ssSetOffsetTime(S, place, time) ((void)(S))
#define ssGetInputPortRealSignal(S, port) ((S)->input + (port))
#define ssGetOutputPortRealSignal(S, port) ((S)->output + (port))
"""

#: Simulink's loop: inputs without direct feedthrough are not yet known when the output is computed.
LOOP = """\
const char *run(double *past, size_t count, int is_double, const double *u, size_t samples, double *y)
{
    static SimStruct S[1];
    *S = (SimStruct){.parameter = {past, count, is_double}};
    mdlInitializeSizes(S);
    if (S->error) return S->error;
    mdlInitializeSampleTimes(S);
    mdlInitializeConditions(S);
    for (size_t k = 0; k < samples; ++k) {
        const double *present = u + k * S->inputs;
        for (int i = 0; i < S->inputs; ++i) S->input[i] = S->direct[i] ? present[i] : 0.0 / 0.0;
        mdlOutputs(S, 0);
        for (int i = 0; i < S->outputs; ++i) y[k * S->outputs + i] = S->output[i];
        for (int i = 0; i < S->inputs; ++i) S->input[i] = present[i];
        mdlUpdate(S, 0);
    }
    mdlTerminate(S);
    return NULL;
}
"""


def run(case, past, folder, is_double=True):
    """Run the compiled S-function; return its error and its output."""
    (folder / "simstruc.h").write_text(HEADER)
    (folder / "simulink.c").write_text(LOOP)
    strict = ("-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror")
    flags = (*strict, "-DMATLAB_MEX_FILE", f"-I{folder}")
    write_export(case.exported, "s-function", folder / "model.c")
    library = compile_model((folder / "model.c").read_text(), flags, folder)
    library.run.restype = ctypes.c_char_p
    given = (past, case.inputs, np.empty(case.outputs.shape))
    arrays = [np.ascontiguousarray(values, dtype=float) for values in given]

    pointers = [each.ctypes.data_as(ctypes.c_void_p) for each in arrays]
    sizes = [ctypes.c_size_t(len(each)) for each in arrays]
    error = library.run(pointers[0], sizes[0], is_double, pointers[1], sizes[1], pointers[2])
    return error, arrays[2]


@pytest.mark.ci
@needs_compiler
@pytest.mark.parametrize("name", OF_BLOCKS)
def test_the_block_simulates_like_the_free_run(name, tmp_path):
    case = block_case(name)
    error, found = run(case, case.past, tmp_path)
    assert error is None
    np.testing.assert_allclose(found, case.outputs, rtol=1e-12, atol=0)


@needs_compiler
def test_an_empty_parameter_is_a_past_of_zeros(tmp_path):
    case = block_case("published 12")
    empty, zeros = (run(case, each, tmp_path)[1] for each in ([], np.zeros(len(case.past))))
    assert bits(empty) == bits(zeros)


@needs_compiler
@pytest.mark.parametrize(("count", "is_double"), [(3, True), (5, True), (4, False)])
def test_a_parameter_of_another_size_or_class_is_refused(count, is_double, tmp_path):
    error, _ = run(block_case("published 12"), np.zeros(count), tmp_path, is_double)
    assert error == b"the parameter has to be [] or a vector of 4 samples of class double"


def test_the_file_lists_ports_and_past_samples():
    text = export(OF_STATES["several inputs"], "s-function")
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 112
    assert "Input ports: u1, u2, u3." in text
    assert "y(k-1), u1(k-1), u2(k-1), u3(k-1), u3(k-2)" in text

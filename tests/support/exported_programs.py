"""Exported programs and blocks, run on a record or on the signals of a block."""

import ctypes
import shutil
import subprocess

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from islands.export import export, write_export
from islands.export.fmu.compiler import find_compiler
from islands_measurements.speed.compiled_c import compile_model
from support.equation_programs import OCTAVE_FILES

OCTAVE = shutil.which("octave-cli")

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc")

needs_octave = pytest.mark.skipif(OCTAVE is None, reason="no octave-cli: install Octave to run the MATLAB")

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-pedantic", "-Werror")


def pointer(signal, sample=0):
    """Return a pointer to a sample."""
    return ctypes.cast(signal.ctypes.data + 8 * sample, ctypes.POINTER(ctypes.c_double))


def run_c(exported, data, folder, y=None):
    """Run the compiled ``simulate``. Before the run, y is NaN after the first samples."""
    y = data.y.copy() if y is None else y
    y[exported.maximum_lag :] = np.nan
    inputs = [np.ascontiguousarray(column) for column in data.u.T]
    simulate = compile_model(export(exported, "c"), FLAGS, folder).simulate
    simulate.restype = None
    simulate(*map(pointer, inputs), pointer(y), ctypes.c_size_t(data.samples))
    return y


def octave(script, folder):
    """Run a script in a folder of functions. Warnings fail the test."""
    done = subprocess.run(
        [OCTAVE, "--quiet", "--no-init-file", "--no-history", "--eval", script],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout


def run_matlab(programs, folder):
    """Run several exported models on one record each, in one process with a folder for each."""
    runs = []
    for index, (exported, data) in enumerate(programs):
        own = folder / str(index)
        own.mkdir()
        (own / "narx_model.m").write_text(export(exported, "matlab"), encoding="ascii")
        inputs = [f"u{channel}" for channel in range(data.inputs)]
        for name, column in zip(inputs, data.u.T, strict=True):
            np.ascontiguousarray(column).tofile(own / name)
        data.y[: exported.maximum_lag].tofile(own / "y0")
        arguments = ", ".join(f"read_numbers('{name}')" for name in [*inputs, "y0"])
        runs.append(f"cd('{own}'); clear narx_model; write_numbers('y', narx_model({arguments}));")
    octave(OCTAVE_FILES + "\n".join(runs), folder)
    return [np.fromfile(folder / str(index) / "y") for index in range(len(programs))]


#: The part of Simulink's interface that the exported files use.
_SIMULINK = """\
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
_LOOP = """\
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


def run_s_function(case, past, folder, is_double=True):
    """Run the compiled S-function; return its error and its output."""
    (folder / "simstruc.h").write_text(_SIMULINK)
    (folder / "simulink.c").write_text(_LOOP)
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


#: The part of the base class that Simulink calls. Octave has no protected access from a base class.
_SYSTEM = """\
classdef System < handle
end
"""

_SYSTEM_LOOP = """\
function r = read(name, columns)
  file = fopen(name); r = fread(file, [columns Inf], 'double')'; fclose(file);
end
block = narx_system();
block.Start = read('past', 1)';
resetImpl(block);
inputs = num2cell(read('inputs', {inputs}));
y = cell(rows(inputs), {outputs});
for k = 1:rows(inputs)
  known = inputs(k, :);
  known(~[{direct}]) = NaN;
  [y{{k, :}}] = outputImpl(block, known{{:}});
  updateImpl(block, inputs{{k, :}});
end
file = fopen('outputs', 'w'); fwrite(file, cell2mat(y)', 'double'); fclose(file);
"""


def run_matlab_system(case, folder):
    """Run the class in Octave and return the outputs."""
    package = folder / "+matlab"
    package.mkdir()
    (package / "System.m").write_text(_SYSTEM)
    write_export(case.exported, "matlab-system", folder / "narx_system.m")
    text = (folder / "narx_system.m").read_text()
    for attributes in (" (Access = protected)", " (DiscreteState)", " (Nontunable)"):
        assert attributes in text
        text = text.replace(attributes, "")
    (folder / "narx_system.m").write_text(text.replace("(Static, Access = private)", "(Static)"))
    np.array(case.past).tofile(folder / "past")
    case.inputs.tofile(folder / "inputs")
    direct = " ".join(str(int(each)) for each in case.block.feedthrough)
    script = _SYSTEM_LOOP.format(inputs=case.inputs.shape[1], outputs=case.block.computed, direct=direct)
    octave(script, folder)
    return np.fromfile(folder / "outputs").reshape(case.outputs.shape)


def run_fmu(case, folder, kind):
    """Simulate the FMU, which fmpy validates, and return the outputs.

    An input that acts at once delays the output by one sampling time: it has the past output first, and not
    the last one.
    """
    path = folder / "model.fmu"
    write_export(case.exported, kind, path)
    assert validate_fmu(str(path)) == []
    columns, outputs = case.block.columns, case.block.columns[: case.block.computed]
    inputs = columns[case.block.computed :]
    signals = np.empty(len(case.inputs), [(column, float) for column in ("time", *inputs)])
    signals["time"] = np.arange(len(case.inputs)) * case.block.dt
    for column, values in zip(inputs, case.inputs.T, strict=True):
        signals[column] = values
    names = [f"start.{columns[channel]}[{lag}]" for channel, lag in case.block.samples]
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=signals["time"][-1],
        step_size=case.block.dt,
        output_interval=case.block.dt,
        start_values=dict(zip(names, case.past, strict=True)),
        input=signals,
        output=outputs,
    )
    signals = np.column_stack([found[column] for column in outputs])
    if not any(case.block.feedthrough):
        return signals
    np.testing.assert_array_equal(signals[0], case.past[:1])
    return signals[1:]

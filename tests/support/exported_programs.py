"""Exported programs and blocks, run on a record or on the signals of a block."""

import ctypes
import math
import re
import shutil
import subprocess

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from islands.export import export, write_export
from islands.export.fmu import find_compiler
from islands.models.measured_signals import program_block
from lab.speed.compiled_c import compile_model
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


def build_s_function(exported, folder):
    """Compile the S-function; return a function of the parameter and the inputs of a `Run`."""
    (folder / "simstruc.h").write_text(_SIMULINK)
    (folder / "simulink.c").write_text(_LOOP)
    strict = ("-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror")
    write_export(exported, "s-function", folder / "model.c")
    flags = (*strict, "-DMATLAB_MEX_FILE", f"-I{folder}")
    library = compile_model((folder / "model.c").read_text(), flags, folder)
    library.run.restype = ctypes.c_char_p
    outputs = program_block(exported).computed

    def simulate(run, is_double=True):
        given = ([] if run.past is None else run.past, run.inputs, np.empty((len(run.inputs), outputs)))
        arrays = [np.ascontiguousarray(values, dtype=float) for values in given]
        pointers = [each.ctypes.data_as(ctypes.c_void_p) for each in arrays]
        sizes = [ctypes.c_size_t(len(each)) for each in arrays]
        error = library.run(pointers[0], sizes[0], is_double, pointers[1], sizes[1], pointers[2])
        assert error is None, error.decode()
        return arrays[2]

    return simulate


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
if exist('past', 'file'), block.Start = read('past', 1)'; end
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


def build_matlab_system(exported, folder):
    """Write the class; return a function of a `Run` that runs it in Octave."""
    block, package = program_block(exported), folder / "+matlab"
    package.mkdir()
    (package / "System.m").write_text(_SYSTEM)
    write_export(exported, "matlab-system", folder / "narx_system.m")
    text = (folder / "narx_system.m").read_text()
    for attributes in (" (Access = protected)", " (DiscreteState)", " (Nontunable)"):
        assert attributes in text
        text = text.replace(attributes, "")
    (folder / "narx_system.m").write_text(text.replace("(Static, Access = private)", "(Static)"))

    def simulate(run):
        (folder / "past").unlink(missing_ok=True)
        if run.past is not None:
            np.array(run.past).tofile(folder / "past")
        run.inputs.tofile(folder / "inputs")
        direct = " ".join(str(int(each)) for each in block.feedthrough)
        octave(_SYSTEM_LOOP.format(inputs=run.inputs.shape[1], outputs=block.computed, direct=direct), folder)
        return np.fromfile(folder / "outputs").reshape(-1, block.computed)

    return simulate


def build_fmu(kind):
    """Return a function that builds an FMU, which fmpy validates, and returns a function of a `Run`.

    An input that acts at once delays the output by one sampling time: it has the past output first, and not
    the last one, which is NaN here.
    """

    def build(exported, folder):
        write_export(exported, kind, folder / "model.fmu")
        assert validate_fmu(str(folder / "model.fmu")) == []
        block = program_block(exported)
        columns, outputs = block.columns, block.columns[: block.computed]

        def simulate(run):
            signals = np.empty(len(run.inputs), [(column, float) for column in ("time", *columns)])
            signals["time"] = np.arange(len(run.inputs)) * block.dt
            for column, values in zip(columns[block.computed :], run.inputs.T, strict=True):
                signals[column] = values
            names = [f"start.{columns[channel]}[{lag}]" for channel, lag in block.samples]
            found = fmpy.simulate_fmu(
                str(folder / "model.fmu"),
                stop_time=signals["time"][-1],
                step_size=block.dt,
                output_interval=block.dt,
                start_values={} if run.past is None else dict(zip(names, run.past, strict=True)),
                input=signals[["time", *columns[block.computed :]]],
                output=outputs,
            )
            y = np.column_stack([found[column] for column in outputs])
            if not any(block.feedthrough):
                return y
            past = block.start_values() if run.past is None else run.past
            newest = [block.position(signal, 1) for signal in block.signals[: block.computed]]
            np.testing.assert_array_equal(y[0], np.array(past)[newest])
            return np.vstack([y[1:], np.full((1, block.computed), np.nan)])

        return simulate

    return build


def build_python(exported, _folder):
    """Return a function of a `Run` that calls ``simulate`` of the module."""
    module = {}
    exec(export(exported, "python"), module)

    def simulate(run):
        y = module["simulate"](*run.u.T.tolist(), *_list_starts(exported, run))
        return np.array(y).reshape(-1, len(run.u)).T[run.given :]

    return simulate


def build_c(exported, folder):
    """Compile the file; return a function of a `Run` that calls ``simulate``."""
    block = program_block(exported)
    library = compile_model(export(exported, "c"), FLAGS, folder)
    library.simulate.restype = None

    def simulate(run):
        computed = np.full((block.computed, len(run.u)), np.nan)
        starts = _list_starts(exported, run)
        if block.is_state_space:
            starts = [np.array(each) for each in starts] or [None]
        else:
            computed[: block.outputs, : run.given] = starts
            starts = []
        arrays = [*(np.ascontiguousarray(column) for column in run.u.T), *starts, *computed]
        pointers = [None if each is None else pointer(each) for each in arrays]
        library.simulate(*pointers, ctypes.c_size_t(len(run.u)))
        return computed.T[run.given :, : block.outputs]

    return simulate


def build_matlab(exported, folder):
    """Write the function; return a function of a `Run` that calls it in Octave."""
    text = export(exported, "matlab")
    name = re.match(r"function .* = (\w+)\(", text)[1]
    (folder / f"{name}.m").write_text(text, encoding="ascii")
    outputs = program_block(exported).outputs

    def simulate(run):
        arguments = [*run.u.T, *map(np.array, _list_starts(exported, run))]
        for place, values in enumerate(arguments):
            values.tofile(folder / f"a{place}")
        read = ", ".join(f"read_numbers('a{place}')" for place in range(len(arguments)))
        results = ", ".join(f"y{place}" for place in range(outputs))
        octave(f"{OCTAVE_FILES}\n[{results}] = {name}({read}); write_numbers('y', [{results}]);", folder)
        return np.fromfile(folder / "y").reshape(outputs, -1).T[run.given :]

    return simulate


def build_modelica(exported, _folder):
    """Translate the block to Python; return a function of a `Run` that evaluates its equations in order."""
    block, text = program_block(exported), export(exported, "modelica")
    known = {name: getattr(math, name) for name in ("sqrt", "exp", "log", "sin", "cos", "tanh")}
    for name, arguments, right in _MODELICA_FUNCTION.findall(text):
        inputs = ", ".join(re.findall(r"input Real (\w);", arguments))
        exec(f"def {name}({inputs}): return {_translate(right)}", known)
    lines = text.partition(" then\n")[2].partition("  end when;")[0].split(";")
    equations = [_translate(" ".join(each.split())) for each in lines if each.strip()]
    starts = re.findall(r"parameter Real start_(\w+)\[(\d+)\] = fill\((\S+), \d+\)", text)

    def simulate(run):
        past = {f"past_{name}": [float(value)] * int(depth) for name, depth, value in starts}
        for (channel, lag), value in zip(block.samples, run.past or (), strict=run.past is not None):
            past[f"past_{block.signals[channel]}"][lag - 1] = value
        found = []
        for sample in run.inputs.tolist():
            names = {**known, **{f"pre_{name}": list(values) for name, values in past.items()}, **past}
            names.update(zip(block.signals[block.computed :], sample, strict=True))
            for each in equations:
                exec(each, names)
            found.append([names[name] for name in block.signals[: block.computed]])
        return np.array(found)

    return simulate


#: A function of a Modelica block: name, arguments, value.
_MODELICA_FUNCTION = re.compile(r"function (\w+)\n(.*?)  algorithm\n    r := (.*?);\n", re.DOTALL)


def _translate(text):
    """Return an equation or an expression of Modelica, whose indices count from 1, in Python."""
    text = re.sub(r"pre\((past_\w+)\[(\d+)\]\)", lambda leaf: f"pre_{leaf[1]}[{int(leaf[2]) - 1}]", text)
    text = re.sub(r"\b(past_\w+)\[(\d+)\] =", lambda leaf: f"{leaf[1]}[{int(leaf[2]) - 1}] =", text)
    return re.sub(r"(?:else)?if (.*?) then (.*?) (?=else)", r"else \2 if \1 ", text).removeprefix("else ")


def _list_starts(exported, run):
    """Return the further arguments of ``simulate`` of a program of whole records."""
    if program_block(exported).is_state_space:
        return [] if run.states is None else [run.states]
    return run.first.T.tolist()


#: Formats that are run: function that builds a program, and its tool.
BUILDERS = {
    "python": (build_python, None),
    "c": (build_c, needs_compiler),
    "modelica": (build_modelica, None),
    "matlab": (build_matlab, needs_octave),
    "s-function": (build_s_function, needs_compiler),
    "matlab-system": (build_matlab_system, needs_octave),
    "fmu": (build_fmu("fmu"), needs_compiler),
    "fmu2": (build_fmu("fmu2"), needs_compiler),
}

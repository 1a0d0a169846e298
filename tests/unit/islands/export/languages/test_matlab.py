"""MATLAB export: Octave runs it, and it simulates like the kernel."""

import numpy as np
import pytest

from islands.export import export
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.user_primitive import primitive
from islands.simulation.predictors import free_run
from islands.systems.published_models import PUBLISHED
from support.block_cases import OF_STATES
from support.exported_programs import needs_octave, octave, run_matlab
from support.programs import at_the_edges, model, record


@needs_octave
def test_too_few_first_outputs_are_an_error_in_octave(tmp_path):
    (tmp_path / "narx_model.m").write_text(export(PUBLISHED["12"].model, "matlab"))
    shown = octave("try, narx_model(1:9, 1), catch e, disp(e.message), end", tmp_path)
    assert "out of bound 1" in shown
    assert "y0" in shown


# User-defined primitives.


def saturation(a):
    return a / (1.0 + abs(a))


def blend(a, b):
    return 0.25 * a - b if a > 0.5 else b


OWN = {
    "saturation": primitive("saturation", saturation, matlab="r = a / (1 + abs(a));"),
    # Names of the language and of the exported program.
    "end_": primitive("end_", saturation, matlab="size = abs(a);\nr = a / (1 + size);"),
    "total": primitive("total", blend, matlab="if a > 0.5, r = 0.25*a - b; else, r = b; end"),
    "narx_model": primitive("narx_model", blend, matlab="r = b;\nif a > 0.5\n  r = 0.25*a - b;\nend"),
}


@pytest.mark.ci
@needs_octave
def test_a_user_defined_primitive_runs_with_its_body(tmp_path):
    programs = []
    for name, entry in OWN.items():
        arguments = "u(k-1), y(k-1)" if entry.arity == 2 else "u(k-1)"
        terms = {f"{name}({arguments})*sign(u(k-2))": 0.3, "y(k-2)": 0.2}
        programs.append((model(terms, primitives=PRIMITIVES | OWN), record()))
    for (exported, data), theirs in zip(programs, run_matlab(programs, tmp_path), strict=True):
        np.testing.assert_allclose(theirs[2:], free_run(exported, data).y[2:], rtol=1e-12)


def test_the_class_declares_what_simulink_asks_for():
    text = export(OF_STATES["at once"], "matlab-system")
    assert text.isascii()
    assert text.startswith("classdef narx_system < matlab.System\n% NARX_SYSTEM")
    assert "varargout = {true, false};" in text
    assert "'SampleTime', 0.1);" in text
    assert "size = [1 3];" in text
    assert "%   y(k-1), u2(k-1), u2(k-2)" in text


@pytest.mark.ci
@needs_octave
def test_octave_primitives_equal_the_kernels_at_jumps_and_limits(tmp_path):
    programs = [at_the_edges(name) for name in PRIMITIVES]
    for (exported, data), theirs in zip(programs, run_matlab(programs, tmp_path), strict=True):
        ours = free_run(exported, data, bound=np.inf).y
        np.testing.assert_allclose(theirs[1:], ours[1:], rtol=1e-12, err_msg=export(exported, "plain"))

"""MATLAB System export: Octave runs the class on a substitute of the base class."""

import numpy as np
import pytest

from islands.export import export
from support.block_cases import OF_BLOCKS, OF_STATES, block_case
from support.exported_programs import needs_octave, run_matlab_system


@pytest.mark.ci
@needs_octave
@pytest.mark.parametrize("name", OF_BLOCKS)
def test_octave_simulates_like_the_free_run(name, tmp_path):
    case = block_case(name)
    found = run_matlab_system(case, tmp_path)
    np.testing.assert_allclose(found, case.outputs, rtol=1e-12, atol=0)


def test_the_class_declares_what_simulink_asks_for():
    text = export(OF_STATES["at once"], "matlab-system")
    assert text.isascii()
    assert text.startswith("classdef narx_system < matlab.System\n% NARX_SYSTEM")
    assert "varargout = {true, false};" in text
    assert "'SampleTime', 0.1);" in text
    assert "size = [1 3];" in text
    assert "%   y(k-1), u2(k-1), u2(k-2)" in text

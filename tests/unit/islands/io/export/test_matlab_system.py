"""MATLAB System export: Octave runs the class on a substitute of the base class."""

import shutil
import subprocess

import numpy as np
import pytest

from islands.io.export import export
from support.block_cases import OF_STATES, block_case

OCTAVE = shutil.which("octave-cli")

needs_octave = pytest.mark.skipif(OCTAVE is None, reason="no octave-cli: install Octave to run the MATLAB")

#: The part of the base class that Simulink calls. Octave has no protected access from a base class.
BASE = """\
classdef System < handle
end
"""

RUN = """\
function r = read(name, columns)
  file = fopen(name); r = fread(file, [columns Inf], 'double')'; fclose(file);
end
block = narx_system();
block.Start = read('past', 1)';
resetImpl(block);
inputs = num2cell(read('inputs', {inputs}));
y = zeros(rows(inputs), 1);
for k = 1:rows(inputs)
  known = inputs(k, :);
  known(~[{direct}]) = NaN;
  y(k) = outputImpl(block, known{{:}});
  updateImpl(block, inputs{{k, :}});
end
file = fopen('outputs', 'w'); fwrite(file, y, 'double'); fclose(file);
"""


@pytest.mark.ci
@needs_octave
@pytest.mark.parametrize("name", OF_STATES)
def test_octave_simulates_like_the_free_run(name, tmp_path):
    exported, _, past, inputs, outputs = block_case(name)
    package = tmp_path / "+matlab"
    package.mkdir()
    (package / "System.m").write_text(BASE)
    text = export(exported, "matlab-system")
    for attributes in (" (Access = protected)", " (DiscreteState)", " (Nontunable)"):
        assert attributes in text
        text = text.replace(attributes, "")
    (tmp_path / "narx_system.m").write_text(text.replace("(Static, Access = private)", "(Static)"))
    np.array(past).tofile(tmp_path / "past")
    inputs.tofile(tmp_path / "inputs")
    script = RUN.format(
        inputs=exported.inputs, direct=" ".join(str(int(lead)) for lead in exported.leads[1:])
    )
    done = subprocess.run(
        [OCTAVE, "--quiet", "--no-init-file", "--no-history", "--eval", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    np.testing.assert_allclose(np.fromfile(tmp_path / "outputs"), outputs, rtol=1e-12, atol=0)


def test_the_class_declares_what_simulink_asks_for():
    text = export(OF_STATES["at once"], "matlab-system")
    assert text.isascii()
    assert text.startswith("classdef narx_system < matlab.System\n% NARX_SYSTEM")
    assert "varargout = {true, false};" in text
    assert "'SampleTime', 0.1);" in text
    assert "size = [1 3];" in text
    assert "%   y(k-1), u2(k-1), u2(k-2)" in text

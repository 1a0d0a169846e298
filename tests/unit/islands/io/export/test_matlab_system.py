"""MATLAB System export: Octave runs the class on a substitute of the base class."""

import shutil
import subprocess

import numpy as np
import pytest

from islands.io.export import export, write_export
from support.block_cases import OF_BLOCKS, OF_STATES, block_case

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
y = cell(rows(inputs), {outputs});
for k = 1:rows(inputs)
  known = inputs(k, :);
  known(~[{direct}]) = NaN;
  [y{{k, :}}] = outputImpl(block, known{{:}});
  updateImpl(block, inputs{{k, :}});
end
file = fopen('outputs', 'w'); fwrite(file, cell2mat(y)', 'double'); fclose(file);
"""


@pytest.mark.ci
@needs_octave
@pytest.mark.parametrize("name", OF_BLOCKS)
def test_octave_simulates_like_the_free_run(name, tmp_path):
    case = block_case(name)
    package = tmp_path / "+matlab"
    package.mkdir()
    (package / "System.m").write_text(BASE)
    write_export(case.exported, "matlab-system", tmp_path / "narx_system.m")
    text = (tmp_path / "narx_system.m").read_text()
    for attributes in (" (Access = protected)", " (DiscreteState)", " (Nontunable)"):
        assert attributes in text
        text = text.replace(attributes, "")
    (tmp_path / "narx_system.m").write_text(text.replace("(Static, Access = private)", "(Static)"))
    np.array(case.past).tofile(tmp_path / "past")
    case.inputs.tofile(tmp_path / "inputs")
    direct = " ".join(str(int(each)) for each in case.block.feedthrough[case.block.outputs :])
    script = RUN.format(inputs=case.inputs.shape[1], outputs=case.block.outputs, direct=direct)
    done = subprocess.run(
        [OCTAVE, "--quiet", "--no-init-file", "--no-history", "--eval", script],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    found = np.fromfile(tmp_path / "outputs").reshape(case.outputs.shape)
    np.testing.assert_allclose(found, case.outputs, rtol=1e-12, atol=0)


def test_the_class_declares_what_simulink_asks_for():
    text = export(OF_STATES["at once"], "matlab-system")
    assert text.isascii()
    assert text.startswith("classdef narx_system < matlab.System\n% NARX_SYSTEM")
    assert "varargout = {true, false};" in text
    assert "'SampleTime', 0.1);" in text
    assert "size = [1 3];" in text
    assert "%   y(k-1), u2(k-1), u2(k-2)" in text

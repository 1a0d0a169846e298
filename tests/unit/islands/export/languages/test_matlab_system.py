"""MATLAB System export: what the class declares."""

from islands.export import export
from support.block_cases import OF_STATES


def test_the_class_declares_what_simulink_asks_for():
    text = export(OF_STATES["at once"], "matlab-system")
    assert text.isascii()
    assert text.startswith("classdef narx_system < matlab.System\n% NARX_SYSTEM")
    assert "varargout = {true, false};" in text
    assert "'SampleTime', 0.1);" in text
    assert "size = [1 3];" in text
    assert "%   y(k-1), u2(k-1), u2(k-2)" in text

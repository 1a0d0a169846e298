"""Fixtures of the tests of figures."""

import pytest


@pytest.fixture
def without_layout(monkeypatch):
    """Skip the layout of figures, which takes most of the time of a test.

    For tests of the content of figures. `test_style_legibility` checks their layout.
    """
    monkeypatch.setattr("matplotlib.figure.Figure.draw_without_rendering", lambda _figure: None)

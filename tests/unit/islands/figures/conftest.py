"""What the tests of figures share."""

import pytest


@pytest.fixture
def without_layout(monkeypatch):
    """Leave out the layout of figures, which takes most of the time of making one.

    It is for tests that look at what a figure holds; where it stands is a matter of `test_style_legibility`.
    """
    monkeypatch.setattr("matplotlib.figure.Figure.draw_without_rendering", lambda _figure: None)

"""Fixtures of the tests of figures."""

import pytest


@pytest.fixture
def without_layout(monkeypatch):
    """Skip the layout of figures, which takes most of the time of a test.

    For tests of the content of figures. `test_style_legibility` checks their layout.
    """
    monkeypatch.setattr(
        "matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda _engine, _figure: None
    )

"""Figures that are not drawn: drawing takes nine tenths of the time to write a result folder."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import pytest

#: Content of the file of a figure.
EMPTY = b'<svg xmlns="http://www.w3.org/2000/svg"></svg>'


@contextmanager
def undrawn_figures() -> Iterator[None]:
    """Skip the layout of figures in this process and save empty pictures."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    def save(_canvas: FigureCanvasSVG, to: str | Path | IO[bytes], **_options: Any) -> None:
        if isinstance(to, str | Path):
            Path(to).write_bytes(EMPTY)
        else:
            to.write(EMPTY)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ConstrainedLayoutEngine, "execute", lambda _engine, _figure: None)
        patch.setattr(FigureCanvasSVG, "print_svg", save)
        yield

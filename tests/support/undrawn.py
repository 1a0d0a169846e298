"""Figures that are made and not drawn: nine tenths of the time of a result's folder goes into drawing."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import pytest

#: What stands in a figure's file.
EMPTY = b'<svg xmlns="http://www.w3.org/2000/svg"></svg>'


@contextmanager
def undrawn_figures() -> Iterator[None]:
    """Make figures in this process without laying them out; their files hold an empty picture."""
    from matplotlib.figure import Figure

    def save(_figure: Figure, to: str | Path | IO[bytes], **_asked: Any) -> None:
        if isinstance(to, str | Path):
            Path(to).write_bytes(EMPTY)
        else:
            to.write(EMPTY)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "draw_without_rendering", lambda _figure: None)
        patch.setattr(Figure, "savefig", save)
        yield

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
    from matplotlib.figure import Figure

    def save(_figure: Figure, to: str | Path | IO[bytes], **_options: Any) -> None:
        if isinstance(to, str | Path):
            Path(to).write_bytes(EMPTY)
        else:
            to.write(EMPTY)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "draw_without_rendering", lambda _figure: None)
        patch.setattr(Figure, "savefig", save)
        yield

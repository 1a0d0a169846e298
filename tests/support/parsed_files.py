"""How often text files are parsed."""

from pathlib import Path

import pytest

from islands.records.reading.reader import READERS
from islands.records.reading.table import Table


def list_parsed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list that receives the name of every CSV file that is parsed from now on."""
    parsed, parse = [], READERS[".csv"]

    def note(path: Path, *options: object) -> Table:
        parsed.append(path.name)
        return parse(path, *options)

    monkeypatch.setitem(READERS, ".csv", note)
    return parsed

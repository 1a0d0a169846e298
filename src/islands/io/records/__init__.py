"""Records to and from files: each format is a reader, listed in `READERS`."""

from islands.io.records.preview import ColumnPreview, Preview, preview
from islands.io.records.reader import READERS, columns_of, fingerprint, read_record
from islands.io.records.writer import write_record, write_simulation

__all__ = [
    "READERS",
    "ColumnPreview",
    "Preview",
    "columns_of",
    "fingerprint",
    "preview",
    "read_record",
    "write_record",
    "write_simulation",
]

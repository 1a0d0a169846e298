"""Records from and to files. Each format has one reader, listed in `READERS`. Read `reader` first."""

from islands.io.records.preview import ColumnPreview, Preview, preview
from islands.io.records.reader import READERS, fingerprint, read_columns, read_dataset, read_record
from islands.io.records.writer import write_record, write_simulation

__all__ = [
    "READERS",
    "ColumnPreview",
    "Preview",
    "fingerprint",
    "preview",
    "read_columns",
    "read_dataset",
    "read_record",
    "write_record",
    "write_simulation",
]

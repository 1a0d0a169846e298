"""Reading of records from files and frames. Each format has one reader, in `READERS`. Read `reader` first."""

from islands.records.reading.preview import ColumnPreview, Preview, preview
from islands.records.reading.reader import READERS, fingerprint, read_columns, read_dataset, read_record

__all__ = [
    "READERS",
    "ColumnPreview",
    "Preview",
    "fingerprint",
    "preview",
    "read_columns",
    "read_dataset",
    "read_record",
]

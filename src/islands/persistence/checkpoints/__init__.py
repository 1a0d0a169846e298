"""Checkpoints: an archipelago as a versioned file.

Expressions are stored as text, and floats are exact. Read `writing` first.
"""

from islands.persistence.checkpoints.reading import (
    archipelago_from_document,
    read_archipelago,
    read_checkpoint,
)
from islands.persistence.checkpoints.search_states import (
    history_document,
    history_from_document,
    state_document,
    state_from_document,
)
from islands.persistence.checkpoints.writing import (
    HALL_SCHEMA,
    SCHEMA,
    checkpoint_text,
    compress_text,
    compressed_checkpoint,
    write_checkpoint,
    write_hall,
)

__all__ = [
    "HALL_SCHEMA",
    "SCHEMA",
    "archipelago_from_document",
    "checkpoint_text",
    "compress_text",
    "compressed_checkpoint",
    "history_document",
    "history_from_document",
    "read_archipelago",
    "read_checkpoint",
    "state_document",
    "state_from_document",
    "write_checkpoint",
    "write_hall",
]

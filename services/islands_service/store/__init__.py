"""The store: owns the truth about jobs, data sets and keys, in SQLite or PostgreSQL through one code path."""

from islands_service.store.store import Store

__all__ = ["Store"]

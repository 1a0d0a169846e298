"""SQL store of jobs, data sets and keys, in SQLite or PostgreSQL, and blobs. Read `operations` first."""

from islands_service.store.operations import Store

__all__ = ["Store"]

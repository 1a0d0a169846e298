"""Errors of a Ray cluster, in a module that does not import Ray."""

from islands.errors import EngineError


class ClusterError(EngineError):
    """No usable Ray cluster. The message says what to do."""

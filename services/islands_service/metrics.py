"""Prometheus metrics of every process: version, memory, CPU time and open files."""

import platform
from importlib.metadata import version

from prometheus_client import CollectorRegistry, Info, ProcessCollector


def make_registry(role: str) -> CollectorRegistry:
    """Return a registry with the metrics of this process.

    Parameters
    ----------
    role : str
        ``api`` or ``coordinator``, a label of ``islands_build_info``.
    """
    registry = CollectorRegistry()
    ProcessCollector(registry=registry)
    build = Info("islands_build", "Version of islands and of Python.", registry=registry)
    build.info({"version": version("islands"), "python": platform.python_version(), "role": role})
    return registry

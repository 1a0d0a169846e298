"""Characters: islands that breed in different ways. A new one is an entry of ``ISLAND_PROFILES``.

A character may change how an island breeds and selects, never what an individual means or how it is judged:
fitness, constraints, tolerance and sizes are one for all, so that who migrates is worth the same anywhere.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

ISLAND_PROFILES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "plain": {},
        "explorer": {"mutation": 1.0, "outer": 0.9, "tournament": 2},
        "exploiter": {"outer": 0.1, "tournament": 6},
        "recombiner": {"crossover": 0.9, "high_level": 0.8},
        "pruner": {"prune": 0.8},
    }
)

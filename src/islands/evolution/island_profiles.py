"""Island profiles: settings of variation and selection that differ between islands.

A profile is an entry of ``ISLAND_PROFILES``. It must not change fitness, constraints, tolerance or sizes:
they are equal on all islands, so that the fitness of a migrant is comparable on every island.
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

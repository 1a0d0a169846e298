"""Table of the unusual causes and clean records by name."""

from collections.abc import Mapping
from types import MappingProxyType

from lab.diagnosis.injection.unusual.cause import UnusualCause
from lab.diagnosis.injection.unusual.clean_records import CLEAN_RECORDS
from lab.diagnosis.injection.unusual.machine_causes import MACHINE_CAUSES
from lab.diagnosis.injection.unusual.process_causes import PROCESS_CAUSES

#: Causes by name. To add one, add an entry to the table of its plant.
UNUSUAL_CAUSES: Mapping[str, UnusualCause] = MappingProxyType(
    {each.name: each for each in (*MACHINE_CAUSES, *PROCESS_CAUSES, *CLEAN_RECORDS)}
)

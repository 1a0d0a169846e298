"""Source of an FMU: how its description is read, and how it is loaded."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from islands.simulators.fmu.fmi_description import FmiDescription, read_description
from islands.simulators.fmu.instance import FmuLane, FmuRun, load_fmu


class LoadedFmu(Protocol):
    """FMU that simulates, in this process or in another one."""

    def simulate(self, lanes: Sequence[FmuLane], start_time: float, dt: float) -> list[FmuRun]:
        """Simulate the outputs of equations; see `islands.simulators.fmu.instance.FmuInstance.simulate`."""


@dataclass(frozen=True, slots=True)
class FmuSource:
    """Functions that describe and load FMUs.

    Attributes
    ----------
    describe : callable
        Takes the file and the interface, which may be empty, and returns the `FmiDescription`.
    load : callable
        Takes the description. Simulators that are sent to other processes contain it.
    """

    describe: Callable[[str, str], FmiDescription]
    load: Callable[[FmiDescription], LoadedFmu]


#: FMUs in files that this process reads and loads.
LOCAL_FMUS = FmuSource(read_description, load_fmu)

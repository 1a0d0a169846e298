"""Fork server of simulations: ``python -m islands_service.intake.simulation_server``.

The simulators and their kernels take seconds to import and to load, and a hundred megabytes, so that they are
not in the server of `fork_server`, whose processes read files. A process of an API starts this one with its
first preview, a coordinator with its first FMU.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress

import numpy as np

from islands.diagnosis.calibration.preview import preview_calibration
from islands.errors import SettingsError
from islands.records.dataset import Dataset
from islands.simulators.fmu.fmi_description import import_fmpy
from islands.simulators.fmu.warm_up import compile_kernels
from islands.simulators.specification.factory import make_simulator
from islands_service.intake import confined_fmu, simulation_preview
from islands_service.intake.fork_server import serve
from islands_service.settings import service_settings

#: Programs of the forked processes.
PROGRAMS: Mapping[str, Callable[[], None]] = {
    "confined_fmu": confined_fmu.main,
    "simulation_preview": simulation_preview.main,
}

#: Modules that the programs import when they run.
_PRELOADED = (
    "islands.records.reading",
    "islands.records.reading.options",
    "islands.records.reading.row_range",
)


def main() -> None:
    """Fork simulations until every client has ended."""
    serve(PROGRAMS, _PRELOADED, _load_kernels)


def _load_kernels() -> None:
    """Simulate a short record, so that the forked processes have the kernels of most simulations.

    The reader of FMUs starts processes when it is imported, which a confined process cannot.
    """
    with suppress(SettingsError):
        import_fmpy()
        if service_settings().allow_fmus:
            compile_kernels()
    u = np.sin(np.arange(300) ** 1.3 / 20.0)
    record = Dataset(u, np.convolve(u, [0.5, 0.3, 0.2])[:300], 0.1)
    for kind in ("linear:1", "second-order"):
        preview_calibration(record, make_simulator(kind, record))


if __name__ == "__main__":
    main()

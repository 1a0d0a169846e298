"""Fork server of simulations: ``python -m islands_service.intake.simulation_server``.

The simulators and their kernels take seconds to import and to load, and a hundred megabytes, so that they are
not in the server of `fork_server`, whose processes read files. A process of an API starts this one with its
first preview, a coordinator with its first FMU.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from islands.diagnosis.calibration.preview import preview_calibration
from islands.errors import SettingsError
from islands.records.dataset import Dataset
from islands.simulators.fmu.fmi_calls import FmiFunctions
from islands.simulators.fmu.fmi_description import FmiDescription, FmiInterface, FmiVariable, import_fmpy
from islands.simulators.fmu.instance import FmuLane, FmuRun, FmuSource, call_kernel
from islands.simulators.fmu.model import choose_variables
from islands.simulators.fmu.simulator import FmuSimulator
from islands.simulators.fmu.system import make_fmu_system
from islands.simulators.ode.sampled_signal import make_nominal_context
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

#: Status of every call, after which the kernels end.
_ERROR = 3


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


def compile_kernels() -> None:
    """Call the kernels of both interfaces, so that they are compiled and stored."""
    record = Dataset(np.zeros(2), np.zeros(2), 0.1)
    context = make_nominal_context(record)
    for interface in FmiInterface:
        description = _describe(interface)
        model = choose_variables(description)
        system = make_fmu_system(model)
        source = FmuSource(lambda *_: description, _FailingFmu)  # noqa: B023
        states = [name for name, _ in system.derivatives]
        sizes = dict.fromkeys([*states, *(f"d{name}/dt" for name in states)], 1.0)
        simulator = FmuSimulator(
            *(system, dict.fromkeys(states, 0.0), sizes, {}),
            is_continuous_time=True,
            model=model,
            source=source,
        )
        simulator.run_nominal(context, (system.output,))


@dataclass(frozen=True, slots=True)
class _FailingFmu:
    """FMU whose functions do nothing but return an error."""

    description: FmiDescription

    def simulate(self, lanes: Sequence[FmuLane], start_time: float, dt: float) -> list[FmuRun]:
        # The convention of C lets a function ignore its arguments.
        function = ctypes.CFUNCTYPE(ctypes.c_int)(lambda: _ERROR)
        address = ctypes.cast(function, ctypes.c_void_p).value or 0
        addresses = dict.fromkeys(FmiFunctions._fields, address) | {"version": self.description.version}
        functions = FmiFunctions(**addresses)
        found = (call_kernel(functions, self.description, lane, start_time, dt)[0] for lane in lanes)
        return [FmuRun(np.ascontiguousarray(y.T)) for y in found]


def _describe(interface: FmiInterface) -> FmiDescription:
    return FmiDescription(
        path="",
        digest="",
        version=3,
        interface=interface,
        inputs=(FmiVariable("u", 1),),
        outputs=(FmiVariable("y", 2),),
        parameters=(FmiVariable("p", 3, start=1.0),),
        states=(FmiVariable("x", 4),) if interface == FmiInterface.MODEL_EXCHANGE else (),
        settable=(),
        fixed_step=None,
        has_variable_step=True,
        indicators=0,
        completes=False,
    )


if __name__ == "__main__":
    main()

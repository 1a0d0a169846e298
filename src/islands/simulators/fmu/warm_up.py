"""Compilation of the kernels that simulate an FMU, without an FMU."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from islands.records.dataset import Dataset
from islands.simulators.fmu.fmi_calls import FmiFunctions
from islands.simulators.fmu.fmi_description import FmiDescription, FmiInterface, FmiVariable
from islands.simulators.fmu.instance import FmuLane, FmuRun, call_kernel
from islands.simulators.fmu.model import choose_variables
from islands.simulators.fmu.simulator import FmuSimulator
from islands.simulators.fmu.source import FmuSource
from islands.simulators.fmu.system import make_fmu_system
from islands.simulators.ode.record_channels import make_nominal_context

#: Status of every call, after which the kernels end.
_ERROR = 3


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

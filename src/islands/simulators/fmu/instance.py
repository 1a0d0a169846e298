"""Loaded FMU of this process: one instance, which is reset before every simulation."""

import ctypes
import hashlib
import io
import sys
import tempfile
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from islands.errors import ModelError
from islands.simulators.fmu.fmi_calls import TERMINATED, FmiFunctions
from islands.simulators.fmu.fmi_description import (
    FmiDescription,
    FmiInterface,
    import_fmpy,
    read_description,
    read_head,
)
from islands.simulators.fmu.fmi_kernel import FmuEquations, integrate, take_steps
from islands.simulators.ode.sampled_signal import SampledSignal

#: Largest number of FMUs that a process keeps loaded.
_LOADED = 8

#: Number of the last messages of an FMU that are kept.
_MESSAGES = 3

#: Status of a call after which an instance cannot be used again, and after which it must not even be freed.
_ERROR, _FATAL = 3, 4


class FmuLane(NamedTuple):
    """Values and signals of a simulation.

    Attributes
    ----------
    values : mapping
        Start values by value reference.
    signals : mapping
        Inputs by value reference; a co-simulation takes their values at the start and in the middle of each
        step.
    equations : FmuEquations
        A co-simulation has no states in them.
    """

    values: Mapping[int, float]
    signals: Mapping[int, SampledSignal]
    equations: FmuEquations

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of outputs and of samples."""
        return self.equations.instructions.outputs.size, len(next(iter(self.signals.values())).moments)


@dataclass(frozen=True, slots=True, eq=False)
class FmuRun:
    """Result of a simulation.

    Attributes
    ----------
    y : ndarray, shape (outputs, samples)
        NaN after a failure.
    failure : str
        Why the simulation ended early; empty if it did not.
    """

    y: NDArray[np.float64]
    failure: str = ""


class FmuInstance:
    """Instance of an FMU.

    It is freed, and its library unloaded, when it is no longer used or the process ends. The folder that the
    FMU is extracted to is deleted as soon as the library is loaded, or with the instance if the FMU has
    resources, which it may read later.

    Attributes
    ----------
    description : FmiDescription

    Raises
    ------
    ModelError
        The file is not the one that was described, its library cannot be loaded, or gives no instance.
    """

    def __init__(self, description: FmiDescription) -> None:
        self.description = description
        self._lock = threading.Lock()
        self._messages: list[str] = []
        self._resources = _Resources()
        self._finalizer = weakref.finalize(self, self._resources.release)
        self._is_fresh = False
        try:
            self._instantiate()
        except ModelError:
            raise
        except Exception as error:  # fmpy raises bare exceptions
            raise ModelError(self._describe(f"{description.path} cannot be loaded: {error}")) from error

    def simulate(self, lanes: Sequence[FmuLane], start_time: float, dt: float) -> list[FmuRun]:
        """Simulate the outputs of equations, each time from the start values of the FMU.

        Parameters
        ----------
        lanes : sequence of FmuLane
        start_time, dt : float
            Time of the first sample, and step, in seconds.

        Returns
        -------
        list of FmuRun
        """
        with self._lock:
            return [self._simulate(lane, start_time, dt) for lane in lanes]

    def _simulate(self, lane: FmuLane, start_time: float, dt: float) -> FmuRun:
        self._messages.clear()
        try:
            self._initialise(lane.values, lane.signals, start_time)
        except ModelError:
            raise
        except Exception as error:  # a status of the FMU that is not OK, or an instance that fails
            self._is_fresh = False
            self._recover(getattr(error, "status", 0))
            return FmuRun(np.full(lane.shape, np.nan), self._describe(str(error)))
        return self._run(lane, start_time, dt)

    def _instantiate(self) -> None:
        from fmpy.simulation import instantiate_fmu  # noqa: PLC0415 - only if an FMU is used

        self._resources.release()
        description = self.description
        folder = self._resources.extract(description)
        log = _make_log(self._messages)
        kind = "ModelExchange" if description.interface == FmiInterface.MODEL_EXCHANGE else "CoSimulation"
        self._fmu = instantiate_fmu(folder, _identify(folder), fmi_type=kind, logger=log)
        self._resources.fmu = self._fmu
        # Other systems keep a library without its file; then a process that is killed leaves no folder.
        if sys.platform != "win32" and not Path(folder, "resources").exists():
            self._resources.delete_folder()
        self._functions = _find_functions(self._fmu, description)
        self._is_fresh = True

    def _recover(self, status: int) -> None:
        """Replace the instance if it cannot be used after a status."""
        if status == _FATAL:
            self._resources.fmu = None
        if status in (_ERROR, _FATAL):
            self._instantiate()

    def _initialise(
        self, values: Mapping[int, float], signals: Mapping[int, SampledSignal], start_time: float
    ) -> None:
        """Bring the FMU to the first sample."""
        fmu = self._fmu
        if not self._is_fresh:
            try:
                fmu.reset()
            except Exception:  # a status: not every FMU can be reset, though each should
                self._instantiate()
                fmu = self._fmu
        self._is_fresh = False
        first = {reference: float(signal.start[0]) for reference, signal in signals.items()}
        if self.description.version == 2:
            fmu.setupExperiment(startTime=start_time)
            fmu.setReal(list(values), list(values.values()))
            fmu.enterInitializationMode()
            fmu.setReal(list(first), list(first.values()))
        else:
            fmu.setFloat64(list(values), list(values.values()))
            fmu.enterInitializationMode(startTime=start_time)
            fmu.setFloat64(list(first), list(first.values()))
        fmu.exitInitializationMode()

    def _run(self, lane: FmuLane, start_time: float, dt: float) -> FmuRun:
        y, done, status = call_kernel(self._functions, self.description, lane, start_time, dt)
        failure = ""
        if done < len(y):
            reason = "it ends the simulation" if status == TERMINATED else f"it fails with status {status}"
            failure = self._describe(f"{reason} after {start_time + done * dt:g} s")
        y[done:] = np.nan
        self._recover(status)
        return FmuRun(np.ascontiguousarray(y.T), failure)

    def _describe(self, failure: str) -> str:
        return ": ".join([failure, *self._messages[-_MESSAGES:]])


def call_kernel(
    functions: FmiFunctions,
    description: FmiDescription,
    lane: FmuLane,
    start_time: float,
    dt: float,
) -> tuple[NDArray[np.float64], int, int]:
    """Simulate an initialised FMU; see `FmuInstance.simulate`.

    Returns
    -------
    y : ndarray, shape (samples, outputs)
    done : int
        Number of computed samples.
    status : int
        That of the last call.
    """
    _, signals, equations = lane
    inputs = np.array(list(signals), dtype=np.uint32)
    moments = np.stack([signal.moments for signal in signals.values()])
    start, middle, end = (np.ascontiguousarray(each.T) for each in moments.transpose(2, 0, 1))
    y = np.full((len(start), equations.instructions.outputs.size), np.nan)
    if description.interface == FmiInterface.MODEL_EXCHANGE:
        done, status = integrate(
            *(functions, equations, start_time, dt, start, middle, end, inputs),
            *(len(description.states), description.indicators, description.completes, y),
        )
    else:
        done, status = take_steps(functions, equations, start_time, dt, start, middle, inputs, y)
    return y, done, status


class _Resources:
    """Folder and instance of an FMU, which outlive the object that uses them until it is finalised."""

    def __init__(self) -> None:
        self.folder: tempfile.TemporaryDirectory[str] | None = None
        self.fmu: Any = None

    def extract(self, description: FmiDescription) -> str:
        """Extract the FMU that was described to a new folder; return its path, or that of its folder."""
        if Path(description.path).is_dir():
            return description.path
        content = Path(description.path).read_bytes()
        if hashlib.sha256(content).hexdigest() != description.digest:
            raise ModelError(
                f"{description.path} has changed since it was first read: start again, or restore the file"
            )
        self.folder = tempfile.TemporaryDirectory(prefix="islands-fmu-", ignore_cleanup_errors=True)
        import_fmpy().extract(io.BytesIO(content), unzipdir=self.folder.name)
        return self.folder.name

    def delete_folder(self) -> None:
        if self.folder is not None:
            self.folder.cleanup()
            self.folder = None

    def release(self) -> None:
        if self.fmu is not None:
            self.fmu.freeInstance()
            self.fmu = None
        self.delete_folder()


def load_fmu(description: FmiDescription) -> FmuInstance:
    """Return the instance of an FMU in this process.

    Raises
    ------
    ModelError
        The file is not the one that was described, or cannot be loaded.
    """
    return _load(description.path, description.digest, description.interface)


@lru_cache(maxsize=_LOADED)
def _load(path: str, digest: str, interface: FmiInterface) -> FmuInstance:
    return FmuInstance(replace(read_description(path, interface), digest=digest))


def _identify(folder: str) -> Any:
    """Return the part of a model description that fmpy needs to make an instance."""
    from fmpy import model_description  # noqa: PLC0415 - only if an FMU is used

    head = read_head(folder)
    found = model_description.ModelDescription()
    found.fmiVersion, found.guid = head.version, head.token
    if given := head.interfaces.get("ModelExchange"):
        found.modelExchange = model_description.ModelExchange(modelIdentifier=given["modelIdentifier"])
    if given := head.interfaces.get("CoSimulation"):
        found.coSimulation = model_description.CoSimulation(modelIdentifier=given["modelIdentifier"])
    return found


def _make_log(messages: list[str]) -> Callable[..., None]:
    """Return a callback for the messages of an FMU; the message is its last argument in FMI 2.0 and 3.0."""

    def log(*arguments: Any) -> None:
        messages.append(bytes(arguments[-1] or b"").decode("utf-8", "replace").strip())

    return log


def _find_functions(fmu: Any, description: FmiDescription) -> FmiFunctions:
    """Return the machine addresses of the functions that a simulation calls."""

    def find(name2: str, name3: str = "") -> int:
        name = f"fmi2{name2}" if description.version == 2 else f"fmi3{name3 or name2}"
        return ctypes.cast(getattr(fmu.dll, name), ctypes.c_void_p).value or 0

    component = fmu.component
    common = {
        "instance": int(getattr(component, "value", component)),
        "version": description.version,
        "get_values": find("GetReal", "GetFloat64"),
        "set_values": find("SetReal", "SetFloat64"),
    }
    if description.interface == FmiInterface.CO_SIMULATION:
        none = dict.fromkeys(FmiFunctions._fields, 0)
        return FmiFunctions(**{**none, **common, "do_step": find("DoStep")})
    return FmiFunctions(
        **common,
        do_step=0,
        set_time=find("SetTime"),
        get_states=find("GetContinuousStates"),
        set_states=find("SetContinuousStates"),
        get_derivatives=find("GetDerivatives", "GetContinuousStateDerivatives"),
        get_indicators=find("GetEventIndicators"),
        complete_step=find("CompletedIntegratorStep"),
        enter_events=find("EnterEventMode"),
        update_discrete_states=find("NewDiscreteStates", "UpdateDiscreteStates"),
        enter_continuous_time=find("EnterContinuousTimeMode"),
    )


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

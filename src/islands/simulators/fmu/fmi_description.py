"""Model description of an FMU for a simulation: its variables of type real, and one of its interfaces."""

import hashlib
import zipfile
from dataclasses import dataclass
from enum import StrEnum
from math import inf
from pathlib import Path
from typing import Any

from islands.distribution import describe_missing_extra
from islands.errors import ModelError, SettingsError
from islands.simulators.fmu.model_description import Attributes, ModelDescription, read_model_description


class FmiInterface(StrEnum):
    """Interface of FMI that a simulation uses."""

    #: The FMU gives derivatives, and the states are integrated here.
    MODEL_EXCHANGE = "model-exchange"
    #: The FMU contains a solver, which takes communication steps.
    CO_SIMULATION = "co-simulation"


#: Elements of a model description with the interfaces, in the order of preference.
_ELEMENTS = {FmiInterface.MODEL_EXCHANGE: "ModelExchange", FmiInterface.CO_SIMULATION: "CoSimulation"}


@dataclass(frozen=True, slots=True)
class FmiVariable:
    """Scalar variable of type real.

    Attributes
    ----------
    name : str
    reference : int
        Value reference.
    unit : str
        Empty if the description has none.
    start : float or None
    lower, upper : float
        Least and largest value.
    """

    name: str
    reference: int
    unit: str = ""
    start: float | None = None
    lower: float = -inf
    upper: float = inf


@dataclass(frozen=True, slots=True)
class FmiDescription:
    """What a simulation needs of ``modelDescription.xml``, for one of its interfaces.

    Attributes
    ----------
    path : str
    digest : str
        SHA-256 of the file.
    version : int
        2 or 3.
    interface : FmiInterface
    inputs, outputs : tuple of FmiVariable
    parameters : tuple of FmiVariable
        Parameters that are fixed or tunable and have a start value.
    states : tuple of FmiVariable
        Continuous states in the order of the derivatives.
    settable : tuple of str
        Names of the states whose start values can be set before a simulation.
    fixed_step : float or None
        Step of a co-simulation, of which a communication step must be a multiple.
    has_variable_step : bool
        Whether communication steps may differ.
    indicators : int
        Number of event indicators.
    completes : bool
        Whether the FMU is notified of completed steps of an integrator.
    """

    path: str
    digest: str
    version: int
    interface: FmiInterface
    inputs: tuple[FmiVariable, ...]
    outputs: tuple[FmiVariable, ...]
    parameters: tuple[FmiVariable, ...]
    states: tuple[FmiVariable, ...]
    settable: tuple[str, ...]
    fixed_step: float | None
    has_variable_step: bool
    indicators: int
    completes: bool

    @property
    def name(self) -> str:
        """Name of the file."""
        return Path(self.path).name


def import_fmpy() -> Any:
    """Return the library that reads and loads FMUs.

    Raises
    ------
    SettingsError
        It is not installed.
    """
    try:
        import fmpy  # noqa: PLC0415 - takes 0.3 s
    except ImportError as error:
        raise SettingsError(describe_missing_extra("the simulation of an FMU", "fmi")) from error
    return fmpy


def read_description(path: str, interface: str = "", most: int | None = None) -> FmiDescription:
    """Read the description of an FMU and check that it can be simulated on this machine.

    Parameters
    ----------
    interface : str
        An `FmiInterface`; by default model exchange if the FMU offers it, otherwise co-simulation.
    most : int, optional
        Largest number of variables, see `islands.simulators.fmu.model_description.read_model_description`.

    Raises
    ------
    ModelError
        The file is not an FMU, is of another version than FMI 2.0 and 3.0, has no library for this machine,
        or has too many variables.
    SettingsError
        The FMU does not offer the interface, or fmpy is not installed.
    """
    fmpy = import_fmpy()
    try:
        # Not validated: many tools write descriptions that violate a rule but can be simulated.
        found = read_model_description(path, most)
        version = int(found.version.partition(".")[0])
        variables = [(each["causality"], _make_variable(each)) for each in found.variables]
        states = [None if each is None else _make_variable(each) for each in found.states]
        with Path(path).open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            files = zipfile.ZipFile(stream).namelist()
    except ModelError:
        raise
    except Exception as error:  # those of the parser, of the archive and of numbers that are none
        raise ModelError(f"{path} cannot be read as an FMU ({error}): write fmu:FILE.fmu") from error
    if version not in (2, 3):
        raise ModelError(f"{path} is of FMI {found.version}: export it for FMI 2.0 or 3.0")
    chosen = _choose_interface(path, found, interface)
    offered = found.interfaces[_ELEMENTS[chosen]]
    _check_platform(path, files, fmpy.platform_tuple if version == 3 else fmpy.platform)
    if chosen == FmiInterface.MODEL_EXCHANGE and None in states:
        raise ModelError(f"{path} has states that are not scalars of type real: export them as scalars")
    fixed_step = offered.get("fixedInternalStepSize") if version == 3 else None

    def choose(causality: str) -> tuple[FmiVariable, ...]:
        return tuple(variable for kind, variable in variables if kind == causality)

    return FmiDescription(
        path,
        digest,
        version,
        chosen,
        inputs=choose("input"),
        outputs=choose("output"),
        parameters=tuple(each for each in choose("parameter") if each.start is not None),
        states=tuple(each for each in states if each is not None),
        settable=tuple(each["name"] for each in found.states if each is not None and _is_settable(each)),
        fixed_step=None if fixed_step is None else float(fixed_step),
        has_variable_step=_is_true(offered, "canHandleVariableCommunicationStepSize"),
        indicators=found.indicators,
        completes=(
            not _is_true(offered, "completedIntegratorStepNotNeeded")
            if version == 2
            else _is_true(offered, "needsCompletedIntegratorStep")
        )
        and chosen == FmiInterface.MODEL_EXCHANGE,
    )


def _choose_interface(path: str, found: ModelDescription, interface: str) -> FmiInterface:
    offered = [each for each, element in _ELEMENTS.items() if element in found.interfaces]
    if not offered:
        raise ModelError(f"{path} offers neither co-simulation nor model exchange: export it for one of them")
    if interface and interface not in offered:
        raise SettingsError(f"{path} offers {offered[0]} only, not {interface}: leave the interface out")
    return FmiInterface(interface) if interface else offered[0]


def _check_platform(path: str, files: list[str], platform: str) -> None:
    libraries = [name.split("/") for name in files if name.startswith("binaries/")]
    found = sorted({parts[1] for parts in libraries if len(parts) > 2 and parts[-1]})
    if platform not in found:
        has_sources = any(name.startswith("sources/") and name.endswith(".c") for name in files)
        remedy = f"run 'fmpy compile {path}'" if has_sources else "export it for this platform"
        raise ModelError(
            f"{path} has no library for {platform} (it has {', '.join(found) or 'none'}): {remedy}"
        )


def _make_variable(given: Attributes) -> FmiVariable:
    start, lower, upper = (
        float(given[name]) if given.get(name) else None for name in ("start", "min", "max")
    )
    return FmiVariable(
        given["name"],
        int(given["valueReference"]),
        given.get("unit", ""),
        start,
        -inf if lower is None else lower,
        inf if upper is None else upper,
    )


def _is_settable(state: Attributes) -> bool:
    """Return whether a start value of a state can be set before a simulation."""
    default = "exact" if state.get("causality") == "input" else "calculated"
    return state.get("initial", default) == "exact" and bool(state.get("start"))


def _is_true(given: Attributes, name: str) -> bool:
    return given.get(name) in ("true", "1")

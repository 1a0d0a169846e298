"""Model description of an FMU: its variables of type real, and its interfaces, read by fmpy."""

import hashlib
import zipfile
from dataclasses import dataclass
from enum import StrEnum
from math import inf
from pathlib import Path
from typing import Any

from islands.distribution import describe_missing_extra
from islands.errors import ModelError, SettingsError


class FmiInterface(StrEnum):
    """Interface of FMI that a simulation uses."""

    #: The FMU gives derivatives, and the states are integrated here.
    MODEL_EXCHANGE = "model-exchange"
    #: The FMU contains a solver, which takes communication steps.
    CO_SIMULATION = "co-simulation"


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


def read_description(path: str, interface: str = "") -> FmiDescription:
    """Read the description of an FMU and check that it can be simulated on this machine.

    Parameters
    ----------
    interface : str
        An `FmiInterface`; by default model exchange if the FMU offers it, otherwise co-simulation.

    Raises
    ------
    ModelError
        The file is not an FMU, is of FMI 1.0, or has no library for this machine.
    SettingsError
        The FMU does not offer the interface, or fmpy is not installed.
    """
    fmpy = import_fmpy()
    try:
        content = Path(path).read_bytes()
        # Not validated: many tools write descriptions that violate a rule but can be simulated.
        found = fmpy.read_model_description(path, validate=False)
        with zipfile.ZipFile(path) as archive:
            files = archive.namelist()
    except Exception as error:  # fmpy raises the exceptions of its XML parser and bare ones
        raise ModelError(f"{path} cannot be read as an FMU ({error}): write fmu:FILE.fmu") from error
    version = int(str(found.fmiVersion).partition(".")[0])
    if version < 2:
        raise ModelError(f"{path} is of FMI {found.fmiVersion}: export it for FMI 2.0 or 3.0")
    chosen = _choose_interface(path, found, interface)
    offered = found.modelExchange if chosen == FmiInterface.MODEL_EXCHANGE else found.coSimulation
    _check_platform(path, files, fmpy.platform_tuple if version == 3 else fmpy.platform)
    states = [unknown.variable.derivative for unknown in found.derivatives]
    if chosen == FmiInterface.MODEL_EXCHANGE and None in map(_make_variable, states):
        raise ModelError(f"{path} has states that are not scalars of type real: export them as scalars")
    real = [(each, variable) for each in found.modelVariables if (variable := _make_variable(each))]
    fixed_step = getattr(offered, "fixedInternalStepSize", None)
    return FmiDescription(
        path,
        hashlib.sha256(content).hexdigest(),
        version,
        chosen,
        inputs=tuple(variable for each, variable in real if each.causality == "input"),
        outputs=tuple(variable for each, variable in real if each.causality == "output"),
        parameters=tuple(
            variable
            for each, variable in real
            if each.causality == "parameter" and variable.start is not None
        ),
        states=tuple(variable for each in states if (variable := _make_variable(each))),
        settable=tuple(
            each.name for each in states if each is not None and each.initial == "exact" and each.start
        ),
        fixed_step=None if fixed_step is None else float(fixed_step),
        has_variable_step=bool(getattr(offered, "canHandleVariableCommunicationStepSize", False)),
        indicators=int(found.numberOfEventIndicators),
        completes=bool(getattr(offered, "needsCompletedIntegratorStep", False)),
    )


def _choose_interface(path: str, found: Any, interface: str) -> FmiInterface:
    offered = [
        each
        for each, given in (
            (FmiInterface.MODEL_EXCHANGE, found.modelExchange),
            (FmiInterface.CO_SIMULATION, found.coSimulation),
        )
        if given is not None
    ]
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


def _make_variable(given: Any) -> FmiVariable | None:
    """Return a variable; None if it is not a scalar number of type real."""
    if given is None or given.type not in ("Real", "Float64") or given.dimensions:
        return None
    kind = given.declaredType
    start, lower, upper = (
        _parse(getattr(given, field) or getattr(kind, field, None)) for field in ("start", "min", "max")
    )
    return FmiVariable(
        given.name,
        given.valueReference,
        given.unit or getattr(kind, "unit", None) or "",
        start,
        -inf if lower is None else lower,
        inf if upper is None else upper,
    )


def _parse(text: str | None) -> float | None:
    return None if text is None else float(text)

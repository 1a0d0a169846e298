"""Model description of an FMU for a simulation: its variables of type real, and one of its interfaces."""

import hashlib
import zipfile
from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf, prod
from pathlib import Path
from typing import IO, Any
from xml.parsers.expat import ParserCreate

from islands.distribution import describe_missing_extra
from islands.errors import ModelError, SettingsError

#: Name of the file in an FMU.
DESCRIPTION = "modelDescription.xml"

#: Causalities of the variables of the interface.
_INTERFACE = frozenset(("input", "output", "parameter"))

#: Type of a variable of type real, in FMI 2.0 and 3.0.
_REAL = frozenset(("Real", "Float64"))

#: Number of bytes that are parsed at once.
_CHUNK_BYTES = 1 << 16

#: Attributes of an element of XML.
Attributes = Mapping[str, str]


@dataclass(slots=True)
class ModelDescription:
    """What a model description says about variables of type real.

    Attributes
    ----------
    root : mapping
        Attributes of the root element.
    interfaces : mapping
        Attributes of ``ModelExchange`` and ``CoSimulation``, as far as they exist.
    variables : list of mapping
        Attributes of scalar inputs, outputs and parameters, with those of their declared types.
    states : list of mapping or None
        Attributes of the continuous states; None for one that is no scalar of type real.
    indicators : int
        Number of event indicators.
    """

    root: Attributes = field(default_factory=dict)
    interfaces: dict[str, Attributes] = field(default_factory=dict)
    variables: list[Attributes] = field(default_factory=list)
    states: list[Attributes | None] = field(default_factory=list)
    indicators: int = 0

    @property
    def version(self) -> str:
        """Version of FMI."""
        return self.root["fmiVersion"]

    @property
    def token(self) -> str:
        """Text that identifies the model to its library."""
        return self.root["guid" if self.version.startswith("2.") else "instantiationToken"]


def read_model_description(path: str, most: int | None = None) -> ModelDescription:
    """Read the description of an FMU.

    Parameters
    ----------
    path : str
        File, or folder that it is extracted to.
    most : int, optional
        Largest number of variables of type real that are inputs, outputs, parameters or states.

    Raises
    ------
    ModelError
        There are more.
    KeyError, ValueError, OSError, zipfile.BadZipFile, xml.parsers.expat.ExpatError
        The description is invalid, or cannot be read.
    """

    def check(count: int) -> None:
        if most is not None and count > most:
            raise ModelError(
                f"{path} has more than {most} variables of type real that are inputs, outputs, parameters or "
                "states, the most of this service: export it with fewer parameters"
            )

    read = _parse(path, _INTERFACE, (), check)
    description = ModelDescription(read.root, read.interfaces, [*read.kept.values(), *read.aliases])
    if read.derivatives:
        check(len(description.variables) + len(read.derivatives))
        states = [read.pointers.get(pointer) for pointer in read.derivatives]
        kept = _parse(path, (), frozenset(filter(None, states)), check).kept
        description.states = [None if state is None else kept.get(state) for state in states]
    description.indicators = read.count_indicators()
    return description


def read_head(path: str) -> ModelDescription:
    """Read the description of an FMU as far as its variables; see `read_model_description`."""
    found = _parse(path, (), (), lambda _: None, until="ModelVariables")
    return ModelDescription(found.root, found.interfaces)


class _Reader:
    """Handlers of the parser.

    Parameters
    ----------
    causalities : container of str
        Causalities of the variables that are kept.
    places : container of str
        Places of further variables that are kept: in FMI 2.0 an index, in FMI 3.0 a value reference.
    check : callable
        Called with the number of variables of the interface that are kept.
    """

    def __init__(
        self, causalities: Container[str], places: Container[str], check: Callable[[int], None]
    ) -> None:
        self._causalities, self._places, self._check = causalities, places, check
        self.root: Attributes = {}
        self.interfaces: dict[str, Attributes] = {}
        #: Variables by their places, and their aliases.
        self.kept: dict[str, Attributes] = {}
        self.aliases: list[Attributes] = []
        #: Places of the derivatives of the states, and places of what a derivative belongs to.
        self.derivatives: list[str] = []
        self.pointers: dict[str, str] = {}
        #: Element below the root that is being read, or was read last.
        self.section = "root"
        self._indicators: list[str] = []
        #: Lengths of arrays by value reference, and values that may be lengths.
        self._dimensions: dict[str, list[Attributes]] = {}
        self._lengths: dict[str, str] = {}
        self._types: dict[str, Attributes] = {"": {}}
        self._depth = self._count = 0
        self._part = ""
        #: Attributes of the open variable or type.
        self._open: dict[str, str] = {}
        self._is_real = False
        self._other_names: list[str] = []

    def start(self, tag: str, given: dict[str, str]) -> None:
        """Handle the start of an element."""
        depth = self._depth
        self._depth += 1
        if depth == 0:
            self.root = given
        elif depth == 1:
            self.section = tag
            if tag in ("ModelExchange", "CoSimulation"):
                self.interfaces[tag] = given
        elif depth == 2:
            self._part, self._open, self._is_real, self._other_names = tag, given, tag in _REAL, []
            if self.section == "ModelVariables":
                self._count += 1
            elif self.section == "ModelStructure":
                self._add_unknown(tag, given.get("valueReference"))
            elif self.section == "TypeDefinitions" and tag == "Float64Type":
                self._types[given["name"]] = given
        elif depth == 3:
            self._add_part(tag, given)

    def end(self, tag: str) -> None:  # noqa: ARG002 - the parser gives it
        """Handle the end of an element."""
        self._depth -= 1
        if self._depth == 2 and self.section == "ModelVariables":
            self._close_variable()

    def count_indicators(self) -> int:
        """Return the number of event indicators, of which an array in FMI 3.0 has several."""

        def measure(given: Attributes) -> int:
            return int(given["start"] if "start" in given else self._lengths[given["valueReference"]])

        arrays = (self._dimensions.get(each, []) for each in self._indicators)
        return int(self.root.get("numberOfEventIndicators", 0)) + sum(prod(map(measure, a)) for a in arrays)

    def _add_part(self, tag: str, given: dict[str, str]) -> None:
        """Handle an element of a variable, of a type or of the structure."""
        if self.section == "ModelVariables":
            if self._part == "ScalarVariable" and tag in _REAL:
                self._open = {**given, **self._open}
                self._is_real = True
            elif tag == "Dimension":
                self._dimensions.setdefault(self._open["valueReference"], []).append(given)
            elif tag == "Alias":
                self._other_names.append(given["name"])
        elif self.section == "ModelStructure" and self._part == "Derivatives":
            self._add_unknown("Derivatives", given["index"])
        elif self.section == "TypeDefinitions" and self._part == "SimpleType":
            self._types[self._open["name"]] = given

    def _add_unknown(self, kind: str, place: str | None) -> None:
        if place is None:
            return
        if kind in ("Derivatives", "ContinuousStateDerivative"):
            self.derivatives.append(place)
        elif kind == "EventIndicator":
            self._indicators.append(place)

    def _close_variable(self) -> None:
        given = self._open
        reference = given.get("valueReference", "")
        if given.get("causality") == "structuralParameter":
            self._lengths[reference] = given.get("start", "")
        place = str(self._count) if self._part == "ScalarVariable" else reference
        if "derivative" in given:
            self.pointers[place] = given["derivative"]
        if reference in self._dimensions:
            return
        if self._is_real and (given.get("causality") in self._causalities or place in self._places):
            declared = self._types[given.get("declaredType", "")]
            whole = {**{name: declared[name] for name in ("unit", "min", "max") if name in declared}, **given}
            self.kept[place] = whole
            self.aliases += [{**whole, "name": name} for name in self._other_names]
            self._check(len(self.kept) + len(self.aliases))


def _parse(
    path: str,
    causalities: Container[str],
    places: Container[str],
    check: Callable[[int], None],
    until: str = "",
) -> _Reader:
    reader, parser = _Reader(causalities, places, check), ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = reader.start, reader.end
    with _open_description(path) as stream:
        while chunk := stream.read(_CHUNK_BYTES):
            parser.Parse(chunk)
            if reader.section == until:
                return reader
        parser.Parse(b"", True)
    return reader


@contextmanager
def _open_description(path: str) -> Iterator[IO[bytes]]:
    if Path(path).is_dir():
        with Path(path, DESCRIPTION).open("rb") as stream:
            yield stream
    else:
        with zipfile.ZipFile(path) as archive, archive.open(DESCRIPTION) as stream:
            yield stream


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
        Largest number of variables, see `islands.simulators.fmu.fmi_description.read_model_description`.

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
        read = read_model_description(path, most)
        version = int(read.version.partition(".")[0])
        variables = [(variable["causality"], _make_variable(variable)) for variable in read.variables]
        states = [None if state is None else _make_variable(state) for state in read.states]
        with Path(path).open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
            files = zipfile.ZipFile(stream).namelist()
    except ModelError:
        raise
    except Exception as error:  # those of the parser, of the archive and of numbers that are none
        raise ModelError(f"{path} cannot be read as an FMU ({error}): write fmu:FILE.fmu") from error
    if version not in (2, 3):
        raise ModelError(f"{path} is of FMI {read.version}: export it for FMI 2.0 or 3.0")
    chosen = _choose_interface(path, read, interface)
    offered = read.interfaces[_ELEMENTS[chosen]]
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
        states=tuple(state for state in states if state is not None),
        settable=tuple(state["name"] for state in read.states if state is not None and _is_settable(state)),
        fixed_step=None if fixed_step is None else float(fixed_step),
        has_variable_step=_is_true(offered, "canHandleVariableCommunicationStepSize"),
        indicators=read.indicators,
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

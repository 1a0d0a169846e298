"""Incremental reader of ``modelDescription.xml`` of FMI 2.0 and 3.0.

A description can have a hundred thousand local variables, of which a simulation uses the states alone. It is
read twice as a stream: the first time the variables of the interface and the places of the states, then the
states. Nothing else is kept, so that memory is bounded by what is used, and a limit ends the reading.
"""

import zipfile
from collections.abc import Callable, Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import IO
from xml.parsers.expat import ParserCreate

from islands.errors import ModelError

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

    found = _parse(path, _INTERFACE, (), check)
    description = ModelDescription(found.root, found.interfaces, [*found.kept.values(), *found.aliases])
    if found.derivatives:
        check(len(description.variables) + len(found.derivatives))
        states = [found.pointers.get(each) for each in found.derivatives]
        kept = _parse(path, (), frozenset(filter(None, states)), check).kept
        description.states = [None if each is None else kept.get(each) for each in states]
    description.indicators = found.count_indicators()
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

"""Uploaded FMUs: the description that is stored with one, and the simulation of a job that names one."""

from collections.abc import Mapping
from dataclasses import asdict
from math import inf, isinf
from typing import Annotated, Any

from pydantic import Field

from islands.errors import SettingsError
from islands.simulators.fmu.fmi_description import FmiDescription, FmiInterface, FmiVariable
from islands.simulators.specification.code import FmuSpec

#: Suffix of the id of an FMU; those of data sets have another one.
FMU_SUFFIX = ".fmu"

#: Fields of `FmiDescription` with variables.
VARIABLES = ("inputs", "outputs", "parameters", "states")

FmuId = Annotated[
    str, Field(pattern=r"^[0-9a-f]{32}-fmu$", examples=["9f86d081884c7d659a2feaa0c55ad015-fmu"])
]


class UploadedFmuSpec(FmuSpec):
    """Functional Mock-up Unit that was uploaded."""

    file: FmuId = Field(description="The FMU: the `id` of an uploaded one.")


def describe_fmu(description: FmiDescription) -> dict[str, Any]:
    """Return a description as JSON; a bound that is infinite is null."""
    document = asdict(description)
    for kind in VARIABLES:
        for variable in document[kind]:
            variable |= {end: None if isinf(variable[end]) else variable[end] for end in ("lower", "upper")}
    return document


def read_fmu(document: Mapping[str, Any], path: str) -> FmiDescription:
    """Return the description in a document, of the FMU at a path."""
    variables = {kind: tuple(map(_read_variable, document[kind])) for kind in VARIABLES}
    given = {**document, **variables, "path": path, "settable": tuple(document["settable"])}
    return FmiDescription(**{**given, "interface": FmiInterface(document["interface"])})


def _read_variable(document: Mapping[str, Any]) -> FmiVariable:
    lower, upper = document["lower"], document["upper"]
    ends = {"lower": -inf if lower is None else lower, "upper": inf if upper is None else upper}
    return FmiVariable(**{**document, **ends})


def check_interface(description: FmiDescription, interface: str) -> FmiDescription:
    """Return the description of an uploaded FMU, which is read for one interface.

    Raises
    ------
    SettingsError
        Another interface is asked for.
    """
    if interface not in ("", description.interface):
        raise SettingsError(
            f"a service simulates {description.name} by {description.interface}: leave the interface out"
        )
    return description

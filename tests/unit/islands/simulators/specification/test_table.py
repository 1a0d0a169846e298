"""Table of simulators: the unions of specifications, the factories and the text forms agree with it."""

from inspect import signature
from pkgutil import resolve_name
from typing import get_args

import pytest
from pydantic import TypeAdapter, ValidationError

from islands.errors import SettingsError
from islands.simulators.specification.base import SimulatorEntry
from islands.simulators.specification.table import (
    SIMULATORS,
    ExtendedSpec,
    LocalSpec,
    PhysicalSpec,
    SimulationSpec,
    parse_spec,
)
from support.simulated_records import extension, made


@pytest.fixture(params=SIMULATORS)
def entry(request: pytest.FixtureRequest) -> SimulatorEntry:
    return SIMULATORS[request.param]


def members(annotated: object) -> set[type]:
    union, _ = get_args(annotated)
    return set(get_args(union))


def test_the_remote_union_has_the_remote_models_of_the_table() -> None:
    remote = {entry.spec for entry in SIMULATORS.values() if entry.is_remote}
    assert members(SimulationSpec) == remote | {ExtendedSpec}


def test_a_factory_can_be_imported_and_takes_three_arguments(entry: SimulatorEntry) -> None:
    assert len(signature(resolve_name(entry.factory)).parameters) == 3


@pytest.mark.parametrize(
    "code", [{"kind": "fmu", "file": "a.fmu"}, {"kind": "python", "path": "a.py", "function": "f"}]
)
def test_code_is_refused_over_rest_alone_and_within_an_extended_simulation(code: dict[str, str]) -> None:
    assert TypeAdapter(LocalSpec).validate_python(code).kind == code["kind"]
    spring = made()["second-order"].spec
    extended = {**extension(spring), "kind": "extended"}
    assert TypeAdapter(SimulationSpec).validate_python(extended)
    for given in (code, {**extended, "core": code}):
        with pytest.raises(ValidationError, match="union_tag_invalid"):
            TypeAdapter(SimulationSpec).validate_python(given)


def test_a_kind_outside_the_table_is_refused() -> None:
    with pytest.raises(ValidationError, match="literal_error"):
        PhysicalSpec(kind="pendulum")
    with pytest.raises(ValidationError, match="union_tag_invalid"):
        TypeAdapter(SimulationSpec).validate_python({"kind": "pendulum"})
    with pytest.raises(SettingsError, match="unknown simulation 'pendulum': take one of bouc-wen-piezo"):
        parse_spec("pendulum")

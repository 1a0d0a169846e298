"""Specification of an FMU: its text forms, and its form in `extended.json`."""

from pathlib import Path

import pytest

from islands.errors import SettingsError
from islands.export.fmu import find_compiler
from islands.simulators.fmu.system import make_fmu_system
from islands.simulators.specification.code import FmuParameterSpec, FmuSpec
from islands.simulators.specification.table import parse_spec
from support.simulated_records import write_fmu


def test_names_and_values_follow_the_file() -> None:
    names = "input=u&output=x&channels=w,T&parameters=m,c=4.5,K[1,2]=-1e3&initial="
    assert parse_spec(f"fmu:axis.fmu?{names}&interface=co-simulation") == FmuSpec(
        kind="fmu",
        file="axis.fmu",
        interface="co-simulation",
        input="u",
        output="x",
        channels=("w", "T"),
        parameters={
            "m": FmuParameterSpec(),
            "c": FmuParameterSpec(value=4.5),
            "K[1,2]": FmuParameterSpec(value=-1e3),
        },
        initial=(),
    )


def test_a_file_of_options_names_an_fmu_relative_to_it(tmp_path: Path) -> None:
    path = tmp_path / "axis.toml"
    path.write_text(
        'file = "axis.fmu"\nsteps = 4\n[parameters]\nm = 1.2\nc = { tolerance = 0.1, upper = 9 }\n'
    )
    assert parse_spec(f"fmu:{path}") == FmuSpec(
        kind="fmu",
        file=str(tmp_path / "axis.fmu"),
        steps=4,
        parameters={"m": FmuParameterSpec(value=1.2), "c": FmuParameterSpec(tolerance=0.1, upper=9.0)},
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("fmu:axis.fmu?input", r"input: write OPTION=VALUE&OPTION=VALUE behind axis.fmu\?"),
        ("fmu:axis.fmu?colour=red", "colour: Extra inputs are not permitted"),
        ("fmu:axis.fmu?parameters=m=heavy", "parameters.m.value: Input should be a valid number"),
        ("fmu:axis.fmu?interface=fast", "interface: Input should be"),
        ("fmu:absent.toml", "absent.toml cannot be read as TOML .*: write fmu:FILE.toml"),
        ("fmu:", "file: String should have at least 1 character"),
    ],
)
def test_an_invalid_text_is_refused(text: str, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        parse_spec(text)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc")
def test_a_specification_with_all_names_has_the_same_variables() -> None:
    model = FmuSpec(kind="fmu", file=write_fmu()).make_model()
    spec = FmuSpec.from_system(model, make_fmu_system(model))
    assert (spec.input, spec.output, spec.initial) == ("u", "x", ("x", "v"))
    assert FmuSpec.model_validate_json(spec.model_dump_json()).make_model() == model

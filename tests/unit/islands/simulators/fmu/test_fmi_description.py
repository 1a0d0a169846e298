"""Model descriptions: what is read of an FMU, and which files are refused."""

import tracemalloc
import zipfile
from pathlib import Path

import pytest

from islands.errors import ModelError, SettingsError
from islands.export import write_export
from islands.export.fmu import find_compiler
from islands.simulators.fmu.fmi_description import read_description
from islands.systems.published_models import PUBLISHED
from support.oscillator_fmus import write_oscillator

# The library of FMUs is imported, which takes seconds.
pytestmark = pytest.mark.ci

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler is called cc")

#: Attributes that FMI 1.0 requires.
FMI1 = 'numberOfContinuousStates="0" numberOfEventIndicators="0"'


@needs_compiler
@pytest.mark.parametrize("version", [2, 3])
def test_variables_have_their_units_and_start_values(version: int, tmp_path: Path) -> None:
    found = read_description(str(write_oscillator(tmp_path / "mass.fmu", version)))
    assert (found.version, found.interface) == (version, "model-exchange")
    assert [(each.name, each.unit) for each in (*found.inputs, *found.outputs)] == [("u", "N"), ("x", "m")]
    assert [(each.name, each.unit, each.start) for each in found.parameters] == [
        ("m", "kg", 0.5),
        ("c", "N.s/m", 4.0),
        ("k", "N/m", 200.0),
    ]
    assert [each.name for each in found.states] == ["x", "v"]
    assert found.settable == ("x", "v")
    assert (found.indicators, found.completes, found.fixed_step) == (1, version == 2, None)


@needs_compiler
def test_an_interface_can_be_chosen_if_the_fmu_has_it(tmp_path: Path) -> None:
    both = str(write_oscillator(tmp_path / "both.fmu"))
    assert read_description(both, "co-simulation").interface == "co-simulation"
    one = str(write_oscillator(tmp_path / "one.fmu", interfaces="CoSimulation", fixed_step=0.005))
    found = read_description(one)
    assert (found.interface, found.fixed_step, found.has_variable_step) == ("co-simulation", 0.005, False)
    with pytest.raises(SettingsError, match=r"one.fmu offers co-simulation only, not model-exchange"):
        read_description(one, "model-exchange")


@needs_compiler
def test_an_fmu_without_a_library_for_this_machine_is_refused(tmp_path: Path) -> None:
    path = write_oscillator(tmp_path / "mass.fmu", 2, platform="win64")
    with pytest.raises(ModelError, match=r"no library for \w+ \(it has win64\): export it"):
        read_description(str(path))


def test_sources_can_be_compiled_if_there_is_no_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    write_export(PUBLISHED["12"].model, "fmu2", tmp_path / "model.fmu")
    with pytest.raises(ModelError, match=r"\(it has none\): run 'fmpy compile .*model.fmu'"):
        read_description(str(tmp_path / "model.fmu"))


@pytest.mark.parametrize("content", [b"", b"no archive", None])
def test_a_file_that_is_no_fmu_is_refused(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "broken.fmu"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ModelError, match=r"broken.fmu cannot be read as an FMU .*: write fmu:FILE.fmu"):
        read_description(str(path))


@pytest.mark.parametrize(
    ("description", "message"),
    [
        ('<fmiModelDescription fmiVersion="3.0" modelName="m">', "cannot be read as an FMU"),
        (
            f'<fmiModelDescription fmiVersion="1.0" {FMI1}><ModelVariables/></fmiModelDescription>',
            "is of FMI 1.0: export it for FMI",
        ),
        (
            '<fmiModelDescription fmiVersion="3.0"><ModelVariables/><ModelStructure/></fmiModelDescription>',
            "offers neither co-simulation nor model exchange",
        ),
    ],
)
def test_a_description_that_cannot_be_simulated_is_refused(
    description: str, message: str, tmp_path: Path
) -> None:
    with zipfile.ZipFile(tmp_path / "model.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description)
    with pytest.raises(ModelError, match=message):
        read_description(str(tmp_path / "model.fmu"))


def add_variables(source: Path, target: Path, text: str, types: str = "", indicators: str = "") -> str:
    """Write a copy of an FMU with further variables, types and event indicators; return its path."""
    with zipfile.ZipFile(source) as given, zipfile.ZipFile(target, "w") as changed:
        for name in given.namelist():
            data = given.read(name)
            if name == "modelDescription.xml":
                words = data.decode().replace("<ModelVariables>", f"{types}<ModelVariables>")
                words = words.replace("<EventIndicator", f"{indicators}<EventIndicator")
                data = words.replace("</ModelVariables>", f"{text}</ModelVariables>").encode()
            changed.writestr(name, data)
    return str(target)


@needs_compiler
def test_types_aliases_and_arrays_of_fmi_3_are_resolved(tmp_path: Path) -> None:
    common = 'causality="parameter" variability="tunable" start="2"'
    path = add_variables(
        write_oscillator(tmp_path / "mass.fmu"),
        tmp_path / "more.fmu",
        '<UInt64 name="n" valueReference="50" causality="structuralParameter" start="3"/>'
        f'<Float64 name="p" valueReference="51" {common} declaredType="T"><Alias name="q"/></Float64>'
        f'<Float64 name="a" valueReference="52" {common}><Dimension valueReference="50"/></Float64>'
        '<Float64 name="b" valueReference="53"><Dimension start="2"/><Dimension start="4"/></Float64>',
        types='<TypeDefinitions><Float64Type name="T" unit="kg" min="0.1"/></TypeDefinitions>',
        indicators='<EventIndicator valueReference="52"/><EventIndicator valueReference="53"/>',
    )
    found = read_description(path)
    described = [(each.name, each.unit, each.start, each.lower) for each in found.parameters[3:]]
    assert described == [("p", "kg", 2.0, 0.1), ("q", "kg", 2.0, 0.1)]
    assert found.indicators == 1 + 3 + 8


@needs_compiler
@pytest.mark.parametrize("version", [2, 3])
def test_the_reading_ends_at_the_limit_whatever_follows(version: int, tmp_path: Path) -> None:
    mass = write_oscillator(tmp_path / "mass.fmu", version)
    # An input, an output, three parameters and two states.
    assert read_description(str(mass), most=7).states
    for most in (4, 6):
        with pytest.raises(ModelError, match=rf"mass.fmu has more than {most} variables of type real"):
            read_description(str(mass), most=most)
    broken = add_variables(mass, tmp_path / "broken.fmu", "</this is no XML>")
    with pytest.raises(ModelError, match=r"broken\.fmu has more than 4 variables"):
        read_description(broken, most=4)


@needs_compiler
def test_local_variables_are_not_kept(tmp_path: Path) -> None:
    local = "".join(f'<Float64 name="q{each}" valueReference="{each}"/>' for each in range(100, 20_100))
    path = add_variables(write_oscillator(tmp_path / "mass.fmu"), tmp_path / "large.fmu", local)
    read_description(path)
    tracemalloc.start()
    try:
        found = read_description(path, most=7)
        assert tracemalloc.get_traced_memory()[1] < 1e6
    finally:
        tracemalloc.stop()
    assert [each.name for each in found.states] == ["x", "v"]

"""Model descriptions: what is read of an FMU, and which files are refused."""

import zipfile
from pathlib import Path

import pytest

from islands.errors import ModelError, SettingsError
from islands.export import write_export
from islands.export.fmu.compiler import find_compiler
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

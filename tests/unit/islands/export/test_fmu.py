"""FMU: instances, communication steps, sources and the description of the model."""

import zipfile
from dataclasses import replace

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

from islands.errors import ModelError
from islands.export import write_export
from islands.systems.published_models import PUBLISHED
from support.exported_programs import needs_compiler
from support.programs import HOSTILE_NAMES, model

# Every FMU is compiled.
pytestmark = pytest.mark.ci

FORMATS = ("fmu", "fmu2")


class Session:
    """An instance of an FMU whose communication steps the test takes."""

    def __init__(self, kind, path, folder):
        description = fmpy.read_model_description(str(path))
        folder = fmpy.extract(str(path), unzipdir=str(folder))
        three = kind == "fmu"
        self.fmu = (FMU3Slave if three else FMU2Slave)(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
        )
        self.messages = []
        if three:
            self.fmu.instantiate(
                logMessage=fmpy.fmi3.fmi3LogMessageCallback(
                    lambda _e, _s, _c, text: self.messages.append(text.decode())
                )
            )
            self.get, self.set = self.fmu.getFloat64, self.fmu.setFloat64
            self.get_state, self.set_state = self.fmu.getFMUState, self.fmu.setFMUState
            self.serialise, self.restore = self.fmu.serializeFMUState, self.fmu.deserializeFMUState
            self.free_state = self.fmu.freeFMUState
        else:
            self.fmu.instantiate()
            self.get, self.set = self.fmu.getReal, self.fmu.setReal
            self.get_state, self.set_state = self.fmu.getFMUstate, self.fmu.setFMUstate
            self.serialise, self.restore = self.fmu.serializeFMUstate, self.fmu.deSerializeFMUstate
            self.free_state = self.fmu.freeFMUstate
        self.three, self.time = three, 0.0

    def start(self):
        if not self.three:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def step(self, u, duration):
        self.set([2], [u])
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=duration)
        self.time += duration
        return self.get([1])[0]


@pytest.fixture(params=FORMATS, scope="module")
def compiled(request, tmp_path_factory):
    """Kind and path of an FMU that tests extract; it takes a quarter of a second to compile."""
    path = tmp_path_factory.mktemp("compiled") / "model.fmu"
    exported = replace(model({"y(k-1)": 0.5, "y(k-2)": -0.25, "u(k-2)": 1.0}), dt=0.125)
    write_export(exported, request.param, path)
    return request.param, path


@pytest.fixture
def session(compiled, tmp_path):
    kind, path = compiled
    found = Session(kind, path, tmp_path)
    yield found
    found.fmu.freeInstance()


@needs_compiler
def test_a_state_is_stored_and_set_again(session):
    session.start()
    session.step(1.0, 0.125)
    stored = session.get_state()
    first = [session.step(u, 0.125) for u in (3.0, -1.0, 2.0)]
    session.set_state(stored)
    assert [session.step(u, 0.125) for u in (3.0, -1.0, 2.0)] == first
    session.set_state(session.restore(session.serialise(stored)))
    assert [session.step(u, 0.125) for u in (3.0, -1.0, 2.0)] == first
    session.free_state(stored)


@needs_compiler
def test_a_long_communication_step_takes_several_samples_with_a_constant_input(session):
    session.set([3], [8.0])
    session.start()
    stored = session.get_state()
    one_by_one = [session.step(2.0, 0.125) for _ in range(4)]
    session.set_state(stored)
    assert session.step(2.0, 0.5) == one_by_one[-1]


@needs_compiler
@pytest.mark.parametrize("duration", [0.1, 0.0, 0.19, -0.125])
def test_a_step_is_a_multiple_of_the_sampling_time(session, duration):
    session.start()
    with pytest.raises(fmpy.fmi1.FMICallException):
        session.step(1.0, duration)


@needs_compiler
def test_start_values_cannot_be_set_in_a_running_simulation(session):
    session.start()
    with pytest.raises(fmpy.fmi1.FMICallException):
        session.set([3], [1.0])
    with pytest.raises(fmpy.fmi1.FMICallException):
        session.set([1], [1.0])


@needs_compiler
def test_an_output_that_is_not_finite_is_an_error(session):
    session.start()
    session.step(np.inf, 0.125)
    with pytest.raises(fmpy.fmi1.FMICallException):
        session.step(1.0, 0.125)


@pytest.mark.parametrize("kind", FORMATS)
def test_an_fmu_without_a_compiler_has_sources_only(kind, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    for name in ("one", "other"):
        write_export(PUBLISHED["12"].model, kind, tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()
    with zipfile.ZipFile(tmp_path / "one") as archive:
        names = archive.namelist()
    assert not [name for name in names if name.startswith("binaries")]
    assert {"modelDescription.xml", "sources/model.h", "sources/instance.h"} < set(names)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_a_column_name_is_a_variable_or_an_error(name, kind, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    exported = replace(model({"u(k-1)": 2.0}), input_names=(name,), dt=0.1)
    if not name.isprintable():
        with pytest.raises(ModelError, match="rename it"):
            write_export(exported, kind, tmp_path / "model.fmu")
        return
    write_export(exported, kind, tmp_path / "model.fmu")
    assert validate_fmu(str(tmp_path / "model.fmu")) == []
    described = fmpy.read_model_description(str(tmp_path / "model.fmu"))
    assert name in [each.name for each in described.modelVariables]

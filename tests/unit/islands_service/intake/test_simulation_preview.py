"""Previews of simulations: what their failures say."""

import asyncio

import pytest

from islands.errors import RecordError
from islands_service.intake import simulation_preview
from islands_service.intake.simulation_preview import SimulationPreviewRequest, preview_simulation

pytestmark = pytest.mark.ci


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("while True: pass", "takes longer than 1 s: select fewer rows, or start the diagnosis"),
        (
            "import os; os.kill(os.getpid(), 11)",
            r"cannot be made within .* \(exit -11\): the simulation fails",
        ),
    ],
)
def test_a_preview_that_fails_names_the_simulation_and_the_record(
    tmp_path, monkeypatch, programs, program, words
):
    record, fmu = tmp_path / "axis.csv", tmp_path / "mass.fmu"
    for path in (record, fmu):
        path.touch()
    monkeypatch.setattr(simulation_preview, "SIMULATION_SERVER", programs(program))
    request = SimulationPreviewRequest({"simulation": {"kind": "fmu"}})
    with pytest.raises(RecordError, match=rf"^the preview of mass\.fmu on axis\.csv {words}"):
        asyncio.run(preview_simulation(record, request, 6_000_000_000, 1.0, fmu))

"""Calibrated preview of a simulation on a part of an untrusted record, in a confined subprocess."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from islands.errors import ModelError, RecordError, SettingsError
from islands_service.domain.job_spec import SimulatedRecord
from islands_service.domain.plot_envelopes import describe_envelopes
from islands_service.intake.confined_answer import ask_confined
from islands_service.intake.confined_process import ConfinedTask, enter, refuse, send_document
from islands_service.intake.reader_process import SIMULATION_SERVER

#: Names of the signals of a preview.
MEASURED, SIMULATED = "measured", "simulated"


@dataclass(frozen=True, slots=True)
class SimulationPreviewRequest:
    """Simulation of a record.

    Attributes
    ----------
    job : mapping
        What is previewed, see `islands_service.domain.job_spec.SimulatedRecord`.
    reading : mapping
        Options of `islands.records.reading.options.ReadingOptions` that differ from the default.
    points : int
        Largest number of parts of the plotted signals.
    fmu : mapping or None
        Description of the FMU that is the simulation.
    """

    job: Mapping[str, Any]
    reading: Mapping[str, Any] = field(default_factory=dict)
    points: int = 2000
    fmu: Mapping[str, Any] | None = None


async def preview_simulation(
    path: Path, request: SimulationPreviewRequest, memory: int, seconds: float, fmu: Path | None = None
) -> Mapping[str, Any]:
    """Return a preview with the fields of `islands_api.simulation_schemas.SimulationPreview`.

    Parameters
    ----------
    memory, seconds
        Limits of the subprocess: bytes of address space, and time.
    fmu : Path, optional
        File of the FMU that is the simulation.

    Raises
    ------
    RecordError, ModelError, SettingsError
        The record or the simulation cannot be used, or not within the limits.
    """
    asked = {"request": asdict(request)}
    simulation = request.job["simulation"]["kind"] if fmu is None else fmu.name
    task = ConfinedTask(
        f"the preview of {simulation} on {path.name}",
        verb="",
        failure="cannot be made",
        cause="the simulation fails, calls what a service forbids, or needs too much memory",
        remedy="select fewer rows, or start the diagnosis, which has more time",
    )
    return await ask_confined(
        "simulation_preview", path, asked, memory, seconds, SIMULATION_SERVER, fmu, task
    )


def main() -> None:
    """Simulate the record named on standard input, and write the preview to standard output."""
    # Only the processes that simulate import the kernels.
    from islands.kernels.jit_cache import cache_folder  # noqa: PLC0415
    from islands.simulators.fmu.instance import LOCAL_FMUS  # noqa: PLC0415
    from islands_service.intake.confined_fmu import load_extracted  # noqa: PLC0415

    kernels = [each for each in (cache_folder(),) if each is not None]
    path, asked, answer = enter(readable=kernels)
    request = SimulationPreviewRequest(**asked["request"])
    try:
        fmus = LOCAL_FMUS
        if request.fmu is not None:
            fmus = load_extracted(asked, request.fmu, Path(path).resolve(), *kernels)
        document = _describe(path, request, fmus)
    except (RecordError, ModelError, SettingsError) as error:
        words = str(error).replace(f"{asked['folder']}/", "") if request.fmu else str(error)
        refuse(type(error)(words), answer)
    send_document(document, answer)


def _describe(path: str, request: SimulationPreviewRequest, fmus: Any) -> dict[str, Any]:
    from islands.diagnosis.calibration.preview import choose_stretch, preview_calibration  # noqa: PLC0415
    from islands.records.reading import read_dataset  # noqa: PLC0415
    from islands.records.reading.options import ReadingOptions  # noqa: PLC0415
    from islands.records.reading.row_range import parse_rows  # noqa: PLC0415
    from islands.simulators.specification.factory import make_simulator  # noqa: PLC0415

    job = SimulatedRecord.model_validate(request.job)
    whole = read_dataset(
        *(path, job.inputs, job.output, job.dt, parse_rows(job.rows)),
        options=ReadingOptions(**request.reading),
        resting_inputs=True,
        signals=job.recorded_columns,
    )
    stretch = choose_stretch(whole)
    part, kept = whole[stretch], 1 + len(job.channels)
    record = part.first_inputs(kept)
    columns = dict(zip(job.recorded_columns, part.u[:, kept:].T, strict=True))
    simulator = make_simulator(job.simulation, record, columns, fmus)
    found = preview_calibration(record, simulator, job.tolerance)
    signals = {MEASURED: record.y, SIMULATED: found.fit.output}
    rows, described = describe_envelopes(signals, stretch.start, request.points)
    return {
        "simulation": simulator.name,
        "start": stretch.start,
        "stop": stretch.stop,
        "samples": whole.samples,
        "estimation_samples": found.fitted,
        "dt": record.dt,
        "unit": record.output_unit,
        "rows": rows,
        "columns": described,
        "error_percent": found.error_percent,
        "parameters": [
            {"name": parameter.name, "unit": parameter.unit, "value": float(value)}
            for parameter, value in zip(found.fit.simulation.parameters, found.fit.values, strict=True)
        ],
    }

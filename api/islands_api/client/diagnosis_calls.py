"""Requests of discrepancy jobs, which diagnose a simulation, and of the simulations that they accept."""

from collections.abc import Mapping, Sequence
from typing import Any

from islands.diagnosis.settings import DiagnosisSettings
from islands.errors import SettingsError
from islands.settings_schema import document_settings
from islands.simulators.specification.code import FmuSpec
from islands.simulators.specification.table import SIMULATORS, innermost, parse_spec
from islands_api.client.calls import (
    DatasetRef,
    JobRef,
    RequestSpec,
    as_list,
    get_id,
    make_part,
    make_submission,
    quote_id,
)
from islands_api.client.responses import read_as, read_mapping
from islands_api.result_schemas import DiagnosisOutputs
from islands_api.schemas import JobView
from islands_api.simulation_schemas import SimulationList, SimulationPreview, SimulationView


@document_settings(DiagnosisSettings, "settings")
def diagnose(
    dataset: DatasetRef,
    input: str,  # noqa: A002 - the name in the request body
    output: str,
    simulation: str | Mapping[str, Any],
    *,
    channels: str | Sequence[str] = (),
    seed: int = 0,
    dt: float | None = None,
    rows: str | None = None,
    recordings: Sequence[DatasetRef | Mapping[str, Any]] = (),
    validation: DatasetRef | Mapping[str, Any] | None = None,
    name: str = "",
    tags: str | Sequence[str] = (),
    priority: int = 0,
    idempotency_key: str | None = None,
    **settings: Any,
) -> RequestSpec[JobView]:
    """Submit a job that diagnoses the errors of a simulation on a record, or on several recordings.

    Parameters
    ----------
    input : str
        Column that drives the simulation.
    simulation : str or mapping
        As on the command line (``"bouc-wen-piezo"``, ``"model:FILE.json"``, ``"column:NAME"`` ...), or as in
        the request body: an FMU is ``{"kind": "fmu", "file": client.upload_fmu("FILE.fmu").id}``.
    channels : str or sequence of str
        Columns that may couple in, for example a temperature.
    dt : float, optional
        Sampling time in seconds, if the record has no time column.
    rows : str, optional
        ``START:STOP``, the samples to use.
    recordings : sequence of data set or mapping
        Further recordings of the same system: data sets, or ``{"dataset": ID, "rows": "START:STOP"}``.
    validation : data set or mapping, optional
        A recording that is held out as a whole, instead of the last quarter of the record.
    tags : str or sequence of str
        Words by which `jobs` finds the job.
    **settings

    Raises
    ------
    SettingsError
        The simulation is unknown or is code (Python, or an FMU that was not uploaded), a number is NaN or
        infinite, or the idempotency key is not printable ASCII.
    ModelError
        A model file cannot be read.
    """
    given = {
        **_describe_simulated(dataset, input, output, channels, simulation),
        **settings,
        "seed": seed,
        "dt": dt,
        "rows": rows,
        "recordings": [make_part(each) for each in recordings] or None,
        "validation": None if validation is None else make_part(validation),
        "name": name or None,
        "tags": as_list(tags) or None,
        "priority": priority or None,
    }
    return make_submission("/v1/discrepancies", given, idempotency_key)


def outputs(
    which: JobRef, start: int = 0, stop: int | None = None, points: int = 2000
) -> RequestSpec[DiagnosisOutputs]:
    """Return measured and simulated outputs of a discrepancy job, and the residuals, for a plot.

    Parameters
    ----------
    which : str or JobView
    start, stop : int, int or None
        First sample, from 0, and the sample after the last one; by default all samples.
    points : int
        Largest number of parts, at most 5000.
    """
    params = {"start": start, "points": points, **({} if stop is None else {"stop": stop})}
    path = f"/v1/jobs/{quote_id(which)}/outputs"
    return RequestSpec("GET", path, read_as(DiagnosisOutputs), params=params)


def next_experiment(which: JobRef) -> RequestSpec[str]:
    """Return the input of the next experiment of a discrepancy job as CSV, with the time in seconds."""
    path = f"/v1/jobs/{quote_id(which)}/next-experiment"
    return RequestSpec("GET", path, lambda response: response.text)


def simulations() -> RequestSpec[tuple[SimulationView, ...]]:
    """Return the simulations that `diagnose` accepts, with the parameters of the physical systems."""
    listed = read_as(SimulationList)
    return RequestSpec("GET", "/v1/simulations", lambda response: listed(response).items)


def check_equations(text: str) -> RequestSpec[dict[str, Any]]:
    """Check differential equations; return them as the simulation of `diagnose`.

    Parameters
    ----------
    text : str
        Content of the file that ``ode:FILE.toml`` names.
    """
    return RequestSpec("POST", "/v1/simulations/equations", read_mapping, json={"text": text})


def preview(
    dataset: DatasetRef,
    input: str,  # noqa: A002 - the name in the request body
    output: str,
    simulation: str | Mapping[str, Any],
    *,
    channels: str | Sequence[str] = (),
    tolerance: Mapping[str, float] | None = None,
    dt: float | None = None,
    rows: str | None = None,
    points: int = 2000,
) -> RequestSpec[SimulationPreview]:
    """Calibrate a simulation on a part of a record, as a diagnosis does first; nothing is stored.

    Parameters
    ----------
    input, output, simulation, channels, tolerance, dt, rows
        As for `diagnose`.
    points : int
        Largest number of parts of the signals, at most 5000.

    Raises
    ------
    SettingsError, ModelError
        As for `diagnose`.
    """
    given = {
        **_describe_simulated(dataset, input, output, channels, simulation),
        "tolerance": dict(tolerance or {}) or None,
        "dt": dt,
        "rows": rows,
        "points": points,
    }
    body = {name: value for name, value in given.items() if value is not None}
    return RequestSpec("POST", "/v1/simulations/preview", read_as(SimulationPreview), json=body)


def _describe_simulated(
    dataset: DatasetRef,
    input: str,  # noqa: A002 - the name in the request body
    output: str,
    channels: str | Sequence[str],
    simulation: str | Mapping[str, Any],
) -> dict[str, Any]:
    """Return the fields that a diagnosis and its preview have in common."""
    return {
        "dataset": get_id(dataset),
        "input": input,
        "output": output,
        "channels": as_list(channels) or None,
        "simulation": parse_simulation(simulation) if isinstance(simulation, str) else simulation,
    }


def parse_simulation(text: str) -> dict[str, Any]:
    """Read the text of a simulation; return its form in the request body. A model file is read here.

    Raises
    ------
    SettingsError
        The simulation is unknown, or is code: a Python function, or an FMU that has to be uploaded before.
    ModelError
        A model file cannot be read.
    """
    spec = parse_spec(text)
    if isinstance(spec, FmuSpec):
        raise SettingsError(
            f'{text}: upload the FMU with upload_fmu, and give {{"kind": "fmu", "file": its id}}'
        )
    if not SIMULATORS[innermost(spec).kind].is_remote:
        raise SettingsError(
            f"{text}: a service does not run code of its clients: run 'islands diagnose' locally, or send "
            "the simulated output as a column of the record"
        )
    return dict(spec.model_dump(mode="json", exclude_unset=True))

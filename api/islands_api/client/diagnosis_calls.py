"""Calls of discrepancy jobs: what is sent to have a simulation held against a record."""

from collections.abc import Mapping, Sequence
from typing import Any

from islands.errors import SettingsError
from islands.io.simulator_spec.specification import parse_spec
from islands_api.client.calls import DatasetRef, RequestSpec, id_of, names_of, submission
from islands_api.schemas import JobView


def diagnose(
    dataset: DatasetRef,
    input: str,  # noqa: A002 - as the body has it
    output: str,
    simulation: str | Mapping[str, Any],
    *,
    channels: str | Sequence[str] = (),
    tolerance: Mapping[str, float] | None = None,
    seed: int = 0,
    dt: float | None = None,
    rows: str | None = None,
    name: str = "",
    priority: int = 0,
    idempotency_key: str | None = None,
) -> RequestSpec[JobView]:
    """Submit a job that finds out what a simulation gets wrong about a record.

    Parameters
    ----------
    input, channels : str and sequence of str
        The column that drives the simulation, and those that may couple in.
    simulation : str or mapping
        As on the command line (``"bouc-wen-piezo"``, ``"model:FILE.json"``, ``"column:NAME"`` ...), or as in
        the body.
    tolerance : mapping, optional
        Relative standard deviations of the simulation's parameters.

    Raises
    ------
    SettingsError
        As of `islands_api.client.calls.submit`, or as of `simulation_of`.
    ModelError
        As of `simulation_of`.
    """
    given = {
        "dataset": id_of(dataset),
        "input": input,
        "output": output,
        "channels": names_of(channels) or None,
        "simulation": simulation_of(simulation) if isinstance(simulation, str) else simulation,
        "tolerance": dict(tolerance or {}) or None,
        "seed": seed,
        "dt": dt,
        "rows": rows,
        "name": name or None,
        "priority": priority or None,
    }
    return submission("/v1/discrepancies", given, idempotency_key)


def simulation_of(text: str) -> dict[str, Any]:
    """Return the simulation that a text asks for, as it is sent; a model file is read here.

    Raises
    ------
    SettingsError
        It asks for nothing that there is, or for code: a service runs none of others.
    ModelError
        It names a model file that cannot be read.
    """
    asked = parse_spec(text).model_dump(mode="json", exclude_unset=True)
    if asked["kind"] == "python":
        raise SettingsError(
            f"{text}: a service runs no code of others: run 'islands diagnose' where it is, or send what it "
            "simulates as a column of the record"
        )
    return dict(asked)

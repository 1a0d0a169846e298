"""``islands serve``: the whole service on this machine, or the roles of it that a cluster lacks here."""

import secrets
import signal
import sys
from pathlib import Path
from typing import Annotated

import typer

from islands_api.cli.console import errors
from islands_service.settings import ServiceSettings, service_settings
from islands_service.supervisor import Role, folder_lock, supervise

#: Seconds without a sign of life after which the doors, and the Ray on this machine, are taken for hanging.
_API_PATIENCE, _RAY_PATIENCE = 10.0, 20.0

#: The least of these seconds for a coordinator; else they are its lease's, after which its job is another's.
_LEAST_PATIENCE = 5.0


def serve(
    data_dir: Annotated[
        Path | None, typer.Option("--data-dir", help="Uploads, results, and the database if none is given.")
    ] = None,
    host: Annotated[
        str | None, typer.Option("--host", help="127.0.0.1 by default; others need keys.")
    ] = None,
    port: Annotated[int | None, typer.Option("--port", help="8000 by default.")] = None,
    database: Annotated[
        str | None, typer.Option("--database", help="postgresql+psycopg://...; SQLite by default.")
    ] = None,
    ray_address: Annotated[
        str | None, typer.Option("--ray-address", help="HOST:PORT of a cluster; a Ray of our own by default.")
    ] = None,
    coordinators: Annotated[
        int | None, typer.Option("--coordinators", help="Jobs that are carried out at once; 1 by default.")
    ] = None,
    tls_certificate: Annotated[Path | None, typer.Option("--tls-certificate", help="PEM file.")] = None,
    tls_key: Annotated[Path | None, typer.Option("--tls-key", help="PEM file.")] = None,
    require_keys: Annotated[
        bool | None, typer.Option("--require-keys", help="Ask for a key on this machine, too.")
    ] = None,
    log_format: Annotated[str | None, typer.Option("--log-format", help="text or json.")] = None,
) -> None:
    """Accept jobs over REST and carry them out. After Ctrl-C or SIGTERM they go on at the next start."""
    settings = service_settings(**locals())
    with folder_lock(settings.data_dir):
        scheme = "http" if settings.tls_key is None else "https"
        errors.print(
            f"islands serve: {scheme}://{settings.host}:{settings.port}, data in {settings.data_dir}",
            markup=False,
        )
        # What an earlier run said of its Ray holds no more.
        settings.ray_address_file.unlink(missing_ok=True)
        status = supervise(roles(settings), settings.environment())
    sys.exit(status)


def roles(settings: ServiceSettings) -> list[Role]:
    """Return what runs: the doors, the coordinators, and Ray unless a cluster's address is given."""
    python = (sys.executable, "-m")
    ours = [Role("api", (*python, "islands_api"), _API_PATIENCE, orphaned=signal.SIGKILL)]
    needs = () if settings.ray_address else ("ray",)
    instance = _instance(settings.data_dir)
    ours += [
        Role(
            f"coordinator {index}",
            (*python, "islands_service.coordinator", "--name", f"{instance}-{index}"),
            max(settings.lease, _LEAST_PATIENCE),
            needs=needs,
        )
        for index in range(settings.coordinators)
    ]
    if not settings.ray_address and settings.coordinators:
        head = (*python, "islands_service.runtime.ray_head")
        ours.append(Role("ray", head, _RAY_PATIENCE, address=settings.ray_address_file))
    return ours


def _instance(folder: Path) -> str:
    """Return the name of a data folder: coordinators of the same one take over from each other at once."""
    path = folder / "instance"
    if not path.exists():
        path.write_text(secrets.token_hex(8))
    return path.read_text()

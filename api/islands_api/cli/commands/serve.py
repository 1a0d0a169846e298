"""``islands serve``: the whole service on this machine, or without Ray if a cluster is given."""

import secrets
import signal
import socket
import sys
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from islands.cli.console import errors
from islands.cli.settings_options import GIVEN, Given, split_settings, with_settings
from islands.distribution import describe_missing_extra, list_missing_packages
from islands.errors import SettingsError
from islands_api.cli.service.page_opening import open_when_ready
from islands_api.cli.service.store_options import refuse_password
from islands_service.intake.confined_process import ENVIRONMENT, REQUESTS, make_command
from islands_service.settings import ServiceSettings, service_settings
from islands_service.supervisor import Role, folder_lock, supervise

#: Seconds without a heartbeat after which the API process and the fork server are restarted.
_HEARTBEAT_TIMEOUT = 10.0

#: Seconds without a heartbeat after which the local Ray head is restarted.
_RAY_HEARTBEAT_TIMEOUT = 20.0

#: Least heartbeat timeout of a coordinator in seconds. Otherwise it is the duration of the lease, after which
#: another coordinator takes over the job.
_MIN_COORDINATOR_TIMEOUT = 5.0


@with_settings
def serve(
    *,
    context: typer.Context,
    given: Annotated[Given, ServiceSettings],
    show: Annotated[
        bool, typer.Option("--open", help="Open the page in the browser when the service is ready.")
    ] = False,
) -> None:
    """Accept jobs over REST and run them. After Ctrl-C or SIGTERM they continue at the next start.

    Each setting is also an environment variable: ISLANDS_ and its name.
    """
    in_file = split_settings(context.lookup_default(GIVEN) or ())
    if "database" in given and given["database"] != in_file.get("database"):
        refuse_password(given["database"])
    settings = service_settings(**given)
    check_packages(settings)
    with folder_lock(settings.data_dir):
        scheme = "http" if settings.tls_key is None else "https"
        address = f"{scheme}://{settings.host}:{settings.port}"
        errors.print(f"islands serve: {address}, data in {settings.data_dir}", markup=False)
        # The address of an earlier run's Ray is stale.
        settings.ray_address_file.unlink(missing_ok=True)
        # Both ends stay open here: requests wait while the fork server starts again.
        requests, readers = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with requests, readers:
            children = roles(settings, requests.fileno(), readers.fileno())
            if show:
                open_when_ready(address)
            status = supervise(children, settings.environment())
    sys.exit(status)


def check_packages(settings: ServiceSettings) -> None:
    """Check that what the child processes import is installed: they would end at every start.

    Raises
    ------
    SettingsError
        The message names the missing packages.
    """
    uses = {
        "service": True,
        "cluster": not settings.url.startswith("sqlite"),
        "oidc": settings.oidc_issuer,
        "s3": settings.blob_store or settings.dataset_buckets,
        "telemetry": settings.telemetry,
    }
    absent = {extra: list_missing_packages(extra) for extra, used in uses.items() if used}
    if names := dict.fromkeys(chain(*absent.values())):
        user = f"islands serve cannot run without {', '.join(names)}; it"
        raise SettingsError(describe_missing_extra(user, *filter(absent.get, absent)))


def roles(settings: ServiceSettings, requests: int, readers: int) -> list[Role]:
    """Return the child processes: API, fork server, coordinators, and Ray unless a cluster is given.

    Parameters
    ----------
    requests, readers : int
        File descriptors of the socket of the fork server: its own end, and that of its clients.
    """
    python = (sys.executable, "-m")
    clients = {REQUESTS: readers}
    children = [
        Role(
            *("api", (*python, "islands_api"), _HEARTBEAT_TIMEOUT),
            orphaned=signal.SIGKILL,
            descriptors=clients,
        ),
        Role(
            *("reader", make_command("fork_server"), _HEARTBEAT_TIMEOUT),
            orphaned=signal.SIGKILL,
            descriptors={REQUESTS: requests},
            environment=ENVIRONMENT,
        ),
    ]
    needs = () if settings.ray_address else ("ray",)
    instance = _get_instance(settings.data_dir)
    children += [
        Role(
            f"coordinator {index}",
            (
                *(*python, "islands_service.coordinator", "--name", f"{instance}-{index}"),
                *(("--metrics-port", str(settings.metrics_port + index)) if settings.metrics_port else ()),
            ),
            max(settings.lease, _MIN_COORDINATOR_TIMEOUT),
            needs=needs,
            descriptors=clients,
        )
        for index in range(settings.coordinators)
    ]
    if not settings.ray_address and settings.coordinators:
        head = (*python, "islands_service.runtime.ray_head")
        address = settings.ray_address_file
        children.append(Role("ray", head, _RAY_HEARTBEAT_TIMEOUT, on_demand=True, address=address))
    return children


def _get_instance(folder: Path) -> str:
    """Return the persistent random name of a data folder.

    A coordinator of the same name takes over the jobs of its predecessor immediately.
    """
    path = folder / "instance"
    if not path.exists():
        path.write_text(secrets.token_hex(8))
    return path.read_text()

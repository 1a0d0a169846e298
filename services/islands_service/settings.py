"""Settings of the service: the only reader of the environment. Every field is ``ISLANDS_`` and its name."""

import os
from pathlib import Path
from typing import Annotated, Literal

from platformdirs import user_data_path
from pydantic import Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

from islands.errors import SettingsError

#: Addresses that nobody else can reach.
LOOPBACK = ("127.0.0.1", "::1", "localhost")

Positive = Annotated[float, Field(gt=0.0)]
Count = Annotated[int, Field(ge=1)]


class ServiceSettings(BaseSettings):
    """What can be set, for all roles. Bytes, seconds, and counts.

    Attributes
    ----------
    data_dir
        Uploads, results, and the database unless another one is given.
    database
        ``postgresql+psycopg://USER:PASSWORD@HOST/NAME``; by default SQLite in the data folder.
    host, port
        Address that the service listens on.
    ray_address
        ``HOST:PORT`` of a Ray cluster; by default a Ray on this machine is started.
    coordinators
        Number of jobs that run at the same time.
    lease
        Seconds after which a coordinator that says nothing has lost its job; at least one.
    checkpoint_every
        Seconds between two checkpoints: what a crash may cost.
    max_upload, max_unpacked
        The largest file that is taken, and what it may unpack to.
    inspection_memory, inspection_seconds
        What the process that reads an uploaded file may use.
    max_stored
        What the data sets of one owner may take.
    max_active
        Jobs of one owner that wait or run.
    max_evaluations
        Individuals that one job may ask for.
    max_islands
        Islands that one job may ask for.
    retention
        Seconds after which a finished job is forgotten; 0 keeps it for ever.
    rate, burst
        Requests a second of one key, and how many more at once; 0 does not limit.
    tls_certificate, tls_key
        PEM files for HTTPS.
    log_format
        Format of log messages: ``text`` or ``json``.
    telemetry
        Where traces go, OTLP over HTTP: ``http://collector:4318/v1/traces``. Needs the extra ``telemetry``.
    lifeline
        The file descriptor on which a child of ``islands serve`` says that it lives.
    require_keys
        Ask for a key on a loopback address, too: behind a proxy, say.
    """

    model_config = SettingsConfigDict(env_prefix="ISLANDS_", frozen=True, extra="ignore")

    data_dir: Path = Field(default_factory=lambda: user_data_path("islands"))
    database: str = ""
    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8000
    ray_address: str | None = None
    coordinators: Annotated[int, Field(ge=0, le=64)] = 1
    lease: Annotated[float, Field(ge=1.0)] = 5.0
    checkpoint_every: Positive = 5.0
    max_upload: Count = 256_000_000
    max_unpacked: Count = 1_000_000_000
    inspection_memory: Count = 6_000_000_000
    inspection_seconds: Positive = 120.0
    max_stored: Count = 5_000_000_000
    max_active: Count = 10_000
    max_evaluations: Count = 10_000_000_000
    max_islands: Count = 256
    retention: Annotated[float, Field(ge=0.0)] = 90 * 86_400.0
    rate: Annotated[float, Field(ge=0.0)] = 50.0
    burst: Count = 200
    require_keys: bool = False
    tls_certificate: Path | None = None
    tls_key: Path | None = None
    log_format: Literal["text", "json"] = "text"
    telemetry: str = ""
    lifeline: int | None = None

    @property
    def url(self) -> str:
        """The database's URL."""
        return self.database or f"sqlite:///{(self.data_dir / 'islands.db').absolute()}"

    @property
    def blobs(self) -> Path:
        """The folder of blobs."""
        return self.data_dir / "blobs"

    @property
    def ray_address_file(self) -> Path:
        """Where the Ray on this machine says how it is reached."""
        return self.data_dir / "ray-address"

    @property
    def on_loopback(self) -> bool:
        """Whether only this machine can reach the service."""
        return self.host in LOOPBACK

    @property
    def keys_needed(self) -> bool:
        """Whether every request needs a key."""
        return self.require_keys or not self.on_loopback

    def environment(self) -> dict[str, str]:
        """Return the environment of a child that shall have the same settings."""
        ours = {
            f"ISLANDS_{name.upper()}": str(value)
            for name, value in self.model_dump(mode="json", exclude={"lifeline"}).items()
            if value is not None
        }
        return {**os.environ, **ours}


def service_settings(**given: object) -> ServiceSettings:
    """Read the settings: what is given, else the environment, else the default.

    Raises
    ------
    SettingsError
        A value is out of its range: the message names it.
    """
    try:
        return ServiceSettings(**{name: value for name, value in given.items() if value is not None})  # type: ignore[arg-type]
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        name = ".".join(map(str, problem["loc"]))
        raise SettingsError(f"setting {name} (ISLANDS_{name.upper()}): {problem['msg']}") from error

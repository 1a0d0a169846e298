"""Settings of the service, read from environment variables. Each field is ``ISLANDS_`` and its name."""

import os
import re
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Any, Self

from platformdirs import user_data_path
from pydantic import AfterValidator, Field, ValidationError, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from islands.available_cpus import count_cpus
from islands.errors import SettingsError
from islands.settings_schema import setting

#: Roles by the values of the claim of roles, if an issuer is given.
DEFAULT_ROLES = (
    "islands-reader=reader,islands-submitter=submitter,islands-monitor=monitor,"
    "islands-administrator=administrator"
)

#: Label of a host name, and an optional port after the name or after an address in brackets.
_HOST = re.compile(r"(?:[A-Za-z0-9_](?:[A-Za-z0-9._-]{0,252})|\[[0-9A-Fa-f:.]+\])(?::[0-9]{1,5})?")

#: Bucket and prefix.
_BUCKET = re.compile(r"s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[A-Za-z0-9._-]+)*/?")

#: Addresses that only this machine can reach.
LOOPBACK = ("127.0.0.1", "::1", "localhost")

#: Largest default number of coordinators, since each of them takes half a gigabyte.
DEFAULT_COORDINATORS = 4


def split_list(text: str) -> tuple[str, ...]:
    """Return the entries of a list that is separated by commas, without spaces and empty ones."""
    return tuple(entry for each in text.split(",") if (entry := each.strip()))


def _check_networks(text: str) -> str:
    networks = split_list(text)
    for network in networks:
        try:
            ip_network(network)
        except ValueError as error:
            raise ValueError(
                f"{error}: give addresses or networks, for example 127.0.0.1, 10.0.0.0/8"
            ) from error
    return ",".join(networks)


def _check_hosts(text: str) -> str:
    hosts = split_list(text)
    for host in hosts:
        if not _HOST.fullmatch(host):
            raise ValueError(
                f"{host!r} is no host: give names or addresses with an optional port, for example "
                "hooks.example.org, 10.0.0.7:8080, [fd00::7]:8080"
            )
    return ",".join(hosts).lower()


def _check_blob_store(url: str) -> str:
    if url and not _BUCKET.fullmatch(url):
        # Do not repeat the value, which may contain credentials.
        raise ValueError(
            "give s3://BUCKET or s3://BUCKET/PREFIX; credentials belong in AWS_ACCESS_KEY_ID and "
            "AWS_SECRET_ACCESS_KEY, or in AWS_SHARED_CREDENTIALS_FILE"
        )
    return url


def _check_buckets(text: str) -> str:
    buckets = split_list(text)
    for bucket in buckets:
        if not _BUCKET.fullmatch(bucket):
            raise ValueError(f"{bucket!r} is no bucket: give s3://BUCKET or s3://BUCKET/PREFIX")
    return ",".join(bucket.rstrip("/") for bucket in buckets)


def check_separate(buckets: str, store: str) -> None:
    """Refuse buckets for data sets that contain blobs: an owner could read the uploads of all others.

    Raises
    ------
    ValueError
    """
    own = f"{store.rstrip('/')}/"
    for bucket in split_list(buckets) if store else ():
        if own.startswith(f"{bucket}/") or bucket.startswith(own):
            raise ValueError(
                f"ISLANDS_DATASET_BUCKETS lists {bucket}, which contains objects of ISLANDS_BLOB_STORE: "
                "give another bucket or prefix"
            )


def read_secret(path: Path, setting: str) -> str:
    """Return the content of a file that a setting names.

    Raises
    ------
    ValueError
        The file cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8").strip()
    except (OSError, ValueError) as error:
        raise ValueError(f"cannot read the file of {setting}, {path}: {error}") from error


Positive = Annotated[float, Field(gt=0.0)]


Count = Annotated[int, Field(ge=1)]


#: Addresses and networks, separated by commas.
Networks = Annotated[str, AfterValidator(_check_networks)]


#: Hosts with optional ports, separated by commas, in lower case.
Hosts = Annotated[str, AfterValidator(_check_hosts)]


#: Bucket and prefix of an object store; empty for none.
BlobStore = Annotated[str, AfterValidator(_check_blob_store)]


#: Buckets with optional prefixes, separated by commas.
Buckets = Annotated[str, AfterValidator(_check_buckets)]


def _is_for_one_user(given: dict[str, Any]) -> bool:
    """Return whether a service with these settings needs no key, since only its user can reach it."""
    return given.get("host") in LOOPBACK and not (given.get("require_keys") or given.get("oidc_issuer"))


class ServiceSettings(BaseSettings):
    """Settings of all roles. Sizes are in bytes, times in seconds."""

    model_config = SettingsConfigDict(env_prefix="ISLANDS_", frozen=True, extra="ignore")

    data_dir: Path = setting(
        None,
        "Folder of uploads and results, and of the database unless `database` is given.",
        default_factory=lambda: user_data_path("islands"),
        daily=True,
    )
    database: str = setting(
        "",
        "`postgresql+psycopg://USER:PASSWORD@HOST/NAME`; by default SQLite in the data folder.",
        daily=True,
    )
    database_file: Path | None = setting(
        None, "File that contains the `database` instead, for example a mounted secret."
    )
    blob_store: BlobStore = setting(
        "",
        "`s3://BUCKET/PREFIX` of an S3-compatible store for uploads, checkpoints, reports and "
        "figures, which all machines share; by default the data folder. Needs the extra `s3`. "
        "Endpoint and credentials are those of AWS' environment variables and files, for example "
        "`AWS_ENDPOINT_URL` and `AWS_SHARED_CREDENTIALS_FILE`. No other service may use the prefix: "
        "what no row of the database names is deleted.",
    )
    blob_cache: Count = setting(10_000_000_000, "Size of the local copies of what is in the `blob_store`.")
    dataset_hosts: Hosts = setting(
        "",
        "Hosts from which clients may let the service download data sets over HTTPS, separated by "
        "commas, each with an optional port: `data.example.org`. None by default. A host with a "
        "private address also has to be one of `private_hosts`.",
    )
    dataset_buckets: Buckets = setting(
        "",
        "Buckets, with optional prefixes, from which clients may do the same: "
        "`s3://measurements/lab`. None by default. The service reads them with its own credentials: "
        "every owner can read what is listed.",
    )
    dataset_seconds: Positive = setting(300.0, "Longest time of such a download.")
    host: str = setting(
        "127.0.0.1",
        "Address that the service listens on; one that other machines can reach requires keys.",
        daily=True,
    )
    port: Annotated[int, Field(ge=0, le=65535)] = setting(
        8000, "Port that the service listens on.", daily=True
    )
    trusted_proxies: Networks = setting(
        "",
        "Addresses and networks of reverse proxies, separated by commas, whose headers "
        "`X-Forwarded-For` and `X-Forwarded-Proto` are believed: `127.0.0.1, 10.0.0.0/8`. None "
        "by default.",
    )
    root_path: Annotated[str, Field(pattern=r"^(/[A-Za-z0-9._~-]+)*$")] = setting(
        "",
        "Path under which a proxy offers the service, for example `/islands`; it precedes the path of "
        "every `Location`.",
    )
    ray_address: str | None = setting(
        None,
        "`HOST:PORT` of a Ray cluster; by default a Ray head is started on this machine when a job needs it.",
        daily=True,
    )
    autoscaling: bool = setting(
        False,
        "Whether the cluster starts machines for islands that wait for a CPU, such as one of KubeRay "
        "with an autoscaler. A job then requests a CPU for each island, even if the cluster has "
        "fewer.",
    )
    coordinators: Annotated[int, Field(ge=0, le=64)] = setting(
        None,
        "Number of jobs that run at the same time: by default one for each core, at most four. They "
        "share the cores of this machine, so that a long job does not keep the others waiting.",
        default_factory=lambda: min(count_cpus(), DEFAULT_COORDINATORS),
        daily=True,
    )
    lease: Annotated[float, Field(ge=1.0)] = setting(
        5.0,
        "Duration of a lease without a heartbeat, after which another coordinator may claim the job; "
        "at least one second.",
    )
    turn: Positive = setting(
        30.0,
        "Time from the first checkpoint of a running job after which it lets those of other owners "
        "pass, if they have fewer running jobs: it returns to the queue at its next checkpoint, and "
        "continues from there at the next turn of its owner.",
    )
    short_search: Annotated[float, Field(ge=0.0)] = setting(
        5.0,
        "Estimated time on one core up to which a search runs in the process of its coordinator, "
        "instead of on Ray. With 0 every search runs on Ray.",
    )
    checkpoint_every: Positive = setting(
        5.0, "Least time between two checkpoints: about the work that a crash can lose."
    )
    max_upload: Count = setting(
        256_000_000,
        "Largest upload.",
    )
    max_unpacked: Count = setting(
        1_000_000_000,
        "Largest size that an upload may unpack to: 100 times its own, at least 64 MB.",
    )
    max_uploads: Count = setting(
        32,
        "Uploads in progress. The data folder needs room for as many files of `max_upload` bytes "
        "and three of `max_unpacked` bytes.",
    )
    max_uploads_per_owner: Count = setting(
        4,
        "Uploads in progress of one owner.",
    )
    body_timeout: Positive = setting(
        30.0,
        "Longest time without a byte of a request's body.",
    )
    body_rate: Annotated[float, Field(ge=0.0)] = setting(
        20_000.0,
        "Least bytes per second of a request's body after `body_timeout`; 0 for no limit.",
    )
    inspection_memory: Count = setting(
        6_000_000_000,
        "Memory of the process that reads an uploaded file; a small file has less.",
    )
    inspection_seconds: Positive = setting(
        120.0,
        "Time of the process that reads an uploaded file.",
    )
    max_stored: Count = setting(5_000_000_000, "Largest total size of the data sets of one owner.")
    max_active: Count = setting(10_000, "Queued and running jobs of one owner.")
    max_running: Count = setting(
        1000,
        "Running jobs of one owner. Further jobs stay in the queue.",
    )
    max_running_islands: Count | None = setting(
        None,
        "Sum of the islands of the running jobs of one owner, unlimited by default.",
    )
    max_run_seconds: Count = setting(
        3600,
        "Run time of one job, without its time in the queue. A search then ends with its best models "
        "so far, a diagnosis fails.",
    )
    max_streams: Count = setting(1000, "Open event streams of one owner, of each API process.")
    max_drawings: Count = setting(
        100, "Requests of one owner whose figures are being drawn or wait for it, of each API process."
    )
    max_evaluations: Count = setting(10_000_000_000, "Individuals that one job may evaluate.")
    max_islands: Count = setting(256, "Islands of one job.")
    max_job_memory: Annotated[int, Field(ge=0)] = setting(
        0,
        "Estimated memory of the individuals of one job: 11.4 kB for each. 0 means half of the memory "
        "of the machine of the API; set it if the islands run on other machines.",
    )
    retention: Annotated[float, Field(ge=0.0)] = setting(
        90 * 86_400.0,
        "Time after which a finished job is deleted; 0 keeps it for ever. An idempotency key is valid "
        "as long.",
    )
    dataset_retention: Annotated[int, Field(ge=0)] = setting(
        0, "Time after which a data set that no job names is deleted; 0 keeps it for ever."
    )
    audit_retention: Annotated[float, Field(ge=0.0)] = setting(
        365 * 86_400.0, "Time after which an entry of the audit trail is deleted; 0 keeps it for ever."
    )
    rate: Annotated[float, Field(ge=0.0)] = setting(
        50.0,
        "Requests per second of one key; 0 for no limit.",
    )
    burst: Count = setting(
        200,
        "Requests that a key may send at once.",
    )
    require_keys: bool = setting(
        False, "Require a key on a loopback address too, for example behind a proxy.", daily=True
    )
    admin_key_file: Path | None = setting(
        None,
        "File with a key of at least 32 characters that has the scope `admin`, for example a mounted "
        "secret. With it the first keys can be created over REST. Without it that key is revoked.",
    )
    oidc_issuer: str = setting(
        "",
        "URL of an OpenID Connect provider whose tokens are accepted in addition to keys. Then every "
        "request needs a key or a token.",
    )
    oidc_audience: str = setting(
        "", "Value that the claim `aud` of a token contains. Required with an issuer."
    )
    oidc_owner_claim: Annotated[str, Field(min_length=1)] = setting(
        "sub", "Claim that names the owner. It must be unique, and users must not be able to choose it."
    )
    oidc_role_claim: Annotated[str, Field(min_length=1)] = setting(
        "roles",
        "Claim with the roles: a list, or text with spaces. A path such as `realm_access.roles` is possible.",
    )
    oidc_roles: str = setting(
        DEFAULT_ROLES,
        "Roles by the values of that claim, `VALUE=ROLE`, separated by commas. The roles are "
        "`reader`, `submitter`, `monitor` and `administrator`.",
    )
    oidc_algorithms: str = setting(
        "RS256,PS256,ES256,Ed25519",
        "Accepted algorithms of signatures, separated by commas. All are asymmetric.",
    )
    oidc_leeway: Annotated[float, Field(ge=0.0, le=300.0)] = setting(
        30.0, "Tolerated difference of the clocks of the issuer and of this machine."
    )
    allow_fmus: bool = setting(
        None,
        "Whether clients may upload FMUs, and simulate them in previews and diagnoses: by default "
        "those of a service for one user, which needs no key. An FMU is native code; it runs in a "
        "process that can do nothing but read the FMU and the installed software, as Linux 5.13 and "
        "later enforce.",
        default_factory=_is_for_one_user,
    )
    tls_certificate: Path | None = setting(None, "PEM file of the certificate for HTTPS.", daily=True)
    tls_key: Path | None = setting(None, "PEM file of the key for HTTPS.", daily=True)
    max_webhooks: Annotated[int, Field(ge=0)] = setting(10, "Webhooks of one owner; 0 for none.")
    max_monitors: Annotated[int, Field(ge=0)] = setting(100, "Monitors of one owner; 0 for none.")
    private_hosts: Hosts = setting(
        "",
        "Hosts to which the service may send requests for its clients though their addresses are "
        "private, separated by commas, each with an optional port: `hooks.lan:8443, 10.0.0.7`. None "
        "by default.",
    )
    http_hosts: Hosts = setting(
        "", "Hosts to which such requests may be sent without TLS, in the same form. None by default."
    )
    metrics_host: str = setting(
        "127.0.0.1",
        "Address at which a coordinator serves its metrics to Prometheus, without a key.",
    )
    metrics_port: Annotated[int, Field(ge=0, le=65535)] = setting(
        0,
        "Port of the metrics; 0 for none. The coordinators of `islands serve` use this port and "
        "the following ones.",
    )
    log_format: str = setting("text", "Format of log messages: `text` or `json`.", choices=("text", "json"))
    telemetry: str = setting(
        "",
        "OTLP endpoint over HTTP for traces: `http://collector:4318/v1/traces`. Needs the extra `telemetry`.",
    )
    lifeline: int | None = setting(
        None, "File descriptor of the heartbeat pipe to `islands serve`, set for its children."
    )
    readers: int | None = setting(
        None,
        "File descriptor of the socket to the process of `islands serve` that forks readers of files, "
        "set for its children. Without it a process starts its own.",
    )

    @model_validator(mode="before")
    @classmethod
    def _read_database_file(cls, values: dict[str, Any]) -> dict[str, Any]:
        if not (path := values.get("database_file")):
            return values
        if values.get("database"):
            raise ValueError("give either ISLANDS_DATABASE or ISLANDS_DATABASE_FILE")
        return {**values, "database": read_secret(Path(path), "ISLANDS_DATABASE_FILE")}

    @model_validator(mode="after")
    def _check_separate_buckets(self) -> Self:
        check_separate(self.dataset_buckets, self.blob_store)
        return self

    @property
    def url(self) -> str:
        """URL of the database."""
        return self.database or f"sqlite:///{(self.data_dir / 'islands.db').absolute()}"

    @property
    def blobs(self) -> Path:
        """Folder of the blobs, or of the local copies of those in an object store."""
        return self.data_dir / ("blob-cache" if self.blob_store else "blobs")

    @property
    def ray_address_file(self) -> Path:
        """File in which the Ray head on this machine stores its address."""
        return self.data_dir / "ray-address"

    @property
    def on_loopback(self) -> bool:
        """Whether only this machine can reach the service."""
        return self.host in LOOPBACK

    @property
    def keys_needed(self) -> bool:
        """Whether every request needs a key or a token."""
        return not _is_for_one_user(vars(self))

    def read_admin_key(self) -> str | None:
        """Return the key of the operator; None without a file.

        Raises
        ------
        SettingsError
            The file cannot be read.
        """
        if self.admin_key_file is None:
            return None
        try:
            return read_secret(self.admin_key_file, "ISLANDS_ADMIN_KEY_FILE")
        except ValueError as error:
            raise SettingsError(str(error)) from error

    def environment(self) -> dict[str, str]:
        """Return environment variables that give a child process the same settings.

        Arguments would be visible to all users of the machine.
        """
        hidden = {"lifeline", "readers"} | ({"database"} if self.database_file is not None else set())
        settings = {
            f"ISLANDS_{name.upper()}": str(value)
            for name, value in self.model_dump(mode="json", exclude=hidden).items()
            if value is not None
        }
        return {**os.environ, **settings}


def service_settings(**given: object) -> ServiceSettings:
    """Read the settings: arguments precede environment variables, and those precede defaults.

    Raises
    ------
    SettingsError
        A value is out of range. The message names the setting.
    """
    try:
        return ServiceSettings(**{name: value for name, value in given.items() if value is not None})  # type: ignore[arg-type]
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        name = ".".join(map(str, problem["loc"]))
        message = problem["msg"].removeprefix("Value error, ")
        raise SettingsError(
            f"setting {name} (ISLANDS_{name.upper()}): {message}" if name else message
        ) from error


def read_simulation_environment() -> dict[str, str]:
    """Return the environment variables of processes that simulate: the cache of kernels, and no secret."""
    kept = ("HOME", "ISLANDS_CACHE_DIR", "ISLANDS_ALLOW_FMUS")
    return {name: os.environ[name] for name in kept if name in os.environ}

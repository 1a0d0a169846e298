"""Types of settings with their checks: numbers in a range, and lists of networks or hosts as text."""

import re
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

#: Roles by the values of the claim of roles, if an issuer is given.
DEFAULT_ROLES = (
    "islands-reader=reader,islands-submitter=submitter,islands-monitor=monitor,"
    "islands-administrator=administrator"
)

#: Label of a host name, and an optional port after the name or after an address in brackets.
_HOST = re.compile(r"(?:[A-Za-z0-9_](?:[A-Za-z0-9._-]{0,252})|\[[0-9A-Fa-f:.]+\])(?::[0-9]{1,5})?")

#: Bucket and prefix.
_BUCKET = re.compile(r"s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[A-Za-z0-9._-]+)*/?")


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

"""Uploads: receive or fetch the bytes of an untrusted file, inspect and store them as a data set or FMU."""

import asyncio
import gzip
import hashlib
import zlib
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import ExitStack, asynccontextmanager
from functools import lru_cache
from os import SEEK_END
from pathlib import Path, PurePosixPath, PureWindowsPath
from time import monotonic
from typing import IO, Any
from urllib.parse import unquote

import httpx

from islands.errors import ModelError, RecordError
from islands.records.reading import READERS
from islands_api.web.auth import Principal
from islands_api.web.dependencies import AppState
from islands_api.web.problems import PayloadTooLargeError
from islands_service.domain.job import QuotaError
from islands_service.domain.uploaded_fmu import FMU_SUFFIX
from islands_service.intake.file_inspection import (
    InspectionLimits,
    InspectionRequest,
    find_limits,
    inspect_file,
)
from islands_service.intake.fmu_inspection import inspect_fmu
from islands_service.intake.job_inputs import link_blob
from islands_service.outbound import MAX_URL, OutboundFailedError, OutboundRefusedError, is_listed
from islands_service.settings import ServiceSettings, split_list
from islands_service.store.blobs import translate_disk_full
from islands_service.store.buckets import ObjectNotFoundError, ObjectStore
from islands_service.store.datasets import StoredDataset

#: Number of bytes that are copied, or collected before they are written, at once.
CHUNK_BYTES = 1 << 20

#: Suffixes that are refused. The reader of MDF writes temporary files, which the inspection forbids.
_REFUSED = (".mf4", ".mdf")

#: Suffixes of uploads; the content of a file with another one decides.
SUFFIXES = tuple(suffix for suffix in READERS if suffix not in _REFUSED)

#: Suffix in the id of a data set whose own suffix is not that of a format.
_OTHER = ".txt"

#: Maximum length in bytes of a file name.
MAX_NAME_BYTES = 200

#: Suffix of compressed files.
GZIP_SUFFIX = ".gz"

#: Redirects that are followed, each to a listed host.
_MAX_REDIRECTS = 3


def parse_file_name(given: str | None) -> tuple[str, bool]:
    """Return the name of a file, without folders and without .gz, and whether the file is compressed.

    Raises
    ------
    RecordError
        The file has no name, or is an MDF file.
    """
    name = PurePosixPath(PureWindowsPath(given or "").name).name
    name = "".join(character for character in name if character.isprintable()).lstrip(".")
    compressed = name.lower().endswith(GZIP_SUFFIX)
    name = name[: -len(GZIP_SUFFIX)] if compressed else name
    suffix = PurePosixPath(name).suffix.lower()
    if not name or suffix in _REFUSED:
        raise RecordError(
            f"{name or 'the file'}: a service reads files of a name that does not end in "
            f"{' or '.join(_REFUSED)}: export the record as one of {', '.join(SUFFIXES)}, or {GZIP_SUFFIX}"
        )
    suffix = suffix if suffix in SUFFIXES else ""
    # A file name has at most 255 bytes on Linux, and the table of data sets stores at most 255 characters.
    stem = name[: len(name) - len(suffix)].encode()[: MAX_NAME_BYTES - len(suffix)].decode(errors="ignore")
    return stem + suffix, compressed


def parse_fmu_name(given: str | None) -> tuple[str, bool]:
    """Return the name of an FMU, and whether it is compressed, as `parse_file_name` does.

    Raises
    ------
    ModelError
        It does not end in .fmu.
    """
    name, compressed = parse_file_name(given)
    if PurePosixPath(name).suffix.lower() != FMU_SUFFIX:
        raise ModelError(f"{name} is no FMU: send a file FILE{FMU_SUFFIX}")
    return name, compressed


def find_stored_suffix(name: str) -> str:
    """Return the suffix that the id of a data set has: its own if it is that of a format."""
    suffix = PurePosixPath(name).suffix.lower()
    return suffix if suffix in SUFFIXES else _OTHER


def receive(
    source: IO[bytes], target: IO[bytes], name: str, compressed: bool, max_bytes: int
) -> tuple[int, str]:
    """Copy a file, decompressed if necessary; return its size in bytes and its SHA-256.

    Raises
    ------
    RecordError
        The file is empty, or its name ends in .gz but it is not gzip.
    PayloadTooLargeError
        The file has more than ``max_bytes`` bytes after decompression: a small file may decompress to any
        size.
    """
    size, digest = 0, hashlib.sha256()
    stream = gzip.GzipFile(fileobj=source, mode="rb") if compressed else source
    try:
        while chunk := stream.read(CHUNK_BYTES):
            size += len(chunk)
            if size > max_bytes:
                raise PayloadTooLargeError(
                    f"{name} has more than {max_bytes / 1e6:.0f} MB after decompression, the maximum here "
                    "for a file of its size: send it uncompressed, or a part of the record"
                )
            target.write(chunk)
            digest.update(chunk)
        target.flush()
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise RecordError(
            f"{name}{GZIP_SUFFIX} is not a gzip file, or is damaged ({error}): compress the record again"
        ) from error
    if size == 0:
        raise RecordError(f"{name} is empty: export the record again")
    return size, digest.hexdigest()


def check_source(url: str, settings: ServiceSettings) -> str:
    """Return a URL as it is stored with the data set: without its query, which may contain a secret.

    Raises
    ------
    OutboundRefusedError
        The URL is neither one of HTTPS nor one of S3, or its host or bucket is not listed.
    """
    if url.startswith("s3://"):
        _check_bucket(url, settings)
        return url
    parsed = _check_host(url, settings)
    return str(parsed.copy_with(query=None, fragment=None))


def find_file_name(source: str) -> str:
    """Return the last part of the path of a URL."""
    return unquote(PurePosixPath(source.partition("://")[2]).name)


def _check_bucket(url: str, settings: ServiceSettings) -> None:
    listed = split_list(settings.dataset_buckets)
    # Some stores resolve these parts like folders; a question mark would select a version.
    odd = {"", ".", ".."} & set(url.removeprefix("s3://").split("/")) or {*"?#\\"} & {*url}
    if odd or len(url) > MAX_URL or not url.isprintable():
        raise OutboundRefusedError("the URL is not one of an object: give s3://BUCKET/KEY")
    if not any(url.startswith(f"{bucket}/") for bucket in listed):
        raise OutboundRefusedError(
            f"{url} is not in a bucket for data sets: ask the operator of this service to list it in "
            "ISLANDS_DATASET_BUCKETS, or upload the file"
        )


def _check_host(url: str, settings: ServiceSettings) -> httpx.URL:
    try:
        parsed = httpx.URL(url) if len(url) <= MAX_URL else None
        host = "" if parsed is None else parsed.host
    except (httpx.InvalidURL, UnicodeError):  # the latter for an invalid international name
        parsed, host = None, ""
    if parsed is None or parsed.scheme != "https" or not host or parsed.userinfo:
        raise OutboundRefusedError(
            f"the URL is none of HTTPS without a password, of at most {MAX_URL} characters: give "
            "https://HOST/PATH or s3://BUCKET/KEY"
        )
    if not is_listed(parsed, frozenset(split_list(settings.dataset_hosts))):
        raise OutboundRefusedError(
            f"{host} is not a host for data sets: ask the operator of this service to list it in "
            "ISLANDS_DATASET_HOSTS, or upload the file"
        )
    return parsed


@asynccontextmanager
async def fetch(state: AppState, caller: Principal, url: str) -> AsyncIterator[IO[bytes]]:
    """Download a file within the limits of an upload; yield it, at its beginning.

    Raises
    ------
    OutboundRefusedError
        The host, or that of a redirect, is not listed or has a private address.
    OutboundFailedError
        The file is not delivered.
    UploadLimitError, QuotaError, PayloadTooLargeError, StorageFullError, ObjectStoreError
    """
    settings = state.settings
    quotas = await state.quotas(caller.owner)
    with state.uploads.admit(caller.owner, quotas.max_uploads):
        stored = await state.run_blocking(state.store.datasets.stored_bytes, caller.owner)
        with (
            state.uploads.reserve(caller.owner, 0, settings.max_upload, stored, quotas.max_stored) as room,
            await state.run_blocking(state.blobs.spool) as target,
        ):
            with translate_disk_full():
                if url.startswith("s3://"):
                    await _copy_object(state, url, target, room)
                else:
                    await _download(state, url, target, room)
            target.seek(0)
            yield target


async def _copy_object(state: AppState, url: str, target: IO[bytes], room: int) -> None:
    bucket, _, key = url.removeprefix("s3://").partition("/")
    try:
        objects = await state.run_blocking(_open_bucket, bucket)
        fits = await state.run_blocking(objects.copy, key, target, room)
    except ObjectNotFoundError as error:
        raise OutboundFailedError(f"there is no object {url}: check the URL") from error
    if not fits:
        raise _make_size_error(room, state.settings)


@lru_cache(maxsize=8)
def _open_bucket(bucket: str) -> ObjectStore:
    return ObjectStore(f"s3://{bucket}")


async def _download(state: AppState, url: str, target: IO[bytes], room: int) -> None:
    until = monotonic() + state.settings.dataset_seconds
    for _ in range(1 + _MAX_REDIRECTS):
        parsed = _check_host(url, state.settings)
        left = max(until - monotonic(), 0.001)
        async with state.outbound.open("GET", url, left) as response:
            if response.next_request is None:
                return await _write(state, parsed.host, response, target, room)
            url = str(response.next_request.url)
    raise OutboundFailedError(f"{parsed.host} redirects more than {_MAX_REDIRECTS} times: give the last URL")


async def _write(state: AppState, host: str, response: httpx.Response, target: IO[bytes], room: int) -> None:
    """Write the body of a response to a file."""
    if response.status_code != httpx.codes.OK:
        raise OutboundFailedError(f"{host} answers with the status {response.status_code}: check the URL")
    if response.headers.get("content-encoding", "identity") != "identity":
        raise OutboundFailedError(f"{host} compresses the response without a request: upload the file")
    size = response.headers.get("content-length", "0")
    if size.isdecimal() and int(size) > room:
        raise _make_size_error(room, state.settings)
    received, buffer = 0, bytearray()
    chunks = response.aiter_raw()
    while True:
        try:
            async with asyncio.timeout(state.settings.body_timeout):
                chunk = await anext(chunks, b"")
        except TimeoutError as error:
            raise OutboundFailedError(
                f"{host} has sent nothing for {state.settings.body_timeout:g} s: try again"
            ) from error
        received += len(chunk)
        buffer += chunk
        if received > room:
            raise _make_size_error(room, state.settings)
        if len(buffer) >= CHUNK_BYTES or not chunk:
            await state.run_blocking(target.write, bytes(buffer))
            buffer.clear()
        if not chunk:
            return


def _make_size_error(room: int, settings: ServiceSettings) -> Exception:
    if room < settings.max_upload:
        return QuotaError("the data sets would take more bytes than their owner may store: delete some")
    return PayloadTooLargeError(f"the file has more than {room / 1e6:.0f} MB, the maximum here")


async def read_again(
    state: AppState, caller: Principal, dataset: StoredDataset, inspection: InspectionRequest
) -> tuple[StoredDataset, bool]:
    """Inspect a data set with other options of reading, and store that as a data set of the same bytes.

    Raises
    ------
    RecordError, SettingsError, QuotaError, BlobNotFoundError, ObjectStoreError, StorageFullError
    """
    settings, owner = state.settings, caller.owner
    async with open_stored(state, owner, dataset) as path:
        preview = await inspect_file(
            path, inspection, settings.inspection_memory, settings.inspection_seconds
        )
    content = dataset.name, dataset.suffix, dataset.blob, dataset.bytes, preview
    return await state.run_blocking(
        state.store.datasets.add,
        *(owner, *content, settings.max_stored, caller.requester, dataset.source, dataset.id),
    )


@asynccontextmanager
async def open_stored(state: AppState, owner: str, dataset: StoredDataset) -> AsyncIterator[Path]:
    """Provide the file of a data set to a process that reads it, with slots of its owner.

    Raises
    ------
    BlobNotFoundError, ObjectStoreError, StorageFullError
    """
    with ExitStack() as files:
        async with state.inspection_slots.hold(owner, find_limits(dataset.bytes, state.settings).slots):
            held = await state.run_blocking(files.enter_context, state.blobs.hold(dataset.blob))
            yield files.enter_context(link_blob(held, dataset.name))


async def store_dataset(
    state: AppState,
    caller: Principal,
    file: IO[bytes],
    name: str,
    compressed: bool,
    inspection: InspectionRequest,
    source: str | None = None,
) -> tuple[StoredDataset, bool]:
    """Inspect a file, and store it as a data set of its owner; return it, and whether it is new.

    Parameters
    ----------
    file : file object
        The bytes as they were received.
    name, compressed
        File name and whether the bytes are compressed: see `parse_file_name`.
    source : str, optional
        URL that is stored as the origin.

    Raises
    ------
    RecordError, QuotaError, PayloadTooLargeError, StorageFullError, ObjectStoreError
    """

    def inspect(path: Path, limits: InspectionLimits) -> Awaitable[Mapping[str, Any]]:
        return inspect_file(path, inspection, limits.memory, state.settings.inspection_seconds)

    return await _store(state, caller, file, (name, find_stored_suffix(name)), compressed, inspect, source)


async def store_fmu(
    state: AppState, caller: Principal, file: IO[bytes], name: str, compressed: bool
) -> tuple[StoredDataset, bool]:
    """Read the description of an FMU, and store it as `store_dataset` does.

    Raises
    ------
    ModelError, SettingsError, QuotaError, PayloadTooLargeError, StorageFullError, ObjectStoreError
    """

    async def inspect(path: Path, limits: InspectionLimits) -> Mapping[str, Any]:
        found = await inspect_fmu(path, limits.unpacked, limits.memory, state.settings.inspection_seconds)
        return {"fmu": found}

    return await _store(state, caller, file, (name, FMU_SUFFIX), compressed, inspect)


async def _store(
    state: AppState,
    caller: Principal,
    file: IO[bytes],
    named: tuple[str, str],
    compressed: bool,
    inspect: Callable[[Path, InspectionLimits], Awaitable[Mapping[str, Any]]],
    source: str | None = None,
) -> tuple[StoredDataset, bool]:
    settings, owner, by = state.settings, caller.owner, caller.requester
    name, suffix = named
    limits = find_limits(file.seek(0, SEEK_END), settings)
    file.seek(0)
    with state.blobs.receiving() as stream:
        async with state.inspection_slots.hold(owner, limits.slots):
            size, blob = await state.run_blocking(receive, file, stream, name, compressed, limits.unpacked)
            with link_blob(Path(stream.name), name) as path:
                preview = await inspect(path, limits)
            await state.run_blocking(
                state.store.datasets.check_room,
                owner,
                suffix,
                blob,
                size,
                settings.max_stored,
                preview.get("reading"),
            )
            # An upload that was rejected before this line is deleted at the end of the block.
            await state.run_blocking(state.blobs.keep, stream)
    stored, new = await state.run_blocking(
        state.store.datasets.add, owner, name, suffix, blob, size, preview, settings.max_stored, by, source
    )
    state.metrics.received.inc(stored.bytes if new else 0)
    return stored, new

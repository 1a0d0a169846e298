"""Download of a record from a URL that a client names: from listed hosts and buckets."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import lru_cache
from pathlib import PurePosixPath
from time import monotonic
from typing import IO
from urllib.parse import unquote

import httpx

from islands_api.web.auth import Principal
from islands_api.web.dependencies import AppState
from islands_api.web.problems import PayloadTooLargeError
from islands_service.domain.job import QuotaError
from islands_service.outbound.addresses import OutboundFailedError, OutboundRefusedError
from islands_service.outbound.checked_client import MAX_URL, is_listed
from islands_service.settings import ServiceSettings, split_list
from islands_service.store.blobs import translate_disk_full
from islands_service.store.object_store import ObjectNotFoundError, ObjectStore

#: Redirects that are followed, each to a listed host.
_MAX_REDIRECTS = 3

#: Bytes that are collected before they are written.
_BUFFER_BYTES = 1 << 20


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
        if len(buffer) >= _BUFFER_BYTES or not chunk:
            await state.run_blocking(target.write, bytes(buffer))
            buffer.clear()
        if not chunk:
            return


def _make_size_error(room: int, settings: ServiceSettings) -> Exception:
    if room < settings.max_upload:
        return QuotaError("the data sets would take more bytes than their owner may store: delete some")
    return PayloadTooLargeError(f"the file has more than {room / 1e6:.0f} MB, the maximum here")

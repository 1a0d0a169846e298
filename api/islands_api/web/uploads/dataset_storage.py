"""Inspection and storage of a received file as a data set, or as an FMU."""

from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import ExitStack, asynccontextmanager
from os import SEEK_END
from pathlib import Path
from typing import IO, Any

from islands_api.web.auth import Principal
from islands_api.web.dependencies import AppState
from islands_api.web.uploads.uploaded_file import find_stored_suffix, receive
from islands_service.domain.uploaded_fmu import FMU_SUFFIX
from islands_service.intake.file_inspection import (
    InspectionLimits,
    InspectionRequest,
    find_limits,
    inspect_file,
)
from islands_service.intake.fmu_inspection import inspect_fmu
from islands_service.intake.job_inputs import link_blob
from islands_service.store.datasets import StoredDataset


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

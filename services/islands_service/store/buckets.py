"""Objects in a bucket of an S3-compatible store, through s3fs (extra ``s3``).

Endpoint and credentials are those of the standard environment variables and files of AWS, such as
``AWS_ENDPOINT_URL``, ``AWS_ACCESS_KEY_ID`` and ``AWS_SHARED_CREDENTIALS_FILE``; botocore reads them.
"""

import os
import shutil
from collections.abc import Callable, Iterator
from datetime import datetime
from errno import EDQUOT, ENOSPC
from importlib import import_module
from pathlib import Path
from time import monotonic, sleep
from typing import IO, Any, TypeVar

from islands.distribution import describe_missing_extra
from islands.errors import IslandsError, SettingsError
from islands_service.store.database import StoreUnavailableError

T = TypeVar("T")

#: Pauses in seconds between the attempts at a request that the store does not answer.
RETRY_PAUSES = (0.2, 0.6, 1.8)

#: Seconds since the first attempt after which there is no further one.
RETRY_SECONDS = 30.0

#: Seconds until a connection, and without a byte of an answer.
_CONNECT_TIMEOUT, _READ_TIMEOUT = 3.0, 20.0

#: Bytes of a part of a large object, and parts that are transferred at once.
_PART_BYTES, _PARTS_AT_ONCE = 16_000_000, 4

#: Object that shows that the prefix can be written.
_MARKER = "islands-store"

#: Codes of answers with which the store refuses the credentials, or the time of the clock.
_REFUSALS = frozenset(
    {
        *("AccessDenied", "AllAccessDisabled", "ExpiredToken", "InvalidAccessKeyId", "InvalidToken", "403"),
        *("NoSuchBucket", "PermanentRedirect", "RequestTimeTooSkewed", "SignatureDoesNotMatch"),
        *("AuthorizationHeaderMalformed", "InvalidBucketName", "IllegalLocationConstraintException", "301"),
    }
)


class ObjectStoreError(StoreUnavailableError):
    """The object store does not answer. Nothing was lost; try again."""


class ObjectStoreRefusedError(ObjectStoreError):
    """The object store refuses the service: its operator has to check bucket and credentials."""


class ObjectNotFoundError(IslandsError):
    """The object store has no such object."""


class ObjectStore:
    """Objects under a prefix of a bucket.

    Parameters
    ----------
    url : str
        ``s3://BUCKET/PREFIX``

    Raises
    ------
    SettingsError
        The extra ``s3`` is not installed.
    """

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        self._root = self.url.removeprefix("s3://")
        #: Called with the name, the outcome and the seconds of each operation.
        self.observe: Callable[[str, str, float], None] = _ignore_operation
        try:
            s3fs = import_module("s3fs")
        except ImportError as error:
            raise SettingsError(
                f"{describe_missing_extra('the setting ISLANDS_BLOB_STORE', 's3')}; without the setting, "
                "blobs are in the data folder"
            ) from error
        self._files = s3fs.S3FileSystem(
            # Attempts are counted by `_call`, over all layers.
            config_kwargs={
                "connect_timeout": _CONNECT_TIMEOUT,
                "read_timeout": _READ_TIMEOUT,
                "retries": {"mode": "standard", "total_max_attempts": 1},
                "max_pool_connections": 32,
            },
            default_block_size=_PART_BYTES,
            max_concurrency=_PARTS_AT_ONCE,
            use_listings_cache=False,
            skip_instance_cache=True,
        )
        self._files.retries = 1
        # Other errors than those of the operating system, by the libraries that s3fs consists of.
        self._failures = (
            OSError,
            import_module("botocore.exceptions").BotoCoreError,
            import_module("botocore.exceptions").ClientError,
            import_module("botocore.parsers").ResponseParserError,
            import_module("aiohttp").ClientError,
        )
        self._no_credentials = (
            import_module("botocore.exceptions").NoCredentialsError,
            import_module("botocore.exceptions").PartialCredentialsError,
            import_module("botocore.exceptions").CredentialRetrievalError,
        )

    def put(self, key: str, path: Path) -> None:
        """Store a file as an object. It appears completely or not at all, and replaces an earlier one.

        Raises
        ------
        ObjectStoreError
        """
        self._call(
            "put",
            lambda: self._files.put_file(
                os.fspath(path), self._at(key), chunksize=_PART_BYTES, max_concurrency=_PARTS_AT_ONCE
            ),
        )

    def get(self, key: str, path: Path) -> None:
        """Write an object to a file.

        Raises
        ------
        ObjectNotFoundError, ObjectStoreError
        OSError
            The disk is full.
        """
        self._call("get", lambda: self._files.get_file(self._at(key), os.fspath(path)))

    def copy(self, key: str, target: IO[bytes], most: int) -> bool:
        """Write an object to an open file, unless it has more than ``most`` bytes; return whether it was.

        Raises
        ------
        ObjectNotFoundError, ObjectStoreError
        OSError
            The disk is full.
        """

        def read() -> bool:
            target.seek(0)
            target.truncate()
            # The size is that at the opening, and the parts are of the version that was opened.
            with self._files.open(self._at(key), "rb", block_size=_PART_BYTES) as source:
                fits = source.size <= most
                if fits:
                    shutil.copyfileobj(source, target, 1 << 20)
            return bool(fits)

        return self._call("copy", read)

    def move(self, key: str, to: str) -> None:
        """Rename an object.

        Raises
        ------
        ObjectNotFoundError, ObjectStoreError
        """
        self._call("move", lambda: self._files.cp_file(self._at(key), self._at(to)))
        self.delete(key)

    def delete(self, key: str) -> None:
        """Delete an object, which may be missing.

        Raises
        ------
        ObjectStoreError
        """
        self._call("delete", lambda: self._files.rm_file(self._at(key)))

    def all(self) -> Iterator[tuple[str, float]]:
        """Yield the key of every object, and the time at which it was stored, in seconds since 1970.

        Raises
        ------
        ObjectStoreError
        """
        found = self._call("list", lambda: self._files.find(self._root, detail=True))
        for name, about in found.items():
            modified: datetime = about["LastModified"]
            yield name.removeprefix(f"{self._root}/"), modified.timestamp()

    def check(self) -> None:
        """Ensure that the store answers and accepts the credentials, in one attempt.

        Raises
        ------
        ObjectStoreError
        """
        try:
            # A single request for the bytes: the answer to one for the headers has no reason of a refusal.
            marker = self._at(_MARKER)
            self._call("check", lambda: self._files.cat_file(marker, max_concurrency=1), pauses=())
        except ObjectNotFoundError:
            self._call("check", lambda: self._files.pipe_file(self._at(_MARKER), b"1"), pauses=())

    def _at(self, key: str) -> str:
        return f"{self._root}/{key}"

    def _call(self, name: str, request: Callable[[], T], pauses: tuple[float, ...] = RETRY_PAUSES) -> T:
        """Send a request, again if the store does not answer."""
        began = monotonic()
        for pause in (*pauses, None):
            started = monotonic()
            try:
                answer = request()
            except self._failures as error:
                translated = self._translate(error)
                self.observe(name, _outcome(translated), monotonic() - started)
                passing = type(translated) is ObjectStoreError
                if not passing or pause is None or monotonic() - began > RETRY_SECONDS:
                    raise translated from error
                sleep(pause)
            else:
                self.observe(name, "done", monotonic() - started)
                return answer
        raise AssertionError("unreachable")

    def _translate(self, error: Exception) -> Exception:
        if isinstance(error, OSError) and error.errno in (ENOSPC, EDQUOT):
            return error
        code = _find_code(error)
        if isinstance(error, self._no_credentials):
            return ObjectStoreRefusedError(
                f"{self.url} needs credentials, and there are none: set AWS_ACCESS_KEY_ID and "
                "AWS_SECRET_ACCESS_KEY, or AWS_SHARED_CREDENTIALS_FILE"
            )
        if code == "NoSuchBucket":
            return ObjectStoreRefusedError(
                f"the store has no bucket for {self.url}: create it, or correct ISLANDS_BLOB_STORE"
            )
        if code in _REFUSALS or (not code and isinstance(error, PermissionError)):
            return ObjectStoreRefusedError(
                f"the store refuses access to {self.url} ({code or error}): check the credentials, their "
                "permissions, AWS_ENDPOINT_URL and AWS_REGION"
            )
        if isinstance(error, FileNotFoundError):
            return ObjectNotFoundError(f"{self.url} has no such object")
        return ObjectStoreError(
            f"{self.url} does not answer ({code or type(error).__name__}): check the store and "
            "AWS_ENDPOINT_URL"
        )


def _find_code(error: BaseException) -> str:
    """Return the code of the store's answer; empty if there was none."""
    cause: BaseException | None = error
    while cause is not None:
        answer: dict[str, Any] | None = getattr(cause, "response", None)
        if isinstance(answer, dict):
            return str(answer.get("Error", {}).get("Code", ""))
        cause = cause.__cause__
    return ""


def _outcome(error: Exception) -> str:
    match error:
        case ObjectNotFoundError():
            return "missing"
        case ObjectStoreRefusedError():
            return "refused"
        case ObjectStoreError():
            return "unavailable"
    return "failed"


def _ignore_operation(name: str, outcome: str, seconds: float) -> None:
    """Ignore an operation."""

"""Memory of the API process while many keys upload at once.

    python -m lab.service.uploads [--repeat 5] [--json FILE]

Each of 20 keys sends four files of 20 MB without their last byte, so that all accepted ones are in progress
at the same time.
"""

import asyncio
import sys
import tempfile
from collections.abc import Iterator
from contextlib import AsyncExitStack
from pathlib import Path
from urllib.parse import urlsplit

from islands_service.settings import ServiceSettings
from islands_service.store import Store
from lab.service.table import Figure, run
from support.service_processes import Service, serving

#: Keys, uploads of each at once, and bytes of a file.
KEYS, UPLOADS, BYTES = 20, 4, 20_000_000

#: Part of a file.
BLOCK = b"0,1,2,3,\n0" * 10_000

#: Bytes of a form before its file.
START = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.csv"\r\n\r\n'

#: Most megabytes by which the API process may grow.
GOAL = 100.0


def uploads(repeat: int) -> Iterator[Figure]:
    """Measure the growth of the API process, and the number of uploads that it receives at once."""
    growth, received = [], []
    for _ in range(repeat):
        with (
            tempfile.TemporaryDirectory(prefix="islands-uploads-") as folder,
            serving(Path(folder) / "data", environment={"ISLANDS_COORDINATORS": "0"}) as service,
        ):
            with Store(ServiceSettings(data_dir=service.folder).url) as store:
                secrets = [
                    store.keys.create(f"key {number}", frozenset({"write"}), owner=f"owner {number}")[1]
                    for number in range(KEYS)
                ]
            before = read_peak(service)
            received.append(asyncio.run(_count_received(service, secrets)))
            growth.append(read_peak(service) - before)
    title = f"{KEYS * UPLOADS} uploads of {BYTES / 1e6:.0f} MB"
    yield Figure(f"{title}: growth of the API process", "MB", GOAL, tuple(growth))
    yield Figure(f"{title}: received at once", "", None, tuple(received))


def read_peak(service: Service) -> float:
    """Return the peak of the resident memory of the API process in MB."""
    lines = Path(f"/proc/{service.one('api')}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / 1e3


async def _count_received(service: Service, secrets: list[str]) -> int:
    """Send all uploads, and return how many the service receives at the same time."""
    address = urlsplit(service.url)
    async with AsyncExitStack() as connections:
        sending = (
            _is_received(connections, address.hostname, address.port, secret)
            for secret in secrets
            for _ in range(UPLOADS)
        )
        return sum(await asyncio.gather(*sending))


async def _is_received(connections: AsyncExitStack, host: str | None, port: int | None, secret: str) -> bool:
    """Send an upload without its last byte; return whether it was received, and leave the connection open."""
    reader, writer = await asyncio.open_connection(host, port)
    connections.callback(writer.close)
    head = (
        f"POST /v1/datasets HTTP/1.1\r\nHost: {host}:{port}\r\nAuthorization: Bearer {secret}\r\n"
        f"Content-Type: multipart/form-data; boundary=b\r\nContent-Length: {len(START) + BYTES + 1}\r\n\r\n"
    )
    try:
        writer.write(head.encode() + START)
        for _ in range(BYTES // len(BLOCK)):
            writer.write(BLOCK)
            await writer.drain()
        # A refusal arrives at once, and an upload in progress has no response.
        await asyncio.wait_for(reader.read(1), 5.0)
    except TimeoutError:
        return True
    except OSError:
        return False
    return False


if __name__ == "__main__":
    sys.exit(run({"uploads": uploads}, __doc__))

"""Ray head of a test session: a separate process that tests connect to by its address."""

import os
import secrets
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from support.processes import eventually


@contextmanager
def ray_head(folder: Path) -> Iterator[str]:
    """Start the Ray head process of the service and yield its address."""
    # Ray reads the token once per process, so all clusters of this process have the same token.
    token = os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(16))
    environment = {**os.environ, "ISLANDS_DATA_DIR": str(folder), "RAY_AUTH_TOKEN": token}
    # The head ends with this process, also if this process is killed.
    wrapper = [setpriv, "--pdeathsig", "TERM"] if (setpriv := shutil.which("setpriv")) else []
    command = [*wrapper, sys.executable, "-m", "islands_service.runtime.ray_head"]
    address = folder / "ray-address"
    with (folder / "head.log").open("w") as log:
        head = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    try:
        eventually(lambda: address.exists() or head.poll() is not None, seconds=120.0)
        assert head.poll() is None, (folder / "head.log").read_text()
        yield address.read_text()
    finally:
        head.terminate()
        head.wait(60)

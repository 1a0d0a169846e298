"""Client of a service that runs in this process or in others: requests that are repeated, and jobs."""

import ssl
import time
from pathlib import Path
from typing import Any

import httpx

from support.command_line import write_hysteresis
from support.processes import eventually

TERMINAL = ("succeeded", "failed", "cancelled")

#: A search with some hundred epochs, each a few milliseconds long. Trials of the preset would take longer.
SPEC = {
    "inputs": ["u_V"],
    "output": "y_um",
    "seed": 2,
    "preset": "hysteresis",
    "settings": {"population": 30, "max_terms": 5, "shooting": 200, "islands": 2, "migrate_every": 1},
}


class ServiceClient:
    """Client of a running service, whose data folder it knows. It retries after lost connections."""

    def __init__(
        self, url: str, folder: Path, tls: ssl.SSLContext | None = None, patience: float = 60.0
    ) -> None:
        self.url, self.folder, self.patience = url, folder, patience
        self.log = folder.with_suffix(".log")
        self.client = httpx.Client(base_url=url, timeout=30.0, verify=tls or True, trust_env=False)
        self._dataset = ""

    def ask(self, method: str, path: str, **asked: Any) -> httpx.Response:
        """Send a request; retry while the connection is lost, or the database is away or in doubt."""
        deadline = time.monotonic() + self.patience
        while True:
            try:
                answer = self.client.request(method, path, **asked)
                if answer.status_code not in (503, 504):
                    return answer
            except httpx.TransportError:
                if time.monotonic() > deadline:
                    raise
            assert time.monotonic() < deadline, self._describe()
            time.sleep(0.02)

    def ready(self) -> None:
        assert self.ask("GET", "/readyz").status_code == 200

    @property
    def dataset(self) -> str:
        """Id of the data set of all jobs; uploaded at the first use."""
        if not self._dataset:
            path = self.folder.with_suffix(".csv")
            if not path.exists():
                write_hysteresis(path)
            answer = self.ask("POST", "/v1/datasets", files={"file": (path.name, path.read_bytes())})
            assert answer.status_code in (200, 201), answer.text
            self._dataset = answer.json()["id"]
        return self._dataset

    def submit(self, generations: int, key: str | None = None, **changes: Any) -> str:
        spec = {**SPEC, "dataset": self.dataset, **changes}
        spec["settings"] = {**SPEC["settings"], "generations": generations, **changes.get("settings", {})}  # type: ignore[dict-item]
        headers = {} if key is None else {"Idempotency-Key": key}
        answer = self.ask("POST", "/v1/jobs", json=spec, headers=headers)
        assert answer.status_code == 202, answer.text
        identity: str = answer.json()["id"]
        return identity

    def job(self, job: str) -> dict[str, Any]:
        answer = self.ask("GET", f"/v1/jobs/{job}")
        assert answer.status_code == 200, answer.text
        document: dict[str, Any] = answer.json()
        return document

    def generation(self, job: str) -> int:
        return int((self.job(job)["progress"] or {}).get("generation", 0))

    def under_way(self, job: str, generation: int = 10) -> int:
        """Wait until a job has reached a generation; return its current one."""
        return int(str(eventually(lambda: (at := self.generation(job)) >= generation and at)))

    def ended(self, job: str, seconds: float = 240.0) -> dict[str, Any]:
        """Wait until a job has ended and return it."""
        deadline, tag = time.monotonic() + seconds, ""
        while True:
            answer = self.ask(
                "GET", f"/v1/jobs/{job}", params={"wait": 5}, headers={"If-None-Match": tag} if tag else {}
            )
            if answer.status_code == 200:
                document: dict[str, Any] = answer.json()
                tag = answer.headers["etag"]
                if document["state"] in TERMINAL:
                    return document
            assert time.monotonic() < deadline, (self.job(job), self._describe())

    def models(self, job: str) -> bytes:
        """Return the response of ``GET /v1/jobs/{id}/models``, byte for byte."""
        answer = self.ask("GET", f"/v1/jobs/{job}/models")
        assert answer.status_code == 200, answer.text
        return answer.content

    def found(self, job: str, seconds: float = 120.0) -> bytes:
        """Wait until a job has succeeded and return its models."""
        ended = self.ended(job, seconds)
        assert ended["state"] == "succeeded", ended
        return self.models(job)

    def _describe(self) -> str:
        """Return the log of the processes of the service."""
        return self.log.read_text() if self.log.exists() else ""

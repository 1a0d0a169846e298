"""Opening of the page in the browser, when the service is ready."""

from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Thread

import pytest

from islands_api.cli.commands import serve
from islands_api.cli.service import page_opening


class Starting(BaseHTTPRequestHandler):
    """A service that is ready at the third question."""

    asked: list[str]

    def do_GET(self) -> None:
        self.asked.append(self.path)
        self.send_response(200 if len(self.asked) > 2 else 503)
        self.end_headers()

    def log_message(self, *_: object) -> None: ...


@pytest.fixture
def port() -> Iterator[int]:
    Starting.asked = []
    with HTTPServer(("127.0.0.1", 0), Starting) as server:
        thread = Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield server.server_port
        server.shutdown()
        thread.join()


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Addresses that were opened, each with the number of questions before."""
    found: list[tuple[str, int]] = []
    monkeypatch.setattr(page_opening, "_EVERY", 0.01)
    monkeypatch.setattr(
        page_opening.webbrowser, "open", lambda page: found.append((page, len(Starting.asked))) or True
    )
    return found


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_the_page_opens_once_and_not_before_the_service_is_ready(
    port: int, opened: list[tuple[str, int]], host: str
) -> None:
    page_opening.open_when_ready(f"http://{host}:{port}").join(10)
    assert opened == [(f"http://127.0.0.1:{port}/", 3)]
    assert set(Starting.asked) == {"/readyz"}


def test_a_service_that_does_not_answer_opens_nothing(
    opened: list[tuple[str, int]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(page_opening, "_TIMEOUT", 0.1)
    page_opening.open_when_ready("http://127.0.0.1:9").join(10)
    assert opened == []
    assert "the service is not ready: open http://127.0.0.1:9/ later" in capsys.readouterr().err


def test_a_machine_without_a_browser_states_the_address(
    port: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(page_opening.webbrowser, "open", lambda _: False)
    page_opening.open_when_ready(f"http://127.0.0.1:{port}").join(10)
    assert f"this machine has no browser: open http://127.0.0.1:{port}/" in capsys.readouterr().err


@pytest.mark.parametrize("options", [(), ("--open",)])
def test_serve_opens_the_page_if_it_is_asked_to(command_line, monkeypatch, tmp_path, options) -> None:
    asked: list[str] = []
    monkeypatch.setattr(serve, "open_when_ready", asked.append)
    monkeypatch.setattr(serve, "supervise", lambda *_: 0)
    code, _, _ = command_line("serve", "--data-dir", tmp_path / "data", "--port", 8017, *options)
    assert code == 0
    assert asked == ["http://127.0.0.1:8017"] * len(options)

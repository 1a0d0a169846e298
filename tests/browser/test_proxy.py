"""Dashboard behind a proxy that knows users by a cookie, and adds the header Authorization."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import httpx
import pytest

from support.played import stored
from support.screen import Screen
from support.service_client import ServiceClient

COOKIE = "_oauth2_proxy=session"


@contextmanager
def logging_in(url: str, token: str) -> Iterator[str]:
    """Serve the service at a URL through a proxy that refuses requests without its cookie; yield its URL."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if self.headers.get("Cookie") != COOKIE:
                self.send_error(401, "log in")
                return
            headers = {"Authorization": f"Bearer {token}", "Accept-Encoding": "identity"}
            answer = client.get(self.path, headers=headers)
            self.send_response(answer.status_code)
            for name in ("Content-Type", "Content-Security-Policy"):
                if name in answer.headers:
                    self.send_header(name, answer.headers[name])
            self.send_header("Content-Length", str(len(answer.content)))
            self.end_headers()
            self.wfile.write(answer.content)

        def log_message(self, *_: Any) -> None:
            pass

    with httpx.Client(base_url=url, timeout=30.0, trust_env=False) as client:
        server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()
            server.server_close()


@pytest.mark.ci
def test_the_dashboard_needs_no_key_behind_a_proxy_that_adds_a_token(
    screens: Callable[..., Screen], hosted: Callable[..., Any], expect: Any
) -> None:
    with hosted(require_keys=True) as service:
        assert isinstance(service, ServiceClient)
        with stored(service) as store:
            secret = store.keys.create("proxy", frozenset({"read", "write"}))[1]
        with logging_in(service.url, secret) as url:
            screen = screens(url)
            screen.page.context.add_cookies([{"name": "_oauth2_proxy", "value": "session", "url": url}])
            page = screen.go()
            expect(page.get_by_role("heading", name="No jobs yet")).to_be_visible()
            assert page.evaluate("sessionStorage.getItem('islands.key')") is None

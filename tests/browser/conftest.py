"""Fixtures for tests of the dashboard in a real browser with a real web server.

Without playwright or Chromium these tests are skipped. Fixtures have module scope: playwright keeps an
event loop running in this thread, and tests of other modules may need a separate one.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from islands_service.store import Store
from support.screen import Screen
from support.service_client import ServiceClient
from support.service_processes import serving

CHROMIUM = Path("/usr/bin/chromium")

#: Stores a key in the session storage of the dashboard.
STORE_KEY = "sessionStorage.setItem('islands.key', {})"

_INSTALL = "install it with 'apt-get install --no-install-recommends chromium'"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: run: make .venv/ready-test"
    )
    if not CHROMIUM.exists():
        pytest.skip(f"there is no {CHROMIUM}: {_INSTALL}")
    # The machine may be busy. Successful assertions do not wait.
    api.expect.set_options(timeout=20_000)
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"]
        )
        yield browser
        browser.close()


@pytest.fixture
def expect(chromium: Any) -> Any:
    """Assertions of playwright, which wait until they are true."""
    from playwright.sync_api import expect

    return expect


@pytest.fixture
def screens(chromium: Any) -> Iterator[Callable[..., Screen]]:
    """Factory of screens, each with a separate browser context without stored data."""
    made: list[Screen] = []

    def make(origin: str, width: int = 1280, height: int = 800, **options: Any) -> Screen:
        context = chromium.new_context(viewport={"width": width, "height": height}, **options)
        made.append(Screen(context.new_page(), origin))
        return made[-1]

    yield make
    for screen in made:
        screen.page.context.close()
    # In every test: no request goes to another origin.
    assert [screen.foreign for screen in made] == [[]] * len(made)


@pytest.fixture
def quiet(screens: Callable[..., Screen]) -> Iterator[Callable[..., Screen]]:
    """Factory of screens on which no error or warning may occur."""
    made: list[Screen] = []

    def make(*arguments: Any, **options: Any) -> Screen:
        made.append(screens(*arguments, **options))
        return made[-1]

    yield make
    assert [screen.complaints for screen in made] == [[]] * len(made)


@pytest.fixture(scope="session")
def hosted(serve: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """Factory of services in a thread, without coordinators: tests change the state of jobs themselves."""

    @contextmanager
    def run(**settings: object) -> Iterator[ServiceClient]:
        folder = tmp_path_factory.mktemp("hosted") / "data"
        folder.mkdir()
        with serve(folder, rate=0, **settings) as running:
            service = ServiceClient(running.url, folder)
            if running.settings.keys_needed:
                service.client.headers.update(running.key())
            with service.client:
                yield service

    return run


@pytest.fixture(scope="module")
def service(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServiceClient]:
    """A service in processes that needs a key; its client has one. It may end while it draws figures."""
    folder = tmp_path_factory.mktemp("service") / "data"
    folder.mkdir()
    with Store(f"sqlite:///{folder / 'islands.db'}") as store:
        _, secret = store.keys.create("test", frozenset({"read", "write"}))
    with serving(folder, "--coordinators", 0, "--require-keys") as running:
        running.client.headers["Authorization"] = f"Bearer {secret}"
        yield running


@pytest.fixture
def opened(quiet: Callable[..., Screen], service: ServiceClient) -> Callable[..., Any]:
    """Function that opens an address of the service of the module with a stored key."""

    def open_at(place: str, **options: Any) -> Any:
        screen = quiet(service.url, **options)
        secret = service.client.headers["Authorization"].removeprefix("Bearer ")
        screen.page.add_init_script(STORE_KEY.format(json.dumps(secret)))
        return screen.go(place)

    return open_at


@pytest.fixture(scope="module")
def desk(chromium: Any, hosted: Callable[..., Any]) -> Iterator[ServiceClient]:
    """A service that needs no key."""
    with hosted() as running:
        yield running

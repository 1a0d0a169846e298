"""A real browser before a real service: what every test of the page looks through.

Without playwright or Chromium these tests are skipped. Fixtures live as long as a module: playwright keeps an
event loop running in this thread meanwhile, and other modules' tests may need one of their own.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from islands_service.store import Store
from support.screen import Screen
from support.service_processes import Service, serving

CHROMIUM = Path("/usr/bin/chromium")

#: Puts a key where the page keeps it.
KEPT = "sessionStorage.setItem('islands.key', {})"

_INSTALL = "install it with 'apt-get install --no-install-recommends chromium'"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: it comes with the extra 'dev'"
    )
    if not CHROMIUM.exists():
        pytest.skip(f"there is no {CHROMIUM}: {_INSTALL}")
    # The machine may be busy; a page that is right is not waited for.
    api.expect.set_options(timeout=20_000)
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def expect(chromium: Any) -> Any:
    """Playwright's assertions, which wait until they hold."""
    from playwright.sync_api import expect

    return expect


@pytest.fixture
def screens(chromium: Any) -> Iterator[Callable[..., Screen]]:
    """Makes screens: each a browser of somebody else's, with nothing kept from before."""
    made: list[Screen] = []

    def make(origin: str, width: int = 1280, height: int = 800, **options: Any) -> Screen:
        context = chromium.new_context(viewport={"width": width, "height": height}, **options)
        made.append(Screen(context.new_page(), origin))
        return made[-1]

    yield make
    for screen in made:
        screen.page.context.close()
    # Whatever else a test is about: nothing is asked of anybody else, ever.
    assert [screen.foreign for screen in made] == [[]] * len(made)


@pytest.fixture
def quiet(screens: Callable[..., Screen]) -> Iterator[Callable[..., Screen]]:
    """Makes screens in which nothing may go wrong."""
    made: list[Screen] = []

    def make(*arguments: Any, **options: Any) -> Screen:
        made.append(screens(*arguments, **options))
        return made[-1]

    yield make
    assert [screen.complaints for screen in made] == [[]] * len(made)


@pytest.fixture(scope="module")
def guarded(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """What runs a service that needs a key, which its client has."""

    @contextmanager
    def run(*options: object) -> Iterator[Service]:
        folder = tmp_path_factory.mktemp("guarded") / "data"
        folder.mkdir()
        with Store(f"sqlite:///{folder / 'islands.db'}") as store:
            _, secret = store.keys.create("test", frozenset({"read", "write"}))
        with serving(folder, "--require-keys", *options) as service:
            service.client.headers["Authorization"] = f"Bearer {secret}"
            yield service

    return run


@pytest.fixture
def opened(quiet: Callable[..., Screen], service: Service) -> Callable[..., Any]:
    """Opens an address of the module's service, with the key at hand."""

    def open_at(place: str, **options: Any) -> Any:
        screen = quiet(service.url, **options)
        secret = service.client.headers["Authorization"].removeprefix("Bearer ")
        screen.page.add_init_script(KEPT.format(json.dumps(secret)))
        return screen.go(place)

    return open_at


@pytest.fixture(scope="module")
def desk(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """A service that carries nothing out: a test plays the coordinator, and says what happens to a job."""
    with serving(tmp_path_factory.mktemp("desk") / "data", "--coordinators", 0) as service:
        yield service

"""Choice of the engine of a search: a name, a Ray cluster, or an engine object.

The core runs islands serially. Other engines are installed packages, which register a factory under the entry
point group `GROUP`: a name, and a context manager ``factory(address, progress, cpus)`` that yields an engine.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.metadata import entry_points

from islands.distribution import describe_missing_extra
from islands.errors import SettingsError, check_integers, lookup
from islands.evolution.engine import Engine, SerialEngine
from islands.progress import ProgressCallback, ignore_progress

#: Entry point group of the factories of engines.
GROUP = "islands.engines"


@dataclass(frozen=True, slots=True)
class Ray:
    """Ray as the engine of a search: ``islands.identify(record, engine=islands.Ray(cpus=4))``.

    Attributes
    ----------
    address : str or None
        ``HOST:PORT`` of the head of a Ray cluster. None: Ray is started on this machine and ends with the
        search.
    cpus : int or None
        Number of cores of this machine that Ray uses. None: all that this process may use.

    Raises
    ------
    SettingsError
        There is less than one core, or a number of cores is given for a cluster, which has its own.
    """

    address: str | None = None
    cpus: int | None = None

    def __post_init__(self) -> None:
        check_integers(cpus=self.cpus)
        if self.cpus is not None and self.cpus < 1:
            raise SettingsError(f"Ray needs at least 1 core, got cpus = {self.cpus}")
        if self.cpus is not None and self.address is not None:
            raise SettingsError(f"the cluster {self.address} has its own cores: leave cpus out")


@contextmanager
def open_engine(
    choice: Engine | Ray | str | None, progress: ProgressCallback = ignore_progress
) -> Iterator[Engine]:
    """Open the chosen engine for a ``with`` block; an engine object is used as it is and not closed.

    Parameters
    ----------
    choice : Engine, Ray, str or None
        ``serial``, ``ray``, the name of another installed engine, or None for the serial one.
    progress : ProgressCallback
        Receives the messages of the engine, for example about a lost process.

    Raises
    ------
    SettingsError
        No installed engine has this name, or its package is not installed.
    """
    if isinstance(choice, Ray):
        name, address, cpus = "ray", choice.address, choice.cpus
    elif choice is None or isinstance(choice, str):
        name, address, cpus = choice or "serial", None, None
    else:
        yield choice
        return
    if name == "serial":
        yield SerialEngine()
        return
    installed = {each.name: each for each in entry_points(group=GROUP)}
    lookup({"serial": None, **installed}, name, "engine")
    with ExitStack() as stack:
        try:
            engine = stack.enter_context(installed[name].load()(address, progress, cpus))
        except ImportError as error:
            if name == "ray":
                raise SettingsError(describe_missing_extra("the engine 'ray'", "ray")) from error
            raise SettingsError(
                f"the engine {name!r} needs the package {error.name}, which is not installed"
            ) from error
        yield engine

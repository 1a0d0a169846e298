"""Tasks of a reproduction: independent, deterministic pieces of work whose results are stored.

A task stores its result in a file as soon as it ends, in the process that has computed it. An interrupted
run repeats those tasks only that had not ended.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import islands
from islands.distribution import read_version
from islands.errors import SettingsError
from islands.parallel import ParallelMap
from islands.persistence.checkpoints import replace_file
from islands.progress import ProgressCallback, ignore_progress

#: Result of a task as a JSON document.
Document = dict[str, Any]


@dataclass(frozen=True, slots=True)
class ReproductionOptions:
    """Extent of a reproduction.

    Attributes
    ----------
    seeds : int
        Searches of case 1, each with another seed.
    runs : int
        Monte Carlo runs of Appendix A for each system and pruning probability.
    quick : bool
        Whether searches are short, so that everything takes a minute. The numbers are not those of the paper.
    data : str
        File with the measured record of case 2; empty for a simulated record in its place.
    """

    seeds: int = 10
    runs: int = 50
    quick: bool = False
    data: str = ""

    def __post_init__(self) -> None:
        for name, value in (("seeds", self.seeds), ("runs", self.runs)):
            if value < 1:
                raise SettingsError(f"{name} is at least 1, got {value}")


@dataclass(frozen=True, slots=True)
class Task:
    """One call of a function.

    Attributes
    ----------
    key : str
        Unique name; it is the name of the file with the result.
    function : callable
        Function of a module. Its result is a JSON document without NaN, equal for equal arguments.
    arguments : tuple
        Positional arguments, which are JSON values: numbers, texts, and lists and mappings of them.
    """

    key: str
    function: Callable[..., Document]
    arguments: tuple[Any, ...] = ()

    @property
    def fingerprint(self) -> str:
        """Hash of all that the result depends on: the function, its arguments and the sources."""
        name = f"{self.function.__module__}.{self.function.__qualname__}"
        return sha256(
            json.dumps([name, self.arguments, read_version(), _hash_sources()], sort_keys=True).encode()
        ).hexdigest()


def run_tasks(
    tasks: Sequence[Task],
    folder: Path,
    parallel_map: ParallelMap = map,
    report: ProgressCallback = ignore_progress,
) -> dict[str, Document]:
    """Run the tasks whose results are not stored, and return the results of all.

    Parameters
    ----------
    tasks : sequence of Task
        Tasks with different keys.
    folder : Path
        Folder of the stored results, ``<key>.json``; it is created. A stored result is used if function,
        arguments and sources are unchanged.
    parallel_map : ParallelMap
        The built-in `map`, or a map on several cores of this machine. Results do not depend on it.
    report : ProgressCallback
        Receives the number of finished tasks, and the finished fraction of those that this call runs.

    Returns
    -------
    dict
        Results by key, in the order of the tasks.

    Raises
    ------
    SettingsError
        Two tasks have the same key.
    """
    if len({task.key for task in tasks}) < len(tasks):
        raise SettingsError(f"tasks need different keys, got {', '.join(task.key for task in tasks)}")
    folder.mkdir(parents=True, exist_ok=True)
    results = read_results(tasks, folder)
    missing = [task for task in tasks if task.key not in results]
    stored = len(results)
    report(f"{stored} of {len(tasks)} tasks", 0.0)
    for done, (task, result) in enumerate(
        zip(missing, parallel_map(partial(_run, folder), missing), strict=True), start=1
    ):
        results[task.key] = result
        report(f"{stored + done} of {len(tasks)} tasks", done / len(missing))
    return {task.key: results[task.key] for task in tasks}


def read_results(tasks: Sequence[Task], folder: Path) -> dict[str, Document]:
    """Return the stored results of the tasks by key, without those that have to be computed."""
    found = {task.key: _read_result(task, folder) for task in tasks}
    return {key: result for key, result in found.items() if result is not None}


def _run(folder: Path, task: Task) -> Document:
    """Run one task, store its result, and return it as it is read from the file."""
    document = {"fingerprint": task.fingerprint, "result": task.function(*task.arguments)}
    # A stored result that is read back equals this one, also the type of its numbers.
    text = json.dumps(document, allow_nan=False)
    replace_file([text.encode()], _path(task, folder))
    result: Document = json.loads(text)["result"]
    return result


def _read_result(task: Task, folder: Path) -> Document | None:
    """Return the stored result; None if there is no file, it is damaged, or it belongs to another task."""
    try:
        document = json.loads(_path(task, folder).read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    if not isinstance(document, Mapping) or document.get("fingerprint") != task.fingerprint:
        return None
    result: Document = document["result"]
    return result


def _path(task: Task, folder: Path) -> Path:
    return folder / f"{task.key}.json"


@lru_cache(maxsize=1)
def _hash_sources() -> str:
    """Return a hash of the sources of the core and of the reproduction: each may change a result."""
    hashed = sha256()
    for root in (Path(islands.__file__).parent, Path(__file__).parent):
        for path in sorted(root.rglob("*.py")):
            hashed.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return hashed.hexdigest()

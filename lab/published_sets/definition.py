"""A benchmark: estimation data, tests, the rule for the initial samples, and published errors."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from hashlib import file_digest
from pathlib import Path
from types import MappingProxyType

import numpy as np

from islands.errors import RecordError, SettingsError, name_option
from islands.records.coupled import AnyRecord, CoupledRecord
from islands.records.dataset import Dataset

#: The metric of every benchmark: of the free run, over all samples and outputs that are scored.
METRIC = "RMSE"

#: Classes of models that are compared, in the order of the rows.
CLASSES = (LATENT, NARX, LINEAR) = ("latent", "narx", "linear")


@dataclass(frozen=True, slots=True)
class PublishedError:
    """An error of others on a test.

    Attributes
    ----------
    value : float
        In the unit of the benchmark.
    method : str
    source : str
    """

    value: float
    method: str
    source: str


@dataclass(frozen=True, slots=True, eq=False)
class BenchmarkTest:
    """Test part of a benchmark.

    Attributes
    ----------
    record : Dataset or CoupledRecord
    known : int
        Samples at the start of every segment whose measured output a simulation may use.
    unscored : int
        Samples at the start of every segment that are not scored, at least ``known``.
    """

    record: AnyRecord
    known: int
    unscored: int

    def __post_init__(self) -> None:
        if not 0 < self.known <= self.unscored < min(self.record.segments):
            raise RecordError(
                "a test needs known <= unscored < samples of each segment, got "
                f"{self.known}, {self.unscored} and {min(self.record.segments)}"
            )

    @property
    def visible(self) -> AnyRecord:
        """The record without the outputs that a simulation may not use: they are missing."""
        hide = partial(_hide_outputs, known=self.known)
        return self.record.map(hide) if isinstance(self.record, CoupledRecord) else hide(self.record)


def _hide_outputs(record: Dataset, known: int) -> Dataset:
    y = np.array(record.y)
    for begin, end in record.bounds:
        y[begin + known : end] = np.nan
    return replace(record, y=y)


@dataclass(frozen=True, slots=True, eq=False)
class BenchmarkData:
    """Estimation data and the tests by name."""

    estimation: AnyRecord
    tests: Mapping[str, BenchmarkTest]


@dataclass(frozen=True, slots=True)
class Benchmark:
    """A published set of measurements.

    Attributes
    ----------
    description : str
        What was measured.
    published : mapping
        Errors of others by test, the smallest first. The keys are the tests; none if only the data tell them.
    unit : str
        Unit of the errors.
    scale : float
        Factor from the unit of the output to this one.
    rule : str
        Split and initial samples, and their source.
    address : str
        DOI or address of the data.
    licence : str
        Licence of the data.
    read : callable
        Returns the data; takes the folder of the files.
    files : mapping
        SHA-256 of each file by name, of the version on which results are stated.
    samples : int or None
        Samples of the estimation data; None if only the data tell it.
    is_tuned : bool
        Whether the searches were developed with this set at hand.
    """

    description: str
    published: Mapping[str, tuple[PublishedError, ...]]
    unit: str
    scale: float
    rule: str
    address: str
    licence: str
    read: Callable[[Path], BenchmarkData]
    files: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    samples: int | None = None
    is_tuned: bool = False


def list_missing_files(benchmark: Benchmark, folder: Path | None) -> list[str]:
    """Return the names of the files that are not in the folder."""
    return [name for name in benchmark.files if folder is None or not (folder / name).is_file()]


def list_other_files(benchmark: Benchmark, folder: Path) -> list[str]:
    """Return the names of the files with another content than that on which results are stated."""
    found = []
    for name, expected in benchmark.files.items():
        with (folder / name).open("rb") as file:
            if file_digest(file, "sha256").hexdigest() != expected:
                found.append(name)
    return found


def read_data(name: str, benchmark: Benchmark, folder: Path | None) -> BenchmarkData:
    """Read the data of a benchmark.

    Parameters
    ----------
    name : str
        Name of the benchmark, for messages.
    benchmark : Benchmark
    folder : Path or None
        Folder of the files.

    Raises
    ------
    SettingsError
        A file is missing, or the package that has the data cannot load them.
    RecordError
        A file has other columns or too few samples.
    """
    if missing := list_missing_files(benchmark, folder):
        raise SettingsError(
            f"{name} needs {', '.join(missing)} in the folder {folder or 'of the sets'}: "
            f"give the folder with {name_option('data', example='DIR')}. Origin: {benchmark.address}"
        )
    try:
        return benchmark.read(folder or Path())
    except (KeyError, IndexError, TypeError, ValueError) as error:
        origin = ", ".join(benchmark.files) or "the package"
        raise RecordError(f"{origin} has another content than {name} needs: {error}") from error

"""FMU of a job: whether the service runs it, the check of its variables, and its process."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING

from islands.distribution import describe_missing_extra
from islands.errors import SettingsError
from islands_service.domain.uploaded_fmu import UploadedFmuSpec, check_interface, read_fmu
from islands_service.intake.confined_process import explain_gaps, explain_no_fmus
from islands_service.intake.confinement import find_gaps
from islands_service.intake.job_inputs import link_blob
from islands_service.settings import ServiceSettings, service_settings
from islands_service.store.blobs import Blobs
from islands_service.store.datasets import StoredDataset

if TYPE_CHECKING:
    from islands.simulators.fmu.instance import FmuSource


def explain_refusal(settings: ServiceSettings) -> str:
    """Return why a service runs no FMUs, and what to do; empty if it runs them."""
    if not settings.allow_fmus:
        return explain_no_fmus("ask its operator to set ISLANDS_ALLOW_FMUS=true")
    if find_spec("fmpy") is None:
        return describe_missing_extra("the simulation of an FMU", "fmi")
    gaps = find_gaps()
    return explain_gaps(gaps) if gaps else ""


def check_allowed(settings: ServiceSettings) -> None:
    """Refuse FMUs unless the operator allows them, and this machine can confine them.

    Raises
    ------
    SettingsError
    """
    if refusal := explain_refusal(settings):
        raise SettingsError(refusal)


def check_fmu(spec: UploadedFmuSpec, stored: StoredDataset) -> None:
    """Check the variables and the equations of a simulation against the description of its FMU.

    Raises
    ------
    SettingsError
        A variable is missing or unknown, or a value is out of range.
    ModelError
        The equations are invalid.
    """
    description = read_fmu(stored.preview["fmu"], stored.name)
    spec.make_system(spec.make_model(lambda _, interface: check_interface(description, interface)))


@contextmanager
def open_fmu(
    stored: StoredDataset, blobs: Blobs, seconds: float, check: Callable[[], None]
) -> Iterator["FmuSource"]:
    """Provide the FMU of a job in a confined process while the block runs.

    Parameters
    ----------
    seconds : float
        Longest time of the CPU.
    check : callable
        Called during simulations; raises the reason if they must end.

    Raises
    ------
    SettingsError
        The service does not run FMUs.
    ModelError
        The FMU cannot be loaded.
    BlobNotFoundError
        The data folder has lost the file.
    """
    # Only jobs with an FMU import the kernels here.
    from islands_service.intake.confined_fmu import open_confined  # noqa: PLC0415

    settings = service_settings()
    check_allowed(settings)
    description = read_fmu(stored.preview["fmu"], stored.name)
    with (
        blobs.hold(stored.blob) as held,
        link_blob(held, stored.name) as path,
        open_confined(path, description, settings.inspection_memory, seconds, check) as source,
    ):
        yield source

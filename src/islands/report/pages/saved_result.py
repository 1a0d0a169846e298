"""Report of a result folder."""

from pathlib import Path

from islands.errors import ModelError
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.persistence.saved_documents import SavedDocument, open_document, read_saved_model
from islands.report.pages.coupled import coupled_report
from islands.report.pages.identification import identification_report
from islands.report.pages.origin import REPORT_FILE, Origin
from islands.report.text.coupled_statements import describe_coupled

#: Documents that have a report.
_RESULTS = ("islands.result", "islands.coupled-result")


def report_saved_result(folder: Path) -> bytes:
    """Return the report of a result folder of one or several outputs, or of a diagnosis.

    The figures are those in the folder. The report of a diagnosis is the one that the diagnosis wrote, since
    its folder has no figures.

    Parameters
    ----------
    folder : Path
        Folder, or the document in it.

    Raises
    ------
    ModelError
        There is no result, it is damaged or of another version, or the diagnosis was stopped before its
        report.
    """
    saved = open_document(folder)
    if saved.schema == "islands.discrepancy":
        return _read_diagnosis_report(saved.file.parent / REPORT_FILE)
    model = read_saved_model(saved) if saved.schema in _RESULTS else None
    if model is None:
        raise ModelError(f"{saved.file} is no result: give the folder of a result or of a diagnosis")
    try:
        return _write(saved, model)
    except (KeyError, TypeError, IndexError) as error:
        raise ModelError(
            f"{saved.file} is damaged or of another version: {error!r} is missing or wrong; identify again"
        ) from error


def _write(saved: SavedDocument, model: AnyModel) -> bytes:
    folder = saved.file.parent
    origin = Origin.from_seconds(folder.absolute().name, saved.file.stat().st_mtime)
    drawn = {path.name: path.read_bytes() for path in sorted((folder / "figures").glob("*.svg"))}
    document = saved.content
    if not isinstance(model, CoupledModel):
        return identification_report(origin, document, model.equation().mathml, drawn)
    runs = {each["name"]: f"free-run-{Path(each['folder']).name}.svg" for each in document["outputs"]}
    return coupled_report(
        origin,
        model,
        document,
        document["models"][0]["terms"],
        describe_coupled(document),
        {output: drawn[name] for output, name in runs.items() if name in drawn},
    )


def _read_diagnosis_report(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise ModelError(
            f"{path} does not exist, because the diagnosis was stopped before its report: diagnose again"
        ) from error

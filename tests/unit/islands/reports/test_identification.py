"""HTML report of an identification: names of the columns."""

import islands
from islands.data.dataset import Dataset
from islands.models.equations import named_term
from islands.reports.identification import identification_report
from support.identifications import record


def test_terms_have_the_names_of_the_columns() -> None:
    data = record(300)
    named = Dataset(data.u, data.y, 0.01, ("u_V",), "y_um", ("V",), "um")
    found = islands.fit(named, library="polynomial", degree=1, lags=1, max_terms=1, certificate=0, average=1)
    page = identification_report("job", found.search_result, {}).decode()
    term = named_term(found.best.model, 0)
    assert term in ("y_um(k-1)", "u_V(k-1)")
    assert f"<td>{term}</td>" in page

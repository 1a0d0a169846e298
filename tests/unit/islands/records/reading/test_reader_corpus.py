"""Any real file is read, or refused with file, line, column and remedy."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import read_record
from support.odd_files import ODD_FILES, U, Y, write_workbook


def parameter(case):
    """Openpyxl is imported in half a second."""
    marks = pytest.mark.ci if case.write is write_workbook else ()
    return pytest.param(case, marks=marks, id=case.title)


@pytest.mark.parametrize("case", [parameter(case) for case in ODD_FILES])
def test_an_odd_file_is_read_or_refused_with_its_remedy(tmp_path, case):
    path = tmp_path / case.name
    case.write(path)
    if case.words:
        with pytest.raises(RecordError) as caught:
            read_record(path, [case.columns[0]], case.columns[1], **case.options)
        assert [word for word in case.words if word not in str(caught.value)] == [], str(caught.value)
        return
    record = read_record(path, [case.columns[0]], case.columns[1], **case.options)
    assert record.dt == pytest.approx(case.dt, rel=1e-9)
    assert (*record.input_units, record.output_unit) == case.units
    wrong = int((record.u[:, 0] != U).sum() + (record.y != Y).sum())
    assert wrong == (1 if case.options.get("gaps") else 0)
    assert np.isfinite(record.u).all()

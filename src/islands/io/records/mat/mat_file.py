"""MAT-files (.mat): of version 4, of version 5 to 7, and of version 7.3, which is HDF5."""

from pathlib import Path

from islands.errors import RecordError
from islands.io.records.columnar import ColumnarFile
from islands.io.records.mat import v4, v5, v73
from islands.io.records.mat.workspace import make_columns

#: How HDF5 begins, and where: MATLAB puts 512 bytes of its own before it.
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HDF5_STARTS = (0, 512, 1024, 2048)

#: How files begin that are called .mat and are none, and what they are.
_OTHERS = {
    b"# Created by Octave": "is text in Octave's own format: save it by save -v7 {file}",
    b"": "is not a MAT-file: save it by save -v7 {file}, or, if it is a table of text, call it .csv",
}


def read_matlab(path: Path) -> ColumnarFile:
    """Open a MAT-file.

    Columns are vectors by their names, fields of structures as ``run.u``, and matrices of a few channels as
    ``x_1, x_2 ...``. What is no channel (text, cells, objects, complex or sparse numbers) is refused when
    somebody asks for it.

    Raises
    ------
    RecordError
        The file is no MAT-file, is damaged, or holds thousands of variables.
    """
    file = path.name
    with path.open("rb") as stream:
        head = stream.read(_HDF5_STARTS[-1] + len(_HDF5))
    if not head:
        raise RecordError(f"{file} is empty: save it anew in MATLAB or Octave by save -v7 {file}")
    if any(head.startswith(_HDF5, start) for start in _HDF5_STARTS):
        return make_columns(v73.read_variables(path), file)
    content = path.read_bytes()
    variables = v5.read_variables(content) or v4.read_variables(content)
    if variables is None:
        words = next(words for begin, words in _OTHERS.items() if head.startswith(begin))
        raise RecordError(f"{file} {words.format(file=file)}")
    return make_columns(variables, file)

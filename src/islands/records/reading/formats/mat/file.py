"""MAT-files (.mat) of version 4, of versions 5 to 7, and of version 7.3, which is HDF5."""

from pathlib import Path

from islands.errors import RecordError
from islands.records.reading.formats.columnar import ColumnarFile
from islands.records.reading.formats.mat import v4, v5, v73
from islands.records.reading.formats.mat.workspace import make_columns
from islands.records.reading.options import DEFAULT_READING, ReadingOptions

#: Signature of HDF5 and its possible offsets. MATLAB writes a header of 512 bytes before it.
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HDF5_STARTS = (0, 512, 1024, 2048)

#: Messages for other formats in .mat files, by their first bytes.
_OTHER_FORMATS = {
    b"# Created by Octave": "is text in Octave's format: save it with save -v7 {file}",
    b"": "is not a MAT-file: save it with save -v7 {file}, or, if it is a text table, rename it to .csv",
}


def read_matlab(path: Path, options: ReadingOptions = DEFAULT_READING) -> ColumnarFile:
    """Open a MAT-file.

    Vectors become columns with their names, fields of structures become ``run.u``, and matrices of a few
    channels become ``x_1, x_2 ...``. Other variables (text, cells, objects, complex or sparse numbers) raise
    an error only when they are read.

    Raises
    ------
    RecordError
        The file is not a MAT-file, is damaged, or has more than
        `islands.records.reading.size_limits.MOST_COLUMNS` variables.
    """
    options.check_array_file(path.name)
    file = path.name
    with path.open("rb") as stream:
        head = stream.read(_HDF5_STARTS[-1] + len(_HDF5))
    if not head:
        raise RecordError(f"{file} is empty: save it again in MATLAB or Octave with save -v7 {file}")
    if any(head.startswith(_HDF5, start) for start in _HDF5_STARTS):
        return make_columns(v73.read_variables(path), file, options.missing)
    content = path.read_bytes()
    variables = v5.read_variables(content) or v4.read_variables(content)
    if variables is None:
        message = next(text for signature, text in _OTHER_FORMATS.items() if head.startswith(signature))
        raise RecordError(f"{file} {message.format(file=file)}")
    return make_columns(variables, file, options.missing)

"""NumPy archives with wrong sizes: header, directory and stored bytes are checked against each other."""

import io
import struct
import zipfile

import numpy as np
import pytest

from islands.records.reading.size_limits import MOST_SAMPLES

K = np.arange(60)
U, Y = K % 7 - 3.0, K * K % 11 + 0.5


def member(array, shape=None):
    """Write an array like numpy.save; ``shape`` replaces the shape in its header."""
    stream = io.BytesIO()
    header = {"descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False}
    np.lib.format.write_array_header_1_0(stream, header | {"shape": array.shape if shape is None else shape})
    return stream.getvalue() + array.tobytes()


@pytest.fixture
def archive(tmp_path):
    """Write an archive of the valid arrays u, y and dt and of further members given as bytes."""

    def archive(packing=zipfile.ZIP_STORED, **members):
        sound = {"u": member(U), "y": member(Y), "dt": member(np.array(0.1))}
        with zipfile.ZipFile(tmp_path / "bad.npz", "w", packing) as file:
            for name, content in (sound | members).items():
                file.writestr(f"{name}.npy", content)
        return tmp_path / "bad.npz"

    return archive


def test_a_header_with_a_size_above_that_of_its_member_is_refused(archive, refusal):
    for samples in (61, 2**26):
        message = refusal(archive(x=member(U, (samples,))))
        assert f"bad.npz: column x declares {8 * samples} bytes, but the file stores 480 for it" in message
        assert "write it again" in message


@pytest.mark.parametrize("shape", [(2**28,), (2**40, 1), (2**62, 2**62)])
def test_a_sample_count_above_the_limit_is_refused(archive, shape, refusal):
    message = refusal(archive(x=member(U, shape)))
    assert (
        f"declares {shape[0] * (shape[1:] or (1,))[0]} samples, but a record has at most {MOST_SAMPLES}"
        in message
    )


def test_a_header_with_an_impossible_shape_is_refused(archive, refusal):
    assert "column x cannot be read" in refusal(archive(x=member(U, (-60,))))


@pytest.mark.parametrize("packing", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_a_directory_size_above_the_compression_limit_is_refused(archive, packing, refusal):
    """Both the directory of the archive and the header of the array declare 512 MB."""
    content = member(U, (2**26,))
    claimed = len(content) - U.nbytes + 8 * 2**26
    file = archive(packing, x=content)
    written = file.read_bytes()
    entry = written.rindex(b"PK\x01\x02")
    sizes = struct.pack("<I", len(content))
    assert written[entry + 24 : entry + 28] == sizes
    file.write_bytes(written[: entry + 24] + struct.pack("<I", claimed) + written[entry + 28 :])
    message = refusal(file)
    assert f"column x declares {claimed} bytes, but the file stores" in message
    assert message.count(", compressed") == (packing == zipfile.ZIP_DEFLATED)


def test_a_directory_size_above_that_of_the_file_is_refused(archive, refusal):
    file = archive(x=member(U, (2**26,)))
    written = file.read_bytes()
    entry = written.rindex(b"PK\x01\x02")
    claimed = struct.pack("<I", 8 * 2**26 + 128)
    file.write_bytes(written[: entry + 20] + 2 * claimed + written[entry + 28 :])
    assert f"declares {8 * 2**26 + 128} bytes, but the file stores {len(written)} for it" in refusal(file)


@pytest.mark.parametrize("packing", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_an_archive_with_another_compression_is_refused(archive, packing, refusal):
    assert "cannot be read (its compression method is not used by numpy.savez" in refusal(
        archive(packing), ["u"]
    )


def test_an_array_with_unicode_field_names_is_refused(archive, refusal):
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.zeros(60, [("µ", "f8")]), version=(3, 0))
    assert "its format version (3, 0) is not used for arrays of numbers" in refusal(
        archive(x=stream.getvalue())
    )

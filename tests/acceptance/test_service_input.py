"""Invalid input over REST is rejected with a message that locates the error, and nothing is stored."""

import gzip
import io
import struct
import time
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest
from numpy.lib import format as npy

from islands_api.web import auth
from support.service import (
    columns,
    csv,
    kept,
    matlab_5,
    matlab_73,
    nothing_stored,
    npz,
    problem_of,
    queued,
    served,
    spec,
)

#: Memory budget of the inspection process, in bytes.
MEMORY = 1_000_000_000

#: Largest size of an unpacked file, in bytes.
UNPACKED = 50_000_000

#: First bytes of a picture.
PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(256))


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("service")
    with served(folder, inspection_memory=MEMORY, max_unpacked=UNPACKED) as service:
        yield service


@pytest.fixture
def service(shared):
    """A service without jobs and data sets, before and after a test."""
    assert nothing_stored(shared)
    yield shared
    for job in shared.client.get("/v1/jobs").json()["items"]:
        shared.client.post(f"/v1/jobs/{job['id']}/cancel")
        shared.client.delete(f"/v1/jobs/{job['id']}")
    for dataset in shared.client.get("/v1/datasets").json()["items"]:
        assert shared.client.delete(f"/v1/datasets/{dataset['id']}").status_code == 204
    for path in shared.settings.blobs.rglob("??/*"):
        path.unlink()


def make_header(samples):
    """Return the header of a column in NumPy's format."""
    stream = io.BytesIO()
    npy.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (samples,)})
    return stream.getvalue()


def make_archive_with_false_size(samples, stored=64):
    """Return an archive whose headers claim more samples than it stores."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in ("u", "y"):
            archive.writestr(f"{name}.npy", make_header(samples) + bytes(stored))
    return stream.getvalue()


def make_zip_bomb(samples, members, declared=None):
    """Return an archive of zeros that unpacks to a thousand times its size; its checksums are not valid.

    Its directory declares the true size of each member, or another one.
    """
    pack = zlib.compressobj(9, zlib.DEFLATED, -15)
    head, block = make_header(samples), bytes(1 << 20)
    blocks = 8 * samples // len(block)
    packed = pack.compress(head) + pack.flush(zlib.Z_FULL_FLUSH)
    packed += (pack.compress(block) + pack.flush(zlib.Z_FULL_FLUSH)) * blocks + pack.flush()
    files, directory = b"", b""
    for member in range(members):
        name = b"u%d.npy" % member
        size = declared or len(head) + blocks * len(block)
        entry = struct.pack("<5H3L2H", 20, 0, 8, 0, 0x21, 0, len(packed), size, len(name), 0)
        directory += b"PK\1\2\x14\0" + entry + struct.pack("<3H2L", 0, 0, 0, 0, len(files)) + name
        files += b"PK\3\4" + entry + name + packed
    sizes = (0, 0, members, members, len(directory), len(files), 0)
    return files + directory + b"PK\5\6" + struct.pack("<4H2LH", *sizes)


#: Unusable files: content, name, and parts of the message.
UNUSABLE = {
    "empty": (b"", "a.csv", ("a.csv is empty", "export the record again")),
    "header alone": (b"t_s,u_V,y_um\n", "a.csv", ("a header in line 1 but no samples",)),
    "picture": (PNG, "a.csv", ("a.csv is not a text file", "export the record as text")),
    "2 GB header": (
        make_archive_with_false_size(2**28),
        "a.npz",
        (f"column u declares {2**28} samples", "the file is damaged"),
    ),
    "0.8 GB header": (
        make_archive_with_false_size(10**8),
        "a.npz",
        ("declares 800000000 bytes, but the file stores 64", "write it"),
    ),
    "MAT 5 cut short": (matlab_5()[:2000], "a.mat", ("a.mat is damaged or truncated", "save it")),
    "MAT 7.3 cut short": (matlab_73()[:3000], "a.mat", ("a.mat is damaged or truncated", "save it")),
    "long name": (
        csv().replace(b"y_um", b"y" * 100_000),
        "a.csv",
        (f"line 1: the column {'y' * 40}... has a name of 100000 characters", "at most 1000", "shorter"),
    ),
    "no gzip": (
        csv(),
        "a.csv.gz",
        ("a.csv.gz is not a gzip file, or is damaged", "compress the record again"),
    ),
    "gzip cut short": (
        gzip.compress(csv())[:-50],
        "a.csv.gz",
        ("is not a gzip file, or is damaged", "compress"),
    ),
    "line cut short": (
        csv() + b"2.0,1.0\n",
        "a.csv",
        ("a.csv, line 202, column y_um", "2 cells for 3 columns"),
    ),
}


@pytest.mark.ci
@pytest.mark.parametrize("case", UNUSABLE)
def test_unusable_file_is_rejected_and_not_stored(service, case):
    content, name, words = UNUSABLE[case]
    detail = problem_of(service.upload(content, name), 422, "invalid-record")
    for word in words:
        assert word in detail
    assert nothing_stored(service)


@pytest.mark.ci
@pytest.mark.parametrize("name", ["a.npz", "a.exe", "a"])
def test_a_text_file_is_read_whatever_its_name(service, name):
    stored = service.upload(csv(), name)
    assert stored.status_code == 201
    assert service.submit(**spec(stored.json()["id"])).status_code == 202


@pytest.mark.ci
def test_longest_column_name_is_accepted_and_longer_ones_are_shortened(service):
    """Messages and lists of data sets would repeat a long name many times."""
    name = "y" * 199
    stored = service.upload(csv().replace(b"y_um", name.encode() + b"1")).json()["id"]
    assert service.submit(**{**spec(stored), "output": name + "1"}).status_code == 202
    longer = csv().replace(b"y_um", name.encode() + b"12")
    for given in ({}, {"output": "force"}, {"inputs": ["u_V"], "output": "force"}):
        detail = problem_of(service.upload(longer, "a.csv", **given), 422, "invalid-record")
        assert "whose name has 201 characters" in detail
        assert len(detail) < 200


@pytest.mark.ci
@pytest.mark.parametrize(
    ("declared", "reason"), [(None, "a.npz unpacks to more than 1 GiB"), (1000, "a.npz")]
)
def test_zip_bomb_is_refused_whether_its_directory_is_true_or_not(service, declared, reason):
    packed = make_zip_bomb(samples=1 << 27, members=2, declared=declared)
    assert len(packed) < 3_000_000
    assert reason in problem_of(service.upload(packed, "a.npz"), 422, "invalid-record")
    assert nothing_stored(service)


@pytest.mark.ci
def test_gzip_bomb_is_cut_off_at_the_limit(service):
    member = gzip.compress(b"t_s,u_V,y_um\n" + b"0" * 10_000_000)
    began = time.process_time()
    gzip.decompress(member)
    one = time.process_time() - began
    began = time.process_time()
    detail = problem_of(service.upload(400 * member, "a.csv.gz"), 413, "too-large")
    assert (
        detail == "a.csv has more than 50 MB after decompression, the maximum here for a file of its size: "
        "send it uncompressed, or a part of the record"
    )
    # Five members reach the limit; the whole file would take the time of four hundred.
    assert time.process_time() - began < 200 * one
    assert nothing_stored(service)


@pytest.mark.ci
def test_valid_gzip_is_unpacked(service):
    answer = service.upload(gzip.compress(csv()), "a.csv.gz")
    assert (answer.status_code, answer.json()["name"]) == (201, "a.csv")
    assert answer.json() == {**service.upload(csv(), "a.csv").json(), "created": answer.json()["created"]}


@pytest.mark.ci
def test_decimal_comma_is_read_with_a_warning_in_the_preview(service):
    stored = service.upload(csv(200, ";", ","), "a.csv").json()
    assert stored["preview"]["warnings"] == [
        "the comma in a.csv, line 2, column t_s (0,000000) is read as a decimal mark"
    ]
    mean = next(each["mean"] for each in stored["preview"]["columns"] if each["name"] == "u_V")
    assert mean == pytest.approx(columns()["u_V"].mean(), abs=1e-6)
    assert service.submit(**spec(stored["id"])).status_code == 202


#: Partly unusable records: content, and parts of the column's problem or warning.
DEFECTIVE = {
    "mixed marks": (
        csv(200, ";", ",", y_um={9: "0.5"}),
        (
            "a decimal comma in a.csv, line 2",
            "a decimal point in a.csv, line 9, column y_um (0.5)",
            "same mark",
        ),
    ),
    "text": (
        csv(y_um={7: "oops"}),
        ("a.csv, line 7, column y_um: 'oops' is not a number", "correct the cell or leave its row out"),
    ),
    "NaN": (
        csv(u_V={7: "NaN"}),
        ("a.csv, line 7, column u_V is empty or NaN", "or select rows without it"),
    ),
    "infinite": (csv(y_um={7: "inf"}), ("a.csv, line 7, column y_um is infinite", "repair it")),
    "constant": (
        csv(y_um=dict.fromkeys(range(2, 202), "4")),
        ("column y_um is constant, 4 from line 2 to line 201", "choose a column, or rows"),
    ),
    "two lengths": (
        npz(u_V=np.arange(100) % 7, y_um=np.arange(90) % 5, dt=0.1),
        ("column u_V has 100 samples, column y_um 90", "the channels of a record must have equal length"),
    ),
    "uneven time": (
        csv(t_s={50: "0.4812"}),
        ("a.csv, line 50, column t_s is off the uniform grid", "from 0.47 to 0.4812", "usual step is 0.01"),
    ),
    "repeated time": (
        csv(t_s={50: "0.47"}),
        ("a.csv, line 50, column t_s repeats the time stamp 0.47", "give resample=DT"),
    ),
    "too short": (csv(20), ("a.csv: 20 samples, from line 2 to line 21, are too few", "at least 30")),
}


@pytest.mark.parametrize(
    "case", [case if case == "NaN" else pytest.param(case, marks=pytest.mark.nightly) for case in DEFECTIVE]
)
def test_defect_of_a_record_is_reported_and_rejects_its_jobs(service, case):
    content, words = DEFECTIVE[case]
    name = "a.npz" if content.startswith(b"PK") else "a.csv"
    stored = service.upload(content, name)
    assert stored.status_code == 201
    preview = stored.json()["preview"]
    problems = {each["name"]: each["problem"] for each in preview["columns"]}
    assert [name for name, problem in problems.items() if problem and name != "dt"] in ([], ["u_V"], ["y_um"])
    message = problems["u_V"] or problems["y_um"] or " ".join(preview["warnings"])
    job = problem_of(service.submit(**spec(stored.json()["id"])), 422, "invalid-record")
    for word in words:
        assert word in message
        assert word in job
    assert service.client.get("/v1/jobs").json()["items"] == []


@pytest.mark.ci
@pytest.mark.parametrize("case", ["text", "two lengths", "uneven time"])
def test_upload_with_columns_is_rejected_like_a_job(service, case):
    content, words = DEFECTIVE[case]
    name = "a.npz" if content.startswith(b"PK") else "a.csv"
    checked = service.upload(content, name, inputs=["u_V"], output="y_um")
    detail = problem_of(checked, 422, "invalid-record")
    assert all(word in detail for word in words)
    assert nothing_stored(service)


@pytest.mark.ci
def test_upload_with_an_output_only_is_checked(service):
    detail = problem_of(service.upload(csv(y_um={7: "inf"}), "a.csv", output="y_um"), 422, "invalid-record")
    assert "a.csv, line 7, column y_um is infinite" in detail
    detail = problem_of(service.upload(csv(), "a.csv", output="force"), 422, "invalid-record")
    assert detail == "the record has no column force; it has t_s, u_V, y_um"
    assert nothing_stored(service)


#: Invalid jobs: changed fields, type of the problem, and parts of its message.
INVALID_JOBS = {
    "unknown preset": (
        {"preset": "narxx"},
        "invalid-settings",
        ("narxx", "hysteresis", "Did you mean 'narx'?"),
    ),
    "no islands": ({"settings": {"islands": 0}}, "invalid-settings", ("islands is at least 1, got 0",)),
    "unknown primitive": (
        {"settings": {"primitives": ["mul", "sinh"]}},
        "invalid-settings",
        ("primitive", "sinh", "mul", "Did you mean 'sin'"),
    ),
    "generations": (
        {"settings": {"generations": 1e12}},
        "invalid-settings",
        ("generations is at most 1000000 on this service, got 1000000000000",),
    ),
    "budget": (
        {"settings": {"generations": 1_000_000, "population": 10_000, "islands": 100}},
        "invalid-settings",
        ("1e+12 individuals", "at most 1e+10 for a job", "fewer generations, islands or individuals"),
    ),
    "fraction": ({"validation": 1.5}, "invalid-request", ("/validation", "less than 1")),
    "no fraction": ({"validation": 0}, "invalid-request", ("/validation", "greater than 0")),
    "no column": (
        {"output": "y_m"},
        "invalid-record",
        ("record.csv has no column y_m; it has t_s, u_V, y_um", "Did you mean 'y_um'?"),
    ),
    "unknown setting": (
        {"settings": {"islnds": 2}},
        "invalid-request",
        ("/settings/islnds", "not permitted", "Did you mean 'islands'?"),
    ),
    "unknown field": (
        {"presset": "narx"},
        "invalid-request",
        ("/presset", "not permitted", "Did you mean 'preset'?"),
    ),
    "unknown topology": (
        {"settings": {"topology": "tours"}},
        "invalid-settings",
        ("Did you mean 'torus'?",),
    ),
}


@pytest.mark.parametrize("case", INVALID_JOBS)
def test_invalid_job_is_rejected(service, case):
    changes, kind, words = INVALID_JOBS[case]
    detail = problem_of(service.submit(**spec(kept(service.store), **changes)), 422, kind)
    for word in words:
        assert word in detail
    assert service.client.get("/v1/jobs").json()["items"] == []


def test_too_many_islands_are_rejected_before_allocation(service):
    job = spec(kept(service.store), settings={"islands": 1_000_000, "topology": "fully-connected"})
    service.submit(**job)
    tracemalloc.start()
    detail = problem_of(service.submit(**job), 422, "invalid-settings")
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert detail == "islands is at most 256 on this service, got 1000000"
    assert taken < 2_000_000


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/v1/jobs/{}"),
        ("GET", "/v1/jobs/{}/events"),
        ("GET", "/v1/jobs/{}/models"),
        ("GET", "/v1/jobs/{}/history"),
        ("GET", "/v1/jobs/{}/result"),
        ("GET", "/v1/jobs/{}/models/1/figures/loop.svg"),
        ("POST", "/v1/jobs/{}/cancel"),
        ("POST", "/v1/jobs/{}/resume"),
        ("DELETE", "/v1/jobs/{}"),
    ],
)
def test_job_of_another_owner_is_not_found(service, method, path):
    theirs, missing = queued(service.store, "another owner").id, "0" * 32
    headers = {**service.key(), "X-Request-ID": "same"}
    answers = [service.client.request(method, path.format(job), headers=headers) for job in (theirs, missing)]
    assert problem_of(answers[0], 404, "no-such-job") == f"there is no job {theirs!r}"
    assert answers[0].content.replace(theirs.encode(), missing.encode()) == answers[1].content
    headers = [{name: value for name, value in each.headers.items() if name != "date"} for each in answers]
    assert headers[0] == headers[1]
    assert service.store.jobs.get("another owner", theirs).version == 1


def test_data_set_of_another_owner_is_not_found(service):
    theirs = kept(service.store, "another owner")
    missing = "0" * 32 + "-csv"
    headers = {**service.key(), "X-Request-ID": "same"}
    for method, path in (("GET", "/v1/datasets/{}"), ("DELETE", "/v1/datasets/{}"), ("POST", "/v1/jobs")):
        answers = [
            service.client.request(
                method,
                path.format(dataset),
                json=spec(dataset) if method == "POST" else None,
                headers=headers,
            )
            for dataset in (theirs, missing)
        ]
        assert theirs in problem_of(answers[0], 404, "no-such-dataset")
        assert answers[0].content.replace(theirs.encode(), missing.encode()) == answers[1].content
    assert service.store.datasets.get("another owner", theirs)


def test_expired_key_is_rejected(service):
    answer = service.client.get("/v1/jobs", headers=service.key(seconds=0.0))
    assert problem_of(answer, 401, "no-key") == (
        "the key has expired: ask the operator of this service for another one"
    )
    assert answer.headers["www-authenticate"] == 'Bearer realm="islands"'


def test_revoked_key_is_rejected_a_second_later(service, monkeypatch):
    header = service.key()
    assert service.client.get("/v1/jobs", headers=header).status_code == 200
    key = [key for key in service.store.keys.all() if key.revoked is None and not key.expired][-1]
    service.store.keys.revoke(key.id)
    monkeypatch.setattr(auth, "monotonic", lambda: time.monotonic() + 1.0)
    answer = service.client.get("/v1/jobs", headers=header)
    assert "the key was revoked" in problem_of(answer, 401, "no-key")

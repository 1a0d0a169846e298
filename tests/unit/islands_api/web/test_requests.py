"""Request bodies: malformed, oversized and wrongly typed bodies are rejected with clear errors."""

import http.client
import json

import pytest

from islands_api.web.problems import MalformedBodyError
from islands_api.web.requests import read_json
from support.service import PROBLEM, csv, kept, problem_of, spec

#: Bodies that are not strict JSON, and a part of the error message.
DAMAGED = {
    b"": "Expecting value in line 1, column 1",
    b"{": "Expecting property name",
    b'{"a": 1]': "line 1, column 8",
    b'{"a": 1}\n{': "Extra data in line 2, column 1",
    b"\xff\xfe\x00": "is not valid JSON",
    b'{"a": "\xe4"}': "is not valid JSON",
    b'{"a": NaN}': "NaN is not a JSON number: omit the entry",
    b"[Infinity]": "Infinity is not a JSON number",
    b"[-Infinity]": "-Infinity is not a JSON number",
    b'{"seed": 1, "dt": 1, "seed": 2}': "'seed' appears twice",
    b'{"settings": {"islands": 1, "islands": 2}}': "'islands' appears twice",
    b"[" * 100_000: "nested too deeply",
    b'{"a":' * 100_000: "nested too deeply",
    b"[" * 100_000 + b"]" * 100_000: "nested too deeply",
    b"[" * 65 + b"]" * 65: "nested too deeply",
    b"9" * 100_000: "a number has 100000 digits",
}


@pytest.mark.parametrize("body", DAMAGED, ids=lambda body: repr(body[:20]))
def test_invalid_json_is_rejected(body):
    with pytest.raises(MalformedBodyError) as refused:
        read_json(body)
    assert DAMAGED[body] in refused.value.detail


def post_body(service, body, media="application/json", path="/v1/jobs"):
    headers = {} if media is None else {"Content-Type": media}
    return service.client.post(path, content=body, headers=headers)


@pytest.mark.parametrize("media", [None, "text/plain", "application/xml", "multipart/form-data", "json", ";"])
def test_a_job_with_another_media_type_is_rejected(service, media):
    order = json.dumps(spec(kept(service.store))).encode()
    detail = problem_of(post_body(service, order, media), 415, "unsupported-media-type")
    assert (
        detail == f"the body has {f'the type {media}' if media else 'no type'}: send it as application/json"
    )


#: Bodies below a megabyte whose validation would take long, and the values of which there are too many.
EXTENSIVE = {
    "unknown names": ({f"k{index}": 1 for index in range(60_000)}, "60000 names"),
    "unknown settings": ({"settings": {f"k{index}": 1 for index in range(60_000)}}, "60001 names"),
    "recordings": ({"recordings": [{f"k{i}": 1 for i in range(500)}] * 60}, "30001 names"),
    "wrong shifts": ({"settings": {"shifts": ["a"] * 150_000}}, "150000 array elements"),
    "lists": ({"inputs": [[]] * 200_000}, "200000 array elements"),
}


@pytest.mark.parametrize(
    ("case", "path"),
    [
        ("unknown names", "/v1/admin/keys"),
        ("unknown settings", "/v1/jobs"),
        ("recordings", "/v1/discrepancies"),
        ("wrong shifts", "/v1/monitors"),
        ("lists", "/v1/webhooks"),
    ],
)
def test_a_body_with_very_many_values_is_refused_without_validation(service, path, case):
    document, count = EXTENSIVE[case]
    detail = problem_of(post_body(service, json.dumps(document).encode(), path=path), 413, "too-large")
    assert detail.startswith(f"the body has {count} or more, and ")
    assert "send only the documented fields" in detail


def test_a_large_content_length_is_rejected_before_the_body(service):
    connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=10)
    try:
        connection.putrequest("POST", "/v1/jobs")
        connection.putheader("Content-Type", "application/json")
        connection.putheader("Content-Length", "2000000")
        connection.endheaders()
        assert connection.getresponse().status == 413
    finally:
        connection.close()


def post_chunked(service, path, media, chunks, piece):
    """Send a chunked body; return the status, the media type and the document of the response."""
    connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=20)
    try:
        connection.putrequest("POST", path)
        connection.putheader("Content-Type", media)
        connection.putheader("Transfer-Encoding", "chunked")
        connection.endheaders()
        try:
            for _ in range(chunks):
                connection.send(b"%x\r\n%s\r\n" % (len(piece), piece))
            connection.send(b"0\r\n\r\n")
        except (BrokenPipeError, ConnectionResetError):
            pass  # rejected before the end of the body
        answer = connection.getresponse()
        return answer.status, answer.headers["content-type"], json.loads(answer.read())
    finally:
        connection.close()


def test_a_chunked_body_is_limited_while_it_is_received(service):
    status, media, document = post_chunked(service, "/v1/jobs", "application/json", 12, b" " * 100_000)
    assert (status, media, document["type"]) == (413, PROBLEM, "/problems/too-large")


@pytest.mark.parametrize(
    ("body", "media", "status", "words"),
    [
        (b"x", "text/csv", 415, "send it as multipart/form-data"),
        (b"x", "multipart/form-data", 400, "Missing boundary"),
        (b"x", "multipart/form-data; boundary=y", 400, "send the record as the part 'file' of a form"),
        (b"--y--\r\n", "multipart/form-data; boundary=y", 422, "/file: Field required"),
        (
            b'--y\r\nContent-Disposition: form-data; name="file"\r\n\r\nt,u\r\n--y--\r\n',
            "multipart/form-data; boundary=y",
            422,
            "/file: not a file: send a file with a file name",
        ),
        (
            b'--y\r\nContent-Disposition: form-data; name="file"; filename="' + b"x" * 10_240,
            "multipart/form-data; boundary=y",
            400,
            "under a name of at most 200 characters",
        ),
        (b"--y\r\nContent-Disposition: \xff\r\n\r\n", "multipart/form-data; boundary=y", 400, "of a form"),
    ],
)
def test_a_malformed_form_is_rejected(service, body, media, status, words):
    kind = {400: "bad-request", 415: "unsupported-media-type", 422: "invalid-request"}[status]
    assert words in problem_of(post_body(service, body, media, "/v1/datasets"), status, kind)


@pytest.mark.parametrize(
    ("form", "words"),
    [
        ({"dt": "-1"}, "/dt: Input should be greater than 0"),
        ({"dt": "0"}, "/dt: Input should be greater than 0"),
        ({"dt": "nan"}, "/dt: Input should be a finite number"),
        ({"dt": "inf"}, "/dt: Input should be a finite number"),
        ({"dt": "0,1"}, "/dt: Input should be a valid number"),
        ({"inputs": ["u_V"] * 17}, "/inputs: List should have at most 16 items"),
        ({"inputs": [""]}, "/inputs/0: String should have at least 1 character"),
        ({"output": "y" * 201}, "/output: String should have at most 200 characters"),
    ],
)
def test_an_invalid_form_field_is_named_in_the_problem(service, form, words):
    assert words in problem_of(service.upload(csv(), **form), 422, "invalid-request")

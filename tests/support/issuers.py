"""Issuer of tokens for tests: keys, tokens, and an HTTP server with its two documents."""

import base64
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from time import time
from typing import Any

AUDIENCE = "islands"


@cache
def make_key(identity: str = "first", kind: str = "EC", size: int | str = "P-256") -> Any:
    """Make a private key; the same one for the same arguments."""
    from joserfc.jwk import JWKRegistry

    return JWKRegistry.generate_key(kind, size, {"kid": identity, "use": "sig"})


def encode_part(document: Any) -> str:
    """Encode a part of a token."""
    content = document if isinstance(document, bytes) else json.dumps(document).encode()
    return base64.urlsafe_b64encode(content).decode().rstrip("=")


def make_claims(issuer: str, **changes: Any) -> dict[str, Any]:
    """Make valid claims; a change to None removes a claim."""
    now = time()
    claims = {
        "iss": issuer,
        "aud": AUDIENCE,
        "sub": "alice",
        "iat": now,
        "nbf": now,
        "exp": now + 600.0,
        "roles": ["islands-submitter"],
        **changes,
    }
    return {name: value for name, value in claims.items() if value is not None}


def sign(claims: dict[str, Any], key: Any, algorithm: str = "ES256", **header: Any) -> str:
    """Sign claims; the header may be changed, and None removes a parameter."""
    from joserfc import jwt
    from joserfc.jws import JWSRegistry

    headers = {"alg": algorithm, "kid": key.kid, "typ": "JWT", **header}
    return jwt.encode(
        {name: value for name, value in headers.items() if value is not None},
        claims,
        key,
        registry=JWSRegistry(algorithms=[algorithm], strict_check_header=False),
    )


class Issuer:
    """Issuer on this machine.

    Attributes
    ----------
    keys : list
        Private keys, whose public parts it offers.
    away : bool
        Whether it answers with an error.
    requests : list of str
        Requested paths.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self.keys = [make_key()]
        self.away = False
        self.requests: list[str] = []

    def token(self, key: Any = None, **changes: Any) -> str:
        """Issue a token with the first key, or another one."""
        return sign(make_claims(self.url, **changes), key or self.keys[0])

    def document(self, path: str) -> Any:
        """Return the document at a path."""
        if path == "/.well-known/openid-configuration":
            return {"issuer": self.url, "jwks_uri": f"{self.url}/keys"}
        return {"keys": [key.as_dict(private=False) for key in self.keys]}


@contextmanager
def issuing() -> Iterator[Issuer]:
    """Serve an issuer on a free port."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            issuer.requests.append(self.path)
            content = json.dumps(issuer.document(self.path)).encode()
            self.send_response(503 if issuer.away else 200)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    issuer = Issuer(f"http://127.0.0.1:{server.server_port}")
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    try:
        yield issuer
    finally:
        server.shutdown()
        thread.join()
        server.server_close()

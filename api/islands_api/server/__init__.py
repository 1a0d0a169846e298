"""HTTP server: listening socket, HTTP protocol and uvicorn's configuration. Read `asgi` first."""

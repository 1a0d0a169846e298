"""Browser page with its errors, its requests to other origins, and its drawings."""

from typing import Any

from support.canvas import RECORD_DRAWING


class Screen:
    """Browser page of the dashboard.

    ``complaints`` has the errors and warnings of the page, ``foreign`` the URLs of requests to other origins.
    What canvases show is read with `support.canvas`.
    """

    def __init__(self, page: Any, origin: str) -> None:
        self.page, self.origin = page, origin
        self.complaints: list[str] = []
        self.foreign: list[str] = []
        page.add_init_script(RECORD_DRAWING)
        page.on("console", self._record_message)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("dialog", self._dismiss_dialog)
        page.on("request", self._record_request)

    def _record_message(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(f"{message.text} {message.location}")

    def _dismiss_dialog(self, dialog: Any) -> None:
        self.complaints.append(f"script dialog: {dialog.message}")
        dialog.dismiss()

    def _record_request(self, request: Any) -> None:
        if not request.url.startswith((self.origin, f"blob:{self.origin}")):
            self.foreign.append(request.url)

    def go(self, address: str = "") -> Any:
        """Open an address relative to the origin and return the page."""
        self.page.goto(f"{self.origin}/{address}")
        return self.page

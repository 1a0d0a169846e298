"""A page in a browser, and all that went wrong in it or left this machine."""

from typing import Any


class Screen:
    """What somebody has before them.

    ``complaints`` are errors and warnings of the page, ``foreign`` what it asked of anybody else.
    """

    def __init__(self, page: Any, origin: str) -> None:
        self.page, self.origin = page, origin
        self.complaints: list[str] = []
        self.foreign: list[str] = []
        page.on("console", self._said)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("dialog", self._asked)
        page.on("request", self._requested)

    def _said(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(f"{message.text} {message.location}")

    def _asked(self, dialog: Any) -> None:
        self.complaints.append(f"a dialog of a script: {dialog.message}")
        dialog.dismiss()

    def _requested(self, request: Any) -> None:
        if not request.url.startswith((self.origin, f"blob:{self.origin}")):
            self.foreign.append(request.url)

    def go(self, place: str = "") -> Any:
        """Open an address of the page, as by hand, and return the page."""
        self.page.goto(f"{self.origin}/{place}")
        return self.page

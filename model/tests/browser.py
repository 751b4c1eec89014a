"""Pages in a real browser without a network, for the tests of all that writes pages."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import ConsoleMessage, Page, Request, sync_playwright

LOCAL = ("file:", "data:")
"""Where a page may take things from."""


GRAPHICS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""What draws in space without a graphics card."""

HINTS = ("Canvas2D: Multiple readback operations",)
"""Warnings of how a page could be faster."""


@dataclass(frozen=True)
class Visit:
    """A page that is open.

    Attributes
    ----------
    page : Page
        Playwright's.
    complaints : list of str
        Errors and warnings of the console, exceptions that nobody caught, and requests that failed or went elsewhere
        than to files; it grows while the page is open.
    """

    page: Page
    complaints: list[str]


def chromium() -> str:
    """Path of Chromium; a test without it fails in CI, or is skipped."""
    path = shutil.which("chromium")
    if path is None:
        assert "CI" not in os.environ, (
            "CI: chromium not found, expected it installed (Debian: apt-get install chromium)"
        )
        pytest.skip("chromium not found (Debian: apt-get install chromium)")
    return path


@contextmanager
def opened(path: Path, width: int = 1200, height: int = 900) -> Iterator[Visit]:
    """Open a file offline in a window of so many pixels, and close it again.

    One at a time, and for no longer than a test: Playwright's loop runs meanwhile, which others would take for theirs.
    """
    complaints: list[str] = []

    def console(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning") and not message.text.startswith(HINTS):
            complaints.append(f"console: {message.type}: {message.text}")

    def request(asked: Request) -> None:
        if not asked.url.startswith(LOCAL):
            complaints.append(f"request: {asked.url}")

    executable = chromium()
    with sync_playwright() as playwright:
        # A container has neither the namespaces of the sandbox nor a graphics card.
        browser = playwright.chromium.launch(executable_path=executable, args=["--no-sandbox", *GRAPHICS])
        try:
            page = browser.new_context(offline=True, viewport={"width": width, "height": height}).new_page()
            page.on("console", console)
            page.on("pageerror", lambda error: complaints.append(f"exception: {error}"))
            page.on("request", request)
            page.on("requestfailed", lambda failed: complaints.append(f"failed: {failed.url}"))
            page.goto(path.as_uri())
            yield Visit(page, complaints)
        finally:
            browser.close()

"""One browser for the tests of a file."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from panel_page import launched
from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with launched() as chromium:
        yield chromium

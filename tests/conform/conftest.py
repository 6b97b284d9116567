"""For the tests of conformance: a report that one of them writes has a Russian text for each of its texts."""

from russian_pages import reports_have_russian_texts  # noqa: F401, a fixture of all tests here

"""What the pages show is run: every ```console block, in order, one shell a page, its output compared.

A line `...` matches any lines. A command ending in `&` runs in the background and the next one waits for its
`ready all`. A block after `<!-- not run: reason -->` is not run, and the reason is printed.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
TEXTS = [ROOT / "README.md", ROOT / "examples/README.md", *ROOT.glob("docs/**/*.md")]
PAGES = sorted(p for p in TEXTS if "```console" in p.read_text())
BLOCK = re.compile(r"(?:<!-- not run: (?P<why>[^>]*) -->\n)?```console\n(?P<body>.*?)```", re.DOTALL)
DONE = "-- done "
# Lines of a minute and more, which other tests need, too: the start of each, and the fixture that runs it once.
SHARED = {"make run": "main_job", ".venv/bin/psabench run compare-converters --chamber": "chamber_job"}


@dataclass(frozen=True, slots=True)
class Command:
    """One `$` line and what the page says it prints."""

    text: str
    shown: tuple[str, ...]

    @property
    def background(self) -> bool:
        return self.text.endswith("&")


def commands(page: str) -> Iterator[Command]:
    for block in BLOCK.finditer(page):
        if block["why"]:
            print(f"not run: {block['why']}")
            continue
        for chunk in re.split(r"^\$ ", block["body"], flags=re.MULTILINE)[1:]:
            text, *shown = chunk.rstrip("\n").split("\n")
            yield Command(text, tuple(shown))


class Shell:
    """bash in the checkout; a marker line follows each command with its exit status."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def run(self, command: Command) -> tuple[list[str], int]:
        assert self._process.stdin is not None
        end = "" if command.background else f'; echo "{DONE}$?"'
        self._process.stdin.write(f"{command.text}{end}\n")
        self._process.stdin.flush()
        return self._read(command.background)

    def _read(self, background: bool) -> tuple[list[str], int]:
        assert self._process.stdout is not None
        lines: list[str] = []
        for line in self._process.stdout:
            if line.startswith(DONE):
                return lines, int(line.removeprefix(DONE))
            lines.append(line.rstrip("\n"))
            if background and lines[-1] == "ready all":
                return lines, 0
        raise AssertionError(f"the shell ended after: {lines[-20:]}")


@contextmanager
def shell() -> Iterator[Shell]:
    with subprocess.Popen(
        ["bash", "--noprofile", "--norc"],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield Shell(process)
        finally:
            assert process.stdin is not None
            process.stdin.write("kill $(jobs -p) 2>/dev/null\nexit\n")
            process.stdin.close()
            process.wait(30)


def shared(command: Command) -> str | None:
    return next((fixture for start, fixture in SHARED.items() if command.text.startswith(start)), None)


def matches(shown: tuple[str, ...], printed: list[str]) -> bool:
    """Line by line, but for the last bits of a float: those of linear algebra are not the same on every processor."""
    pattern = "".join(r"(?:.*\n)*?" if s == "..." else re.escape(_rounded(s).rstrip()) + r"\s*\n" for s in shown)
    return re.fullmatch(pattern, "".join(f"{_rounded(p)}\n" for p in printed)) is not None


def _rounded(line: str) -> str:
    """Its floats of 13 digits and more to 12."""
    return re.sub(r"\b\d+\.\d{12,}(?:e-?\d+)?\b", lambda m: f"{float(m[0]):.12g}", line)


@pytest.mark.host
@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_page_prints_what_it_shows(page: Path, request: pytest.FixtureRequest) -> None:
    with shell() as sh:
        for command in commands(page.read_text()):
            if fixture := shared(command):
                done, _ = request.getfixturevalue(fixture)
                assert command.text in (done.args, " ".join(done.args)), done.args
                printed, status = done.stdout.splitlines(), done.returncode
            else:
                printed, status = sh.run(command)
            text = "\n".join(printed[-30:])
            assert status == 0, f"$ {command.text}\nexit status {status}\n{text}"
            assert matches(command.shown, printed), f"$ {command.text}\nprinted:\n{text}\nshown:\n" + "\n".join(
                command.shown
            )


@pytest.mark.host
def test_the_comparison_can_fail() -> None:
    assert matches(("a", "...", "c"), ["a", "b", "b", "c"])
    assert matches(("...",), [])
    assert not matches(("a", "...", "c"), ["a", "b"])
    assert not matches((), ["x"])
    assert not matches(("a",), ["a", "a"])
    assert matches(("t,-0.999993241346711,1",), ["t,-0.9999932413467109,1"])
    assert not matches(("t,-0.999993241346711,1",), ["t,-0.99999324135,1"])
    assert not matches(("1.00000000001",), ["1.00000000002"])

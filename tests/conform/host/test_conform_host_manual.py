"""The manual mode as a person uses it: on a terminal, with a program started by hand for each case."""

from __future__ import annotations

import itertools
import json
import os
import pty
import re
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from broken_hosts import ROOT, build
from psabench import cli

TIMEOUT_S = 120.0
MAIN = "import sys; from psabench.cli import main; sys.exit(main())"


class Terminal:
    """`psabench conform host` on a pseudo-terminal."""

    def __init__(self, *args: str) -> None:
        self.seen = ""
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.chdir(ROOT)
            os.execv(sys.executable, [sys.executable, "-c", MAIN, "conform", "host", *args])

    def wait_for(self, pattern: str) -> re.Match[str]:
        """What comes next that matches; what came before it is passed over."""
        deadline_s = time.monotonic() + TIMEOUT_S
        while not (found := re.search(pattern, self.seen)):
            assert select.select([self.fd], [], [], max(0.0, deadline_s - time.monotonic()))[0], self.seen
            try:
                self.seen += os.read(self.fd, 4096).decode()
            except OSError:  # it has ended
                pytest.fail(f"no {pattern!r} in {self.seen!r}")
        self.seen = self.seen[found.end() :]
        return found

    def press(self, keys: str) -> None:
        os.write(self.fd, keys.encode())

    def end(self) -> int:
        """Its exit status, once it has ended by itself."""
        try:
            while os.read(self.fd, 4096):
                pass
        except OSError:
            pass
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


@pytest.fixture
def host(tmp_path: Path) -> Path:
    return build(tmp_path)


PORTS = itertools.count(20000 + os.getpid() % 9000)


def a_port() -> str:
    """Below those that the kernel gives away, and not the same in tests that run beside each other, or just before."""
    return str(next(PORTS))


@pytest.mark.host
@pytest.mark.timeout(300)
@pytest.mark.parametrize("mode", ["wb", "ab"])
def test_a_person_starts_the_host_case_by_case(mode: str, host: Path, tmp_path: Path) -> None:
    """As the page has it; the file is written again or appended to."""
    results, port = tmp_path / "told.jsonl", a_port()
    terminal = Terminal(
        *("--manual", "can", "--results", str(results), "--port", port, "--out", str(tmp_path / "out")),
        *("--case", "lost", "torn", "config0_z"),
    )
    for case in ("lost", "torn"):
        said = terminal.wait_for(
            rf"{case}: [^\n]+\r\n  start the host now, Enter skips: can=(\S+) form=0 node=(\d+) results=(\S+)\r\n"
        )
        assert said.groups() == (f"127.0.0.1:{port}", "5", str(results))
        with results.open(mode) as told:
            assert subprocess.run([host, said[1], said[2]], stdout=told, timeout=TIMEOUT_S, check=False).returncode == 0
        terminal.wait_for(r"  passed HOST-")
        # The file of results is emptied as the next case begins; what was kept of this one is one report of a host.
        kept = [json.loads(line) for line in (tmp_path / f"out/{case}.jsonl").read_text().splitlines()]
        assert ["end" in told for told in kept] == [False] * (len(kept) - 1) + [True]
        assert "frame" in kept[0]
    terminal.wait_for(r"config0_z: ")
    terminal.press("\r")
    terminal.wait_for(r"  inconclusive HOST-SETUP-01: skipped with Enter\r\n")
    assert terminal.end() == 4
    told = json.loads((tmp_path / "out/conform.json").read_text())["requirements"]
    assert (told["HOST-LOST-01"], told["HOST-CAN-02"], told["HOST-SETUP-01"]) == ("passed", "passed", "inconclusive")


@pytest.mark.host
@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("link", "start", "case"),
    [
        ("line", lambda folder: [str(build(folder, main="host_line.c"))], "line_cut"),
        ("bus", lambda _: [sys.executable, str(ROOT / "examples/vins_boards.py"), "pik"], "pik_bus"),
    ],
)
def test_a_pseudo_terminal_keeps_its_name(
    link: str, start: Callable[[Path], list[str]], case: str, tmp_path: Path
) -> None:
    results, out = tmp_path / "told.jsonl", tmp_path / "out"
    board = ["--board", "pik"] if link == "bus" else []
    terminal = Terminal("--manual", link, "--results", str(results), "--out", str(out), "--case", case, *board)
    said = terminal.wait_for(rf"{case}: [^\n]+\n[^\n]+ {link}=(\S+) [^\n]*node=5")
    assert said[1] == str(out / link)
    with results.open("ab") as told:
        assert subprocess.run([*start(tmp_path), said[1]], stdout=told, timeout=TIMEOUT_S, check=False).returncode == 0
    terminal.wait_for(r"  passed HOST-")
    assert terminal.end() == 0


def test_a_file_of_something_else_is_not_emptied(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = tmp_path / "letters.txt"
    results.write_text("Dear Sir\n")
    args = ["--manual", "line", "--results", str(results), "--out", str(tmp_path / "out"), "--case", "line_good"]
    assert cli.main(["conform", "host", *args]) == 2
    assert "letters.txt" in capsys.readouterr().err
    assert results.read_text() == "Dear Sir\n"

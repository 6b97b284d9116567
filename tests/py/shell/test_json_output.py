"""--json: every command that prints data has it, made in one way; what it prints is JSON and nothing else."""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import every_command
from psabench import cli, output
from psabench.link.protocol_files import dbc_node
from psabench.places import find_emulator
from psabench.sins.increments import Increments
from psabench.sins.readers import write_csv

from tests.py.link.test_lineport import lines as line_samples

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "scripts/psabench"
PAGE = ROOT / "docs/tools/json.md"

# Commands that print no data for programs, and why.
WITHOUT: Mapping[str, str] = {
    "passport export": "prints JSON anyway",
    "passport header": "prints C, for a compiler",
    "nav header": "prints C, for a compiler",
}
# Modules with a print() of their own on stdout, and why; all others print with psabench.output.
PRINTING: Mapping[str, str] = {
    "output.py": "is the one way",
    "cli.py": "--version: one line for people",
    "shell/terminal.py": "a person at a terminal; shell refuses --json there",
    "shell/command_run.py": "lines of the script's voice, which are JSON with --json",
    "logs/tap_command.py": "ends the line of ^C on a terminal",
    "logs/mf4_child.py": "a process of our own, read by its parent",
    "conform/sources/mf4.py": "a process of our own, read by its parent",
    "passport/command.py": "export and header",
    "sins/command.py": "header",
    "procedures/command_line/handlers.py": "advice of sins-calibration, on stderr with --json",
}


@pytest.fixture(scope="module")
def commands() -> dict[str, argparse.ArgumentParser]:
    return every_command()


def test_every_command_that_prints_data_has_json(commands: Mapping[str, argparse.ArgumentParser]) -> None:
    assert len(commands) > 45
    without = {name for name, p in commands.items() if "--json" not in p._option_string_actions}
    assert without == set(WITHOUT)


def test_json_is_the_same_flag_everywhere(commands: Mapping[str, argparse.ArgumentParser]) -> None:
    flags = [a for p in commands.values() for a in p._actions if "--json" in a.option_strings]
    assert {type(a).__name__ for a in flags} == {"_StoreTrueAction"}
    assert {a.dest for a in flags} == {"json"}
    assert all(str(a.help).startswith("print ") for a in flags)


def _prints(path: Path) -> bool:
    """Whether the module has a print() without file=sys.stderr."""
    text = path.read_text(encoding="utf-8")
    calls = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Call)] if "print(" in text else []
    named = [c for c in calls if isinstance(c.func, ast.Name) and c.func.id == "print"]
    return any(all(ast.unparse(k.value) != "sys.stderr" for k in c.keywords if k.arg == "file") for c in named)


def test_only_these_modules_print_by_themselves() -> None:
    found = {str(path.relative_to(PACKAGE)) for path in PACKAGE.rglob("*.py") if _prints(path)}
    assert found == set(PRINTING)


def test_the_page_has_a_row_for_each_command(commands: Mapping[str, argparse.ArgumentParser]) -> None:
    cells = re.findall(r"^\| (`.*?) \| (?:report|document|stream) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    rows = {name.partition(" --")[0] for cell in cells for name in re.findall(r"`([^`]+)`", cell)}
    rows -= {"psa-emu", "run"}  # psa-emu: tests/e2e; run --list is of no procedure
    groups = {"run PROCEDURE": "run ", "campaign CAMPAIGN": "campaign "}
    expected = {name for name in commands if name not in WITHOUT}
    for group, beginning in groups.items():
        assert group in rows
        expected = {name for name in expected if not name.startswith(beginning) or name in rows}
    assert rows - set(groups) == expected


# ---- what is printed


def run_json(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, Any]:
    """Exit status with --json, which is the one without, and the document on stdout."""
    plain = cli.main(list(words))
    text = capsys.readouterr().out
    status = cli.main([*words, "--json"])
    printed = capsys.readouterr().out
    assert status == plain
    assert printed != text
    return status, json.loads(printed)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Three readings of a PIK."""
    node = dbc_node("pik")
    path = tmp_path / "bus.log"
    path.write_text("".join(f"(0.{k}) can0 {k}8{node}#0000000000000000\n" for k in (1, 2, 3)))
    return path


def test_a_table_is_an_object_a_row(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["decode", str(log), "--board", "pik"]
    assert cli.main(words) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert cli.main([*words, "--json"]) == 0
    printed = capsys.readouterr()
    found = [json.loads(line) for line in printed.out.splitlines()]
    assert len(found) == len(rows) > 0
    assert [list(row) for row in found] == [head.split(",")] * len(rows)
    assert [",".join(str("" if v is None else v) for v in row.values()) for row in found] == [
        row.replace("nan", "") for row in rows
    ]
    assert "frames 1" in printed.err
    status, counted = run_json_over(capsys, tmp_path / "bus.csv", *words)
    assert (status, counted) == (0, {"file": str(tmp_path / "bus.csv"), "frames": 1, "lost": 0, "torn": 0})
    assert (tmp_path / "bus.csv").read_text().splitlines() == [head, *rows]


def run_json_over(capsys: pytest.CaptureFixture[str], out: Path, *words: str) -> tuple[int, Any]:
    status = cli.main([*words, "--out", str(out), "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_words_of_a_line_port_are_rows_as_well(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "capture.bin"
    path.write_bytes(b"\x01" * 50 + line_samples([1, 2, 3, 0xFFFFFFFF]) + b"\x01" * 50)
    assert cli.main(["decode", "--line", str(path), "--json"]) == 0
    [row] = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row[f"word{k}"] for k in range(4)] == [1, 2, 3, 0xFFFFFFFF]


def test_a_converted_log_is_counted(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "bus.asc")
    assert run_json(capsys, "convert", str(log), out) == (0, {"file": out, "messages": 3})


def test_findings_in_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "still.csv"
    still = np.random.default_rng(1).normal(size=(400, 6)) * 1e-6
    end_s = np.arange(1, 401, dtype=np.float64) * 0.01
    write_csv(path, Increments(dt_s=0.01, end_s=end_s, dtheta_rad=still[:, :3], dv_mps=still[:, 3:]))
    status, found = run_json(capsys, "nav", "check", str(path))
    assert status == 1
    assert (found["file"], found["intervals"], found["interval_s"]) == (str(path), 400, pytest.approx(0.01))
    assert any("does not turn" in f for f in found["findings"])


LISTS = [
    ("run --list", lambda found: {"turns", "thermal"} <= {p["name"] for p in found}),
    ("conform list --board pik", lambda found: all(r["grade"].startswith("E") for r in found)),
    ("campaign gyrocompass --list", lambda found: found["studies"][0]["cases"] and found["settings"][0]["unit"]),
    ("campaign quartz-deformation --list", lambda found: {"name", "value", "unit", "grade"} <= set(found[0])),
]


@pytest.mark.parametrize(("line", "holds"), LISTS, ids=[line for line, _ in LISTS])
def test_lists_are_documents(line: str, holds: Any, capsys: pytest.CaptureFixture[str]) -> None:
    status, found = run_json(capsys, *line.split())
    assert status == 0
    assert holds(found)


def test_an_error_leaves_stdout_empty(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["nav", "check", str(tmp_path / "none.csv")], ["decode", str(tmp_path / "none.log")]):
        assert cli.main([*words, "--json"]) == 2
        assert capsys.readouterr().out == ""


def test_what_is_not_finite_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    output.print_json({"a": [float("nan"), 1.5], "b": {"c": float("inf")}})
    assert json.loads(capsys.readouterr().out) == {"a": [None, 1.5], "b": {"c": None}}


def test_a_report_is_printed_as_it_is_stored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["run", "turns", "--condition", "quiet", "--realisations", "2", "--out", str(tmp_path)]
    assert cli.main([*words, "--json"]) == 0
    printed = capsys.readouterr()
    assert printed.out == (tmp_path / output.RESULT).read_text(encoding="utf-8")
    assert json.loads(printed.out)["sections"][0]["procedure"] == "turns"
    assert "report:" not in printed.err


# ---- psa-emu

# Of the text of each list, what names its entries; of the document, those names.
NAMES: Mapping[str, tuple[str, Callable[[Any], list[str]]]] = {
    "scenarios": (r"^(\S+)", lambda d: [s["name"] for s in d["scenarios"]]),
    "profiles": (r"^(\S+) +.*: ", lambda d: [p["profile"] for p in d["profiles"]]),
    "keys": (
        r"^\| `(\S+)` \|(?:[^|\n]*\|){4}$",
        lambda d: [k["key"] for s in (*d["sections"], *d["profiles"]) for k in s["keys"]],
    ),
    "commands": (r"^\| `(\S+)`", lambda d: [c["name"] for c in (*d["commands"], *d["truth_commands"])]),
    "scpi": (
        r"^\| `([^`]+)`",
        lambda d: [h["header"] for rows in (d["common"], *(i["headers"] for i in d["instruments"])) for h in rows],
    ),
    "faults": (r"^\| `(\S+)` \| [A-Z]", lambda d: [k["kind"] for k in d["kinds"]]),
}


def emulator(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([find_emulator(), *words], capture_output=True, text=True, timeout=60, check=False)


def test_every_list_of_the_emulator_is_a_document_as_well() -> None:
    assert re.findall(r"^  --list-(\w+)", emulator("--help").stdout, re.MULTILINE) == list(NAMES)
    for name, (pattern, names) in NAMES.items():
        text, document = emulator(f"--list-{name}").stdout, emulator("--json", f"--list-{name}")
        assert (document.returncode, document.stderr) == (0, "")
        found = names(json.loads(document.stdout))
        assert len(found) > 3
        assert found == re.findall(pattern, text, re.MULTILINE), name


def test_the_version_of_the_emulator_is_a_document_as_well() -> None:
    found = json.loads(emulator("--version", "--json").stdout)
    assert emulator("--version").stdout == "psa-emu {version}\ncompiler: {compiler}\nflags: {flags}\n".format(**found)


def test_the_emulator_rejects_json_without_a_list() -> None:
    done = emulator("quiet", "--json")
    line = "psa-emu: --json: expected a --list option or --version with it, got none\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", line)

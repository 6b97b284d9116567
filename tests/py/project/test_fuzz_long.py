"""tools/fuzz_long.py with targets of shell: what was run counts, whatever ends it; the page shows the record."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import fuzz_long
import pytest
from fuzz_long import Campaign, Spent

BURN = "i=0; while [ $i -lt 30000 ]; do i=$((i+1)); done"  # some hundredths of a second of CPU
SAYS = "echo stat::number_of_executed_units: 7"


def target(folder: Path, name: str, script: str) -> None:
    path = folder / f"fuzz_{name}"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


MARKED = "before\n{}\n{}\n{}\nafter\n"


def shown(record: fuzz_long.Record) -> str:
    begin, end = fuzz_long.MARKS
    return MARKED.format(begin, "\n".join(fuzz_long.table(record)), end)


@pytest.fixture
def binaries(tmp_path: Path) -> Path:
    folder = tmp_path / "build" / "fuzz"
    folder.mkdir(parents=True)
    (folder.parent / "fuzzing.md").write_text(shown({}))
    return folder


def campaign(binaries: Path, *targets: str, cpu_minutes: float = 0.003) -> Campaign:
    path = binaries.parent / "minutes.csv"
    page = binaries.parent / "fuzzing.md"
    return Campaign(list(targets), cpu_minutes, fuzz_long.read(path), path, page, binaries, slice_s=1, sources="now")


def test_each_target_has_its_time_and_no_more(binaries: Path) -> None:
    for name in "ab":
        target(binaries, name, f"{BURN}; {SAYS}")
    first = campaign(binaries, "a", "b")
    assert first.run(2) == 0
    for name in "ab":
        spent = first.record[name, "now"]
        assert 0.18 <= spent.cpu_s < 1.5
        assert spent.inputs > 0
        assert spent.inputs % 7 == 0
    assert first.page.read_text() == shown(fuzz_long.read(first.path))
    again = campaign(binaries, "a", "b", cpu_minutes=0.001)
    again.run(1)
    assert {k: s.inputs for k, s in again.record.items()} == {k: s.inputs for k, s in first.record.items()}


def test_what_was_run_with_other_sources_counts(binaries: Path) -> None:
    target(binaries, "a", f"touch {binaries}/ran; {SAYS}")
    path = binaries.parent / "minutes.csv"
    fuzz_long.write(path, {("a", "before"): Spent(100, 5), ("a", "now"): Spent(81, 6)})
    campaign(binaries, "a", cpu_minutes=3).run(1)
    assert not (binaries / "ran").exists()
    assert fuzz_long.in_all(fuzz_long.read(path), "a") == Spent(181, 11)


def test_a_finding_ends_its_target_alone_and_says_how_to_see_it_again(
    binaries: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target(binaries, "bad", f"echo x >> {binaries}/times; {BURN}; echo 'Test unit written to crash-1'; exit 77")
    target(binaries, "good", f"{BURN}; {SAYS}")
    c = campaign(binaries, "bad", "good")
    c.record["bad", "before"] = Spent(0.1, 5)
    assert c.run(1) == 1
    assert (binaries / "times").read_text() == "x\n"
    assert c.record["good", "now"].cpu_s >= 0.18
    assert c.page.read_text() == shown(fuzz_long.read(c.path))
    assert not [k for k in fuzz_long.read(c.path) if k[0] == "bad"]  # its time begins again
    assert f"fuzz_bad: a finding; again with: {binaries}/fuzz_bad crash-1\n" in capsys.readouterr().err


@pytest.mark.parametrize("status", [1, 127])
def test_a_target_that_does_not_run_keeps_what_it_has_had(
    status: int, binaries: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """No finding: none was written."""
    target(binaries, "a", f"exit {status}")
    c = campaign(binaries, "a")
    c.record["a", "before"] = Spent(0.1, 5)
    assert c.run(1) == 2
    assert c.record == {("a", "before"): Spent(0.1, 5)}
    assert f"fuzz_a: did not run, status {status}\n" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_takes_the_targets_down_and_keeps_what_they_have_had(
    number: signal.Signals, tmp_path: Path, binaries: Path
) -> None:
    target(binaries, "a", f"trap '{SAYS}; exit 72' INT; echo $$ > {tmp_path}/up; while :; do :; done")
    program = (
        "import sys; from pathlib import Path; import fuzz_long as f;"
        f"f.BINARIES = Path('{binaries}'); f.RECORD = Path('{tmp_path}/minutes.csv');"
        f"f.PAGE = Path('{binaries}/../fuzzing.md');"
        "sys.exit(f.main(['a', '--minutes', '60', '--jobs', '1']))"
    )
    env = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    up = tmp_path / "up"
    os.mkfifo(up)
    with subprocess.Popen([sys.executable, "-c", program], env=env, stdout=subprocess.DEVNULL) as process:
        pid = int(up.read_text())
        process.send_signal(number)
        assert process.wait() == 130
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    spent = fuzz_long.in_all(fuzz_long.read(tmp_path / "minutes.csv"), "a")
    assert spent.inputs == 7


def test_nothing_is_begun_once_it_is_ended(tmp_path: Path, binaries: Path) -> None:
    target(binaries, "a", f"touch {tmp_path}/ran")
    c = campaign(binaries, "a")
    c.end()
    assert c.run(1) == 130
    c.one_slice("a", 1)
    assert not (tmp_path / "ran").exists()
    assert not c.path.exists()
    assert c.record == {}


def test_the_page_is_the_record(tmp_path: Path) -> None:
    text = fuzz_long.PAGE.read_text(encoding="utf-8")
    copy = tmp_path / "fuzzing.md"
    copy.write_text(text, encoding="utf-8")
    fuzz_long.page(copy, fuzz_long.read(fuzz_long.RECORD))
    assert copy.read_text(encoding="utf-8") == text, "docs/fuzzing.md is out of date (make docs)"


@pytest.mark.parametrize(
    ("names", "record", "says"),
    [
        (["nosuch"], "target,sources,cpu_s,inputs\n", "no such target: nosuch; there are a\n"),
        (["a"], "target,sources,cpu_s,inputs\na,now,1.0,7\na,then\n", "minutes.csv: line 3: wanted target,sources,"),
    ],
)
def test_bad_input_is_told(
    names: list[str], record: str, says: str, binaries: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    target(binaries, "a", "exit 1")
    path = binaries.parent / "minutes.csv"
    path.write_text(record)
    monkeypatch.setattr(fuzz_long, "BINARIES", binaries)
    monkeypatch.setattr(fuzz_long, "RECORD", path)
    monkeypatch.setattr(fuzz_long, "PAGE", binaries.parent / "fuzzing.md")
    assert fuzz_long.main(names) == 2
    assert says in capsys.readouterr().err
    assert path.read_text() == record


def test_nothing_built_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "fuzzing.md"
    page.write_text(shown({}))
    for name, path in {"BINARIES": tmp_path, "RECORD": tmp_path / "minutes.csv", "PAGE": page}.items():
        monkeypatch.setattr(fuzz_long, name, path)
    assert fuzz_long.main([]) == 2
    assert "no target is built in" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "says"),
    [
        *((f"--minutes={n}", f"{n}: expected minutes, 0 or more") for n in ("nan", "-1", "inf", "one")),
        *((f"--jobs={n}", f"{n}: expected 1 to 64") for n in ("0", "65", "-1", "1.5")),
    ],
)
def test_numbers_have_bounds(option: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        fuzz_long.main([option])
    assert f"argument {option.split('=')[0]}: {says}\n" in capsys.readouterr().err

"""tools/fuzz_long.py with targets of shell: what was run counts, whatever ends it; the page shows the record."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
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


@pytest.fixture
def binaries(tmp_path: Path) -> Path:
    folder = tmp_path / "build" / "fuzz"
    folder.mkdir(parents=True)
    return folder


def campaign(binaries: Path, *targets: str, minutes: float = 0.003) -> Campaign:
    path = binaries.parent / "minutes.csv"
    return Campaign(list(targets), minutes, fuzz_long.read(path), path, binaries, slice_s=1, sources="now")


def test_each_target_has_its_time_and_no_more(binaries: Path) -> None:
    for name in "ab":
        target(binaries, name, f"{BURN}; {SAYS}")
    first = campaign(binaries, "a", "b")
    first.run(2)
    for name in "ab":
        spent = first.record[name, "now"]
        assert 0.18 <= spent.cpu_s < 1.5
        assert spent.inputs > 0
        assert spent.inputs % 7 == 0
    again = campaign(binaries, "a", "b", minutes=0.001)
    again.run(1)
    assert {k: s.inputs for k, s in again.record.items()} == {k: s.inputs for k, s in first.record.items()}


def test_what_was_run_with_other_sources_counts(binaries: Path) -> None:
    target(binaries, "a", f"touch {binaries}/ran; {SAYS}")
    path = binaries.parent / "minutes.csv"
    fuzz_long.write(path, {("a", "before"): Spent(100, 5), ("a", "now"): Spent(81, 6)})
    campaign(binaries, "a", minutes=3).run(1)
    assert not (binaries / "ran").exists()
    assert fuzz_long.in_all(fuzz_long.read(path), "a") == Spent(181, 11)


def test_a_finding_ends_its_target_alone_and_says_how_to_see_it_again(
    binaries: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target(binaries, "bad", f"echo x >> {binaries}/times; {BURN}; echo 'Test unit written to crash-1'; exit 77")
    target(binaries, "good", f"{BURN}; {SAYS}")
    c = campaign(binaries, "bad", "good")
    c.record["bad", "before"] = Spent(0.1, 5)
    c.run(1)
    assert c.findings == ["bad"]
    assert (binaries / "times").read_text() == "x\n"
    assert c.record["good", "now"].cpu_s >= 0.18
    assert not [k for k in fuzz_long.read(c.path) if k[0] == "bad"]  # its time begins anew
    assert f"bad: a finding; again with: {binaries}/fuzz_bad crash-1" in capsys.readouterr().err


def test_ctrl_c_takes_the_targets_down_and_keeps_what_they_have_had(tmp_path: Path, binaries: Path) -> None:
    target(binaries, "a", f"trap '{SAYS}; exit 72' INT; echo $$ > {tmp_path}/up; while :; do :; done")
    program = (
        "import sys; from pathlib import Path; import fuzz_long as f;"
        f"f.BINARIES = Path('{binaries}'); f.RECORD = Path('{tmp_path}/minutes.csv');"
        "sys.exit(f.main(['a', '--minutes', '60', '--jobs', '1']))"
    )
    env = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen([sys.executable, "-c", program], env=env, stdout=subprocess.DEVNULL) as process:
        up = tmp_path / "up"
        while not up.exists() or not up.read_text().endswith("\n"):
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
    with pytest.raises(ProcessLookupError):
        os.kill(int(up.read_text()), 0)
    spent = fuzz_long.in_all(fuzz_long.read(tmp_path / "minutes.csv"), "a")
    assert spent.inputs == 7


def test_the_page_is_the_record() -> None:
    """`make fuzz-long LONG='--minutes 0 --docs'` writes it."""
    text = fuzz_long.PAGE.read_text(encoding="utf-8")
    shown = text.split(fuzz_long.BEGIN)[1].split(fuzz_long.END)[0]
    wanted = fuzz_long.table(fuzz_long.read(fuzz_long.RECORD))
    assert shown.strip() == "\n".join(wanted)


def test_a_target_that_is_not_built_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert fuzz_long.main(["nosuch"]) == 2
    assert "nosuch: not a target" in capsys.readouterr().err

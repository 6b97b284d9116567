"""tools/run_c_tests.py with programs of shell: what is shown, the total, the status."""

from __future__ import annotations

from pathlib import Path

import pytest
import run_c_tests

PASS = "echo '[ RUN      ] test_a'; echo '[  PASSED  ] 3 test(s).'"
SKIP = "echo '[  PASSED  ] 1 test(s).'; echo '[  SKIPPED ] 1 test(s), listed below:'; echo '[  SKIPPED ] test_s'"
FAIL = "echo 'test.c:3: 1 != 2'; echo '[  PASSED  ] 1 test(s).'; echo '[  FAILED  ] 2 test(s), listed below:'; exit 2"


def program(folder: Path, name: str, script: str) -> str:
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize(
    ("scripts", "status", "total", "shown"),
    [
        ([PASS, PASS], 0, "6 passed, 0 failed, 0 skipped", "p0: 3 passed, "),
        ([PASS, SKIP], 0, "4 passed, 0 failed, 1 skipped", "SKIPPED p1: test_s"),
        ([PASS, FAIL], 1, "4 passed, 2 failed, 0 skipped", "test.c:3: 1 != 2\n"),
        ([PASS, f"{PASS}; exit 9"], 1, "6 passed, 1 failed, 0 skipped", "p1: FAILED, exit status 9"),
        ([PASS, "kill -SEGV $$"], 1, "3 passed, 1 failed, 0 skipped", "p1: FAILED, signal 11"),
        (["true"], 1, "0 passed, 0 failed, 0 skipped", ""),
        ([], 1, "0 passed, 0 failed, 0 skipped", ""),
    ],
)
def test_the_total_and_what_is_shown(
    scripts: list[str], status: int, total: str, shown: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    programs = [program(tmp_path, f"p{n}", script) for n, script in enumerate(scripts)]
    assert run_c_tests.main(["--jobs", "2", *programs]) == status
    out = capsys.readouterr().out
    assert out.splitlines()[-1] == f"check: {total}"
    assert shown in out
    assert "RUN" not in out or status == 1


def test_a_program_that_hangs_is_ended_and_its_output_kept(tmp_path: Path) -> None:
    ended = run_c_tests.run(Path(program(tmp_path, "slow", "echo begun; exec sleep 60")), limit_s=0.2)
    assert (ended.status, ended.output, ended.counts()["failed"]) == ("ended after 0.2 s", "begun\n", 1)
    assert (tmp_path / "slow.log").read_text() == "begun\n"


def test_a_program_that_is_not_there_is_a_failure(tmp_path: Path) -> None:
    ended = run_c_tests.run(tmp_path / "none")
    assert "No such file" in ended.status
    assert ended.counts()["failed"] == 1

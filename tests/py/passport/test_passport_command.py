"""`psabench passport` from the command line, on results as a calibration writes them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench import cli
from psabench.passport.store import PassportStore
from psabench.thermal.compensation import fit_soak
from unit_runs import make_run


def written_result(folder: Path, u0_v: float, **changes: Any) -> Path:
    estimates = [
        {
            "name": "u0_v",
            "unit": "V",
            "value": u0_v,
            "sd": 1e-6,
            "ci95": [u0_v - 2e-6, u0_v + 2e-6],
            "within_limits": True,
        },
        {"name": "kx_v_per_g", "unit": "V/g", "value": 1.0, "sd": 2e-6, "ci95": [1 - 4e-6, 1 + 4e-6]},
        {"name": "ky", "unit": "", "value": 0.0, "sd": 1.0, "ci95": [-2, 2], "identifiable": False},
    ]
    section = {
        "label": "quiet",
        "procedure": "turns",
        "estimates": estimates,
        "correlation": {"names": ["u0_v", "ky", "kx_v_per_g"], "matrix": [[1, 0, 0.5], [0, 1, 0], [0.5, 0, 1]]},
    }
    origin = {"psabench": "0.1.0", "begun": "2026-11-27T10:00:00+00:00", "seed": 7}
    folder.mkdir(exist_ok=True)
    data = {"format": 1, "provenance": origin, "sections": [section], **changes}
    (folder / "result.json").write_text(json.dumps(data))
    return folder


def run_passport(tmp_path: Path, *words: str) -> int:
    return cli.main(["passport", *words, "--store", str(tmp_path / "p.sqlite")])


def test_a_calibration_enters_and_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for k, u0_v in enumerate((2.5, 2.6)):
        result = str(written_result(tmp_path / f"r{k}", u0_v))
        assert run_passport(tmp_path, "add", result, "--serial", "QA-1", "--type", "mems") == 0
    assert run_passport(tmp_path, "list") == 0
    assert run_passport(tmp_path, "show", "QA-1") == 0
    shown = capsys.readouterr().out
    assert "QA-1: run 2, turns quiet, 2 quantities" in shown
    assert (
        "run 2: turns quiet, 2026-11-27T10:00:00+00:00, psabench 0.1.0, seed 7, within limits, supersedes run 1"
        in shown
    )
    assert "run 1:" not in shown
    assert run_passport(tmp_path, "show", "QA-1", "--all") == 0
    assert "run 1:" in capsys.readouterr().out
    for words, numbers in ((["show", "QA-1"], [2]), (["show", "QA-1", "--all"], [1, 2]), (["list"], [1, 2])):
        assert run_passport(tmp_path, *words, "--json") == 0
        found_json = json.loads(capsys.readouterr().out)
        (unit,) = found_json if words == ["list"] else [found_json]
        assert [run["number"] for run in unit["runs"]] == numbers
    with PassportStore(tmp_path / "p.sqlite", read_only=True) as store:
        found = store.read_passport("QA-1").runs[0].covariance
    assert found is not None
    assert found.names == ("u0_v", "kx_v_per_g")
    assert np.allclose(found.matrix, [[1e-12, 1e-12], [1e-12, 4e-12]])


def test_runs_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for k, u0_v in enumerate((2.5, 2.6)):
        run_passport(
            tmp_path, "add", str(written_result(tmp_path / f"r{k}", u0_v)), "--serial", "QA-1", "--type", "mems"
        )
    capsys.readouterr()
    assert run_passport(tmp_path, "diff", "QA-1@1", "QA-1@1") == 0
    assert "the same" in capsys.readouterr().out
    assert run_passport(tmp_path, "diff", "QA-1@1", "QA-1") == 1
    assert run_passport(tmp_path, "add", str(tmp_path / "r0"), "--serial", "QB", "--type", "mems") == 0
    made = json.loads((tmp_path / "r0/result.json").read_text())
    made["sections"][0]["procedure"] = "reversal"
    (tmp_path / "r0/result.json").write_text(json.dumps(made))
    assert run_passport(tmp_path, "add", str(tmp_path / "r0"), "--serial", "QC", "--type", "mems") == 0
    printed = capsys.readouterr().out
    assert run_passport(tmp_path, "diff", "QC", "QB") == 2
    assert "QB: expected a run of reversal quiet, got none" in capsys.readouterr().err
    line = next(w for w in printed.splitlines() if "u0_v" in w)
    assert "+0.1" in line


def test_two_procedures_with_one_reading_are_two_methods(tmp_path: Path) -> None:
    for k, name in enumerate(("gyrocompass", "heading-hold")):
        estimates = [{"name": "heading_deg", "unit": "deg", "value": 40.0, "sd": 0.1, "ci95": [39.8, 40.2]}]
        sections = [{"reading": "improved", "estimates": estimates}]
        result = written_result(tmp_path / f"r{k}", 2.5, facts={"procedure": name}, sections=sections)
        assert run_passport(tmp_path, "add", str(result), "--serial", "GP-1", "--type", "platform") == 0
    with PassportStore(tmp_path / "p.sqlite", read_only=True) as store:
        current = store.read_passport("GP-1").current_runs()
    assert [run.method for run in current] == ["gyrocompass improved", "heading-hold improved"]


def test_export_and_header(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fitted = fit_soak("q0_v", np.linspace(-60, 85, 60), np.linspace(-60, 85, 60) ** 2)
    run = make_run(1)
    first = replace(run.quantities[0], compensation=fitted)
    with PassportStore(tmp_path / "p.sqlite") as store:
        store.put_run("QA-1", "quartz", replace(run, quantities=(first, *run.quantities[1:])))
    out = tmp_path / "q.json"
    assert run_passport(tmp_path, "export", "QA-1", "--out", str(out)) == 0
    assert json.loads(out.read_text())["runs"][0]["estimates"][0]["compensation"]["low_c"] == -60
    words = ("header", "QA-1", "--quantity", "q0_v", "--step", "0.1", "--out", str(tmp_path / "q.h"))
    assert run_passport(tmp_path, *words) == 0
    assert "static inline int32_t q0_v(int32_t element_mdegc)" in (tmp_path / "q.h").read_text()
    capsys.readouterr()
    assert run_passport(tmp_path, "header", "QA-1", "--quantity", "q1_v", "--step", "0.1") == 2
    assert "QA-1: expected a run with a curve of q1_v, got none" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"sections": [{"label": "quiet", "estimates": [{"name": "a"}]}]}, "the name of a procedure"),
        ({"provenance": None}, "a result with its provenance, got none"),
        ({"sections": []}, "a result with estimates, got none"),
        (
            {"sections": [{"procedure": "turns", "estimates": [{"name": "a"}]}]},
            "the sections of a calibration, got KeyError",
        ),
    ],
)
def test_results_that_cannot_enter(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, Any], says: str
) -> None:
    result = str(written_result(tmp_path / "r", 2.5, **changes))
    assert run_passport(tmp_path, "add", result, "--serial", "QA-1", "--type", "mems") == 2
    assert says in capsys.readouterr().err
    assert not (tmp_path / "p.sqlite").exists()


def test_a_store_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_passport(tmp_path, "show", "QA-1") == 2
    assert "expected a store of passports, got no such file" in capsys.readouterr().err

"""`psabench run compare-converters` as a user runs it: seven units, one motion, graded."""

from __future__ import annotations

import io
import json
import shutil
from contextlib import redirect_stdout
from pathlib import Path

import pytest
from psabench import cli
from psabench.logs.call_log import calls_path
from psabench.procedures.comparison import truth_path
from psabench.report.diff import report_without_provenance

pytestmark = pytest.mark.host

ROOT = Path(__file__).resolve().parents[3]
PULSES = {"pik": 60e-3, "pik5": 60e-3, "pik6": 5e-3, "pmka": 2.4e-5}  # m/s, as the article prints them


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run with its recording, run.log."""
    folder = tmp_path_factory.mktemp("converters")
    words = ["run", "compare-converters", "--out", str(folder), "--record", str(folder / "run.log")]
    with redirect_stdout(io.StringIO()) as out:
        assert cli.main(words) == 0
    assert "The velocities of all 7 generations are within 2 U of the exact integral" in out.getvalue()
    return folder


def test_seven_units_one_motion(recorded: Path) -> None:
    tmp_path = recorded
    data = json.loads((tmp_path / "result.json").read_text())
    of = {g["name"]: g for g in data["generations"]}
    for name, printed in PULSES.items():
        assert of[name]["quantum_mps"] == pytest.approx(printed, rel=0.03)
    for name in ("pik", "pik5", "pik6", "psa1", "psa2"):  # what the wire shows is the quantum of the formulas
        seen = [s for s in of[name]["step_seen_mps"] if s is not None]
        assert seen
        assert min(seen) == pytest.approx(of[name]["quantum_mps"], rel=1e-3)
    quanta = [float(f"{g['quantum_mps']:.6g}") for g in data["generations"] if g["name"] != "psd1"]
    assert quanta == sorted(quanta, reverse=True)
    # 16 bits of +-10 V each 9.984 ms: one code is as fine as PMKA's each 4.8 ms, and no finer
    assert of["psd1"]["quantum_mps"] == pytest.approx(10 / 2**15 * 9.984e-3 / 1.2 * 9.8094, rel=1e-4)
    assert max(abs(e) for e in of["pmka"]["end_error_mps"]) < 2e-3
    assert max(abs(e) for e in of["psa2"]["end_error_mps"]) < 0.15
    assert of["pik6"]["noise_rms_mps"][2] == pytest.approx(of["pik6"]["quantum_mps"] / 12**0.5, rel=0.1)
    assert (tmp_path / "report.html").read_text().count("<svg") == 3
    assert json.loads((tmp_path / "scenario-converters.json").read_text())["units"]


def test_a_replay_gives_the_live_results(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = recorded / "run.log"
    words = ["run", "compare-converters", "--out", str(tmp_path), "--replay", str(log)]
    assert cli.main([*words, "--seed", "1"]) == 2
    assert "expected no option of the bench beside --replay, got --seed" in capsys.readouterr().err
    assert cli.main(words) == 0
    assert report_without_provenance(tmp_path) == report_without_provenance(recorded)
    assert truth_path(log).stat().st_size < log.stat().st_size / 4  # of one unit
    pcap = Path(shutil.copy(calls_path(log), tmp_path / "run.pcap.calls.csv")).with_suffix("").with_suffix("")
    assert cli.main([*words[:-1], str(pcap)]) == 2
    assert "expected a format that keeps channels (.lcmlog .log .mcap .mf4), got .pcap" in capsys.readouterr().err
    truth_path(log).rename(tmp_path / "elsewhere")
    assert cli.main(words) == 2
    assert "expected the true motion, which psabench run --record writes, got no such file" in capsys.readouterr().err


def test_another_bench_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", "compare-converters", "--scenario", "nowhere.yaml", "--out", str(tmp_path)]) == 2
    assert cli.main(["run", "compare-converters", "--scenario", "quiet", "--out", str(tmp_path)]) == 2
    assert "expected units pik, pik5, pik6, pmka, psd1, psa1, psa2 as in converters.yaml" in capsys.readouterr().err
    other = tmp_path / "other.yaml"
    text = (ROOT / "proto/scenarios/converters.yaml").read_text(encoding="utf-8")
    other.write_text(text.replace("board: pik5\n", "board: psa2\n"), encoding="utf-8")
    assert cli.main(["run", "compare-converters", "--scenario", str(other), "--out", str(tmp_path)]) == 2
    assert "expected units pik5 as in converters.yaml" in capsys.readouterr().err

"""`psabench run koi-flight` over CAN and the receiver's pseudo-terminal: a short flight, its recording, faults."""

from __future__ import annotations

import json
import resource
import time
from pathlib import Path
from typing import Any

import pytest
from psabench import cli
from psabench.koi.wire.live import LiveFlight

pytestmark = pytest.mark.host

ROOT = Path(__file__).parents[3]
SHORT = ROOT / "examples/koi/short_flight.yaml"
ALIGN = ("--align-s", "120")
Lines = pytest.CaptureFixture[str]


def run(out: Path, *words: str | Path) -> int:
    return cli.main(["run", "koi-flight", "--out", str(out), *ALIGN, *map(str, words)])


def found(out: Path) -> dict[str, Any]:
    got: dict[str, Any] = json.loads((out / "result.json").read_text())
    return got


def with_faults(folder: Path, faults: str) -> Path:
    path = folder / "faults.yaml"
    path.write_text(f"{SHORT.read_text()}faults:\n{faults}")
    return path


def test_a_flight_and_its_recording_give_the_same_digits(tmp_path: Path, capsys: Lines) -> None:
    """Live, from the recording; then from it without the correction."""
    assert run(tmp_path / "a", "--scenario", SHORT) == 0
    said = capsys.readouterr().out
    assert "NOTE" not in said
    assert "corrected; autonomous within " in said
    live = found(tmp_path / "a")
    assert live["decision"] == {"passed": True, "reasons": []}
    assert live["truth"]["hybrid_rms_m"] < 6.0
    assert live["truth"]["hour_error_m"] < 100.0
    assert live["lines"]["receiver"]["solutions"] > 1500
    assert abs(live["lines"]["receiver_clock"]["rate_ppm"]) < 3.0 * live["lines"]["receiver_clock"]["rate_sd_ppm"]
    assert run(tmp_path / "c", "--data", tmp_path / "a") == 0
    again = found(tmp_path / "c")
    apart = ("facts", "provenance")
    assert {k: v for k, v in again.items() if k not in apart} == {k: v for k, v in live.items() if k not in apart}
    assert run(tmp_path / "d", "--data", tmp_path / "a", "--corrects", "no") == 0
    alone = found(tmp_path / "d")
    assert not alone["corrected"]
    assert alone["truth"]["hybrid_rms_m"] == pytest.approx(live["truth"]["hybrid_rms_m"], abs=0.1)
    assert alone["truth"]["autonomous_m"][-1] != live["truth"]["autonomous_m"][-1]


def test_the_same_seed_gives_the_same_recording(tmp_path: Path) -> None:
    for name in "ab":
        run(tmp_path / name, "--scenario", SHORT, "--flight-s", "140")
    for name in ("can.log", "receiver.log", "truth.jsonl"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_what_is_wrong_on_the_lines_is_named_and_survived(tmp_path: Path) -> None:
    """Damaged packets, frozen time, an outage, frames that are lost now and then."""
    scenario = with_faults(
        tmp_path,
        """
  - {kind: receiver.bad_checksum, point: gps.solver, at_s: 140, for_s: 4, probability: 0.5}
  - {kind: receiver.frozen_time, point: gps.solver, at_s: 150, for_s: 7}
  - {kind: receiver.outage, point: gps.solver, at_s: 230, for_s: 20}
  - {kind: link.drop, point: sins.can, at_s: 260, for_s: 20, probability: 0.005}
""",
    )
    assert run(tmp_path / "a", "--scenario", scenario) == 0
    got = found(tmp_path / "a")
    lines, notes = got["lines"], "\n".join(got["lines"]["notes"])
    assert got["verdict"] == ""
    assert lines["receiver"]["bad_sums"] > 5
    assert lines["receiver_clock"]["backwards"] > 20
    assert lines["receiver_clock"]["jumps"] == 0
    assert got["measurements"]["position"]["counts"]["invalid"] == pytest.approx(100, abs=2)
    assert 5 < lines["increments"]["filled"] < 100
    assert lines["increments"]["longest_s"] <= 0.2
    assert "solutions in the order of their time" in notes
    assert "messages with their checksum" in notes
    assert "no gaps in the increments" in notes
    assert got["truth"]["hybrid_rms_m"] < 10.0


def test_a_second_without_increments_costs_the_weight(tmp_path: Path, capsys: Lines) -> None:
    """In the air; the flight goes on and says so."""
    scenario = with_faults(tmp_path, "  - {kind: link.drop, point: sins.can, at_s: 230, for_s: 1, probability: 1}\n")
    assert run(tmp_path / "a", "--scenario", scenario) == 1
    said = capsys.readouterr().out
    assert "NO WEIGHT: increments: expected gaps of at most 0.2 s, got one of 1.00 s at about 229." in said
    got = found(tmp_path / "a")
    assert got["estimate"]["weight"] == 0.0
    assert got["corrected"]
    assert got["lines"]["increments"]["filled"] == 100


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--scenario", "stream"), "expected a scenario with a unit that has a serial port"),
        (("--data", "none"), "none/flight.json: expected a file of a recorded flight, got no such file"),
        (("--data", "none", "--seed", "3"), "expected --data without a bench, got --seed"),
        (("--unit-class", "best"), "unit_class: expected good, bins, got best"),
        (("--latitude-deg", "55"), "place: expected latitude_deg and longitude_deg, or neither, got one of them"),
        (("--flight-s", "5"), "flight_s: expected 10 to 36000, got 5"),
        (("--scenario", str(SHORT), "--flight-s", "30"), "flight: expected 120 s of increments at rest, got 30.2"),
        (
            ("--scenario", str(SHORT), "--receiver", "/dev/none"),
            "--receiver /dev/none: expected a serial port, got no such file",
        ),
    ],
)
def test_what_cannot_be_is_one_line(words: tuple[str, ...], said: str, tmp_path: Path, capsys: Lines) -> None:
    assert run(tmp_path / "out", *words) in (2, 3)
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error


def test_in_real_time_the_host_takes_a_tenth_of_a_core(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stretch of 60 s; start, alignment's end and report are beside it."""
    used = list[float]()
    fly = LiveFlight.fly

    def timed(*args: Any) -> None:
        begun, at = resource.getrusage(resource.RUSAGE_SELF), time.monotonic()
        fly(*args)
        ended = resource.getrusage(resource.RUSAGE_SELF)
        cpu_s = ended.ru_utime + ended.ru_stime - begun.ru_utime - begun.ru_stime
        used.append(cpu_s / (time.monotonic() - at))

    monkeypatch.setattr(LiveFlight, "fly", timed)
    words = ["--scenario", str(SHORT), "--real-time", "--flight-s", "60", "--align-s", "30", "--out", str(tmp_path)]
    assert cli.main(["run", "koi-flight", *words]) == 1  # too short for the passport
    print(f"{100 * used[0]:.1f} % of a core")
    assert used[0] < 0.10
    assert found(tmp_path)["lines"]["increments"]["filled"] == 0

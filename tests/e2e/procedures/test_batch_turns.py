"""`psabench run turns --batch` as a user runs it: twelve sensors in one pass, a passport each."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from psabench import cli
from psabench.lcm.event_log import read_events
from psabench.lcm.progress import RESULT
from psabench.passport.store import PassportStore

pytestmark = pytest.mark.host


def test_a_batch_in_one_pass(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "lcm.log"
    assert cli.main(["run", "turns", "--batch", "--lcm", f"file://{log}", "--out", str(tmp_path)]) == 0
    assert sum(e.channel == RESULT for e in read_events(log)) == 12
    told = capsys.readouterr().out
    assert "12 sensors in one pass" in told
    assert "72 numbers are within 2 U of the sensor's true parameters" in told
    data = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert [s["place"] for s in data["sensors"]] == [f"{u}-{c}" for u in "abcd" for c in "xyz"]
    spread = {s["name"]: s for s in data["spread"]}
    assert spread["kx_sum_v_per_g"]["sd"] > 20.0 * spread["kx_sum_v_per_g"]["expanded_u"]
    with PassportStore(tmp_path / "passports.sqlite", read_only=True) as store:
        assert store.unit_serials() == [f"{n}-{c}" for n in (1, 2, 3, 4) for c in "xyz"]
    of_one = json.loads((tmp_path / "c-y" / "result.json").read_text(encoding="utf-8"))
    values = {e["name"]: e["value"] for e in of_one["sections"][0]["estimates"]}
    assert values["kx_sum_v_per_g"] == spread["kx_sum_v_per_g"]["values"][7]
    assert (tmp_path / "turns-d-z.csv").exists()

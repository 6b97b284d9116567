"""Scenarios chosen and edited on the page: checked by psa-emu; the panel's own bench is exchanged."""

from __future__ import annotations

from pathlib import Path

import panel_run as run
import pytest
from psabench.emulator import Emulator
from psabench.panel import scenarios
from psabench.shell.lexer import Wrong


def test_another_scenario_takes_the_place_of_the_bench_and_every_page_is_told(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with run.running("quiet", "--paused", "--out", out) as panel, panel.socket() as asks, panel.socket() as looks:
        run.received(looks, "hello")
        offered = run.asked(asks, 1, do="scenarios")
        assert offered["name"] == "quiet"
        assert {"calibrate", "multi"} <= {n["name"] for n in offered["names"]}
        assert "error" not in run.said(asks, 2, "wait 0.5")
        assert "error" not in run.said(asks, 2, "bench.snapshot quiet.psasnap")
        text = run.asked(asks, 3, do="scenario", name="multi")["text"]
        assert "error" in run.asked(asks, 4, do="scenario", name="../../etc/passwd")
        answer = run.asked(asks, 5, do="begin", name="multi", text=text, seed=7)
        assert answer["time"]["t_s"] == 0.0
        hello = run.received(looks, "hello")
        assert hello["began"] == "scenario multi, seed 7"
        assert len(hello["units"]) == 2
        assert not list(out.glob("*.yaml"))  # it is the shipped one, by its name
        edited = f"{text}# mine\n"
        assert "error" not in run.asked(asks, 6, do="begin", name="multi", text=edited)
        assert len(run.received(looks, "hello")["units"]) == 2
        (file,) = out.glob("*.yaml")
        assert file.read_text() == edited
        assert "error" not in run.said(asks, 7, "save it.psa")
        assert f"start {file}\n" in (out / "it.psa").read_text()
        assert "error" not in run.asked(asks, 8, do="restore", file="quiet.psasnap")  # of the bench before: it is known
        assert "error" not in run.said(asks, 9, "save back.psa")
        assert "start quiet\n" in (out / "back.psa").read_text()


def test_a_wrong_text_is_rejected_with_its_place_and_the_bench_goes_on(tmp_path: Path) -> None:
    with run.running("quiet", "--paused", "--out", tmp_path / "out") as panel, panel.socket() as socket:
        assert "error" not in run.said(socket, 1, "wait 0.5")
        answer = run.asked(socket, 2, do="begin", name="quiet", text="seed: 1\nhead:\n  turn_s: -7\n")
        assert answer["error"] == "line 3, column 11: head.turn_s: expected 0 to 3600, got -7"
        for seed in (-1, 1.5, True, "1", 2**60):
            assert (
                "seed: expected" in run.asked(socket, 3, do="begin", name="quiet", text="seed: 1", seed=seed)["error"]
            )
        assert "text: expected" in run.asked(socket, 4, do="begin", name="quiet", text=["seed: 1"])["error"]
        assert run.said(socket, 5, "time")["result"]["t_s"] == 0.5
        assert not list((tmp_path / "out").glob("*.yaml"))


def test_another_programs_emulator_keeps_its_scenario(tmp_path: Path) -> None:
    with (
        Emulator("quiet", cans=["socketcand:0"], pace="step") as emulator,
        run.running("--connect", str(emulator.control_path), "--out", tmp_path) as panel,
        panel.socket() as socket,
    ):
        assert not run.received(socket, "hello")["restores"]
        for request in ({"do": "scenarios"}, {"do": "begin", "name": "quiet", "text": "seed: 1"}):
            assert "not started by the panel" in run.asked(socket, 1, **request)["error"]


@pytest.mark.parametrize(
    ("text", "place"),
    [("foo: 3\n", "line 1, column 1: foo: unknown key"), ("seed: [1\n", "line 2, column 1: not YAML"), ("\0", "line")],
)
def test_the_place_of_an_error_is_that_in_the_text(text: str, place: str, tmp_path: Path) -> None:
    with pytest.raises(Wrong, match=place):
        scenarios.checked_file(text, tmp_path)
    assert not list(tmp_path.iterdir())

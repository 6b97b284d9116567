"""Where a result comes from: the block of result.json and the foot of the page, and two results compared."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from psabench import cli
from psabench.bench import Bench
from psabench.emulator import Emulator
from psabench.errors import BadInput
from psabench.places import CHECKOUT
from psabench.report import provenance
from psabench.report.diff import Quantity, compare_results, diff_dict, diff_lines, read_result
from psabench.report.page import page_without_foot, whole_page, write_report

ESTIMATE = {"name": "kx_v_per_g", "unit": "V/g", "value": 1.0, "sd": 0.01, "ci95": [0.97, 1.03]}
SEED_OF_FACTS = "/".join(("facts", "seed"))  # where a difference of the seed is
RESULT: Mapping[str, Any] = {
    "format": 1,
    "facts": {"seed": "1"},
    "sections": [{"procedure": "turns", "label": "quiet", "readings": 8, "estimates": [ESTIMATE]}],
}


def written(folder: Path, result: Mapping[str, Any] = RESULT) -> Path:
    write_report(folder, result, whole_page("A page", {"seed": "1"}, ["<p>text</p>"]))
    return folder


def changed(value: float) -> dict[str, Any]:
    """RESULT with another estimate."""
    section = {
        **RESULT["sections"][0],
        "estimates": [{**ESTIMATE, "value": value, "ci95": [value - 0.04, value + 0.04]}],
    }
    return {**RESULT, "facts": {"seed": "2"}, "sections": [section]}


# ---- the block


def test_a_report_says_who_made_it_when_and_from_what(tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    log.write_bytes(b"a")
    with provenance.command_run(["psabench", "run", "turns", "--out", "my folder"]):
        with Emulator("quiet", cans=["none"], seed=7):
            pass
        provenance.note_file("recording", log)
        written(tmp_path)
    origin = json.loads((tmp_path / "result.json").read_text())["provenance"]
    assert origin["command"] == ["psabench", "run", "turns", "--out", "my folder"]
    assert origin["seed"] == 7
    (scenario,) = origin["scenarios"]
    assert (scenario["name"], scenario["seed"], list(scenario["profiles"])) == ("quiet", 7, ["lab32"])
    assert all(len(d) == 64 for d in (scenario["sha256"], scenario["passports_sha256"], *scenario["profiles"].values()))
    (file,) = origin["files"]
    assert file["sha256"] == "ca978112ca1bbdcafac231b39a23dc4da786eff8147c4e72b9807785afee48bb"
    (emulator,) = [b for b in origin["binaries"] if b["name"] == "psa-emu"]
    assert "-ffp-contract=off" in emulator["flags"]
    assert emulator["compiler"].split()[0] in ("GCC", "Clang")
    assert datetime.fromisoformat(origin["begun"]).tzinfo is not None
    assert 0.0 < origin["duration_s"] < 60.0
    page = (tmp_path / "report.html").read_text()
    for words in ("psabench run turns --out &#x27;my folder&#x27;", scenario["sha256"], origin["begun"]):
        assert words in page


def test_the_page_and_the_rest_of_the_data_do_not_depend_on_it(tmp_path: Path) -> None:
    pages = []
    for words in (["psabench", "one"], ["psabench", "two"]):
        with provenance.command_run(words):
            folder = written(tmp_path / words[1])
        pages.append((folder / "report.html").read_text())
    assert pages[0] != pages[1]
    assert (
        page_without_foot(pages[0])
        == page_without_foot(pages[1])
        == whole_page("A page", {"seed": "1"}, ["<p>text</p>"])
    )


def test_a_digest_is_of_what_the_emulator_runs(tmp_path: Path) -> None:
    """The same scenario under another name or seed has the same digest, another value another one."""
    text = (Path(__file__).parents[3] / "proto/scenarios/quiet.yaml").read_text()
    found = []
    for name, old, new in (("a", "", ""), ("b", "seed: 1", "seed: 2"), ("c", "kx_v_per_g: 1.0", "kx_v_per_g: 1.1")):
        path = tmp_path / f"{name}.yaml"
        path.write_text(text.replace(old, new, 1) if old else text)
        with provenance.command_run([]) as run, Emulator(path, cans=["none"]):
            found += run.scenarios
    a, b, c = found
    assert (a["sha256"], a["profiles"], a["passports_sha256"]) == (b["sha256"], b["profiles"], b["passports_sha256"])
    assert (a["seed"], b["seed"]) == (1, 2)
    assert a["sha256"] != c["sha256"]
    assert a["passports_sha256"] != c["passports_sha256"]
    assert a["profiles"] == c["profiles"]


def test_of_a_bench_that_was_there_the_truth_port_tells_the_seed() -> None:
    with Emulator("quiet", truth=True, seed=11) as emulator, provenance.command_run(["a"]) as run:
        with Bench.connect("none", control=emulator.control_path, truth=emulator.truth_path) as bench:
            assert run.scenarios == []
            bench.truth()
        assert run.scenarios == [{"name": "quiet", "seed": 11}]
    with provenance.command_run(["a"]) as run, Bench.start("quiet", seed=12) as bench:
        bench.truth()
        (scenario,) = run.scenarios
        assert (scenario["seed"], len(scenario["sha256"])) == (12, 64)


def test_no_notes_are_taken_outside_of_a_run_and_where_it_is_closed(tmp_path: Path) -> None:
    resolved = '{"seed": 3, "units": []}'
    provenance.note_scenario("lost", resolved)
    with provenance.command_run(["a"]) as run:
        with provenance.without_notes():
            provenance.note_scenario("many", resolved)
        provenance.note_scenario("one", resolved)
        provenance.note_scenario("one", resolved)
        assert [s["name"] for s in run.scenarios] == ["one"]
    assert provenance.noted_run() is None
    origin = json.loads((written(tmp_path) / "result.json").read_text())["provenance"]
    assert (origin["command"], origin["seed"], origin["duration_s"]) == (None, None, None)


def test_scenarios_of_several_seeds_have_no_common_one() -> None:
    with provenance.command_run(["a"]):
        provenance.note_digest("cases", 4, {"x": 1})
        assert provenance.provenance_of_run()["seed"] == 4
        provenance.note_scenario("quiet", '{"seed": 5, "units": []}')
        assert provenance.provenance_of_run()["seed"] is None


def test_the_revision_is_that_of_the_checkout() -> None:
    said = provenance.provenance_of_run()["revision"]
    names = ["HEAD", f"{str(said).removesuffix('-dirty')}^{{commit}}"]
    commits = [subprocess.run(["git", "rev-parse", n], capture_output=True, text=True, cwd=CHECKOUT) for n in names]
    if commits[0].returncode == 0:
        assert commits[0].stdout == commits[1].stdout
    else:
        assert said is None


# ---- two results


def test_a_difference_is_over_the_uncertainty_of_both() -> None:
    d = compare_results(RESULT, changed(1.02))
    (row,) = d.quantities
    assert row.where == "sections/turns, quiet/estimates/kx_v_per_g"
    assert [x.half for x in (row.a, row.b) if isinstance(x, Quantity)] == pytest.approx([0.03, 0.04])
    assert row.u == pytest.approx(0.05)
    assert row.en == pytest.approx(0.4)
    assert not d.same
    assert [r.where for r in d.origin] == [SEED_OF_FACTS]
    assert d.told == ()  # the ends of the interval belong to the estimate
    wide = {**ESTIMATE, "expanded_u": 0.06}
    assert compare_results({"r": [wide]}, {"r": [wide]}).quantities[0].u == pytest.approx(0.06 * 2**0.5)


def test_where_a_result_comes_from_does_not_count(tmp_path: Path) -> None:
    with provenance.command_run(["psabench", "one"]):
        written(tmp_path / "a")
    with provenance.command_run(["psabench", "two"]):
        written(tmp_path / "b", {**RESULT, "facts": {"seed": "9"}})
    d = compare_results(read_result(tmp_path / "a"), read_result(tmp_path / "b" / "result.json"))
    assert d.same
    assert {"provenance/command", SEED_OF_FACTS} <= {r.where for r in d.origin}


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (lambda r: r["sections"][0].update(readings=9), "sections/turns, quiet/readings"),
        (lambda r: r["sections"][0].pop("readings"), "sections/turns, quiet/readings"),
        (lambda r: r["sections"][0]["estimates"][0].update(sd=0.02), "sections/turns, quiet/estimates/kx_v_per_g/sd"),
        (lambda r: r["sections"].append({"procedure": "fourier"}), "sections/fourier/procedure"),
        (lambda r: r.update(within_limits=False), "within_limits"),
    ],
)
def test_every_value_counts(change: Any, where: str) -> None:
    other = json.loads(json.dumps(RESULT))
    change(other)
    for d in (compare_results(RESULT, other), compare_results(other, RESULT)):
        assert [r.where for r in d.differing] == [where]
        assert not d.same


def test_the_command_tells_the_same_from_another_and_both_from_a_file_that_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b, c = written(tmp_path / "a"), written(tmp_path / "b"), written(tmp_path / "c", changed(1.02))
    assert cli.main(["report", "diff", str(a), str(b)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "the same: all 10 values"
    assert cli.main(["report", "diff", str(a), str(c)]) == 1
    said = capsys.readouterr().out
    assert "  turns, quiet: kx_v_per_g  1  1.02       +0.02  0.05         +0.40" in said
    assert said.splitlines()[-1] == "3 of 10 values differ"
    assert cli.main(["report", "diff", str(a), str(c), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["estimates"][0]["en"] == pytest.approx(0.4)
    for text, expected in (("{", "expected a result of psabench in JSON"), ("[]", "with its format, got list")):
        (tmp_path / "bad.json").write_text(text)
        assert cli.main(["report", "diff", str(a), str(tmp_path / "bad.json")]) == 2
        assert expected in capsys.readouterr().err
    assert cli.main(["report", "diff", str(tmp_path), str(a)]) == 2
    assert f"{tmp_path}: expected one of result.json and conform.json, got none" in capsys.readouterr().err
    with pytest.raises(BadInput, match="expected a result of psabench, got no such file"):
        read_result(tmp_path / "nowhere.json")


def test_tables_and_data_of_a_long_list_of_differences() -> None:
    a = {"format": 1, "rows": [{"name": str(k), "x": k} for k in range(30)]}
    b = {"format": 1, "rows": [{"name": str(k), "x": k + 1} for k in range(30)]}
    d = compare_results(a, b)
    lines = list(diff_lines(d))
    assert lines[-2:] == ["  and 10 more", "30 of 61 values differ"]
    assert len(diff_dict(d)["others"]) == 30

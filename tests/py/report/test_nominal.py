"""What a sensor is said to be: the article's values for the article's sensor, the user's for the user's."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from fake_bench import FakeBench, seeded
from psabench.errors import BadInput
from psabench.places import find_emulator
from psabench.procedures.fourier import FourierParams, fourier
from psabench.report import calibration, plots
from psabench.report.grading import Section
from psabench.report.nominal import (
    ARTICLE,
    Nominal,
    console_nominal,
    nominal_dict,
    nominal_of_dict,
    nominal_of_scenario,
    read_passport,
)

ROOT = Path(__file__).parents[3]
OWN = Nominal(source="scenario own.yaml", values={"u0_v": "2.48", "kx_v_per_g": "1.0372", "kxx_v_per_g2": "0"})


def found() -> list[Section]:
    """Fourier on a sensor of 1.0372 V/g."""
    bench = FakeBench(k=(1.0372, 0.0098, 0.004), noise_v=1e-6, rng=seeded("nominal"))
    return [Section(label="", result=fourier(bench, FourierParams(realisations=2)))]


def nominal_in(scenario: Path | str, axis: str = "x", node: int = 5) -> Nominal | None:
    done = subprocess.run([find_emulator(), str(scenario), "--dump"], capture_output=True, text=True, check=True)
    return nominal_of_scenario(json.loads(done.stdout), axis, node, Path(scenario).name)


@pytest.mark.parametrize("scenario", ["quiet", "calibrate"])
def test_the_articles_scenarios_have_the_articles_sensor(scenario: str) -> None:
    assert nominal_in(scenario) is ARTICLE


def test_another_sensor_has_its_own_values_and_one_without_any_has_none(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text((ROOT / "proto/scenarios/quiet.yaml").read_text().replace("kx_v_per_g: 1.0", "kx_v_per_g: 1.0372"))
    nominal = nominal_in(own)
    assert nominal is not None
    assert (nominal.source, nominal.values["kx_v_per_g"], nominal.digits) == ("scenario own.yaml", "1.0372", False)
    assert nominal.number("alpha0_deg") == 0.1121
    assert nominal_in(own, axis="y") is None  # no sensor
    assert nominal_in("gyrocompass") is None  # a quartz sensor has other parameters
    assert nominal_in("multi", node=6) is not None


def test_a_page_of_the_users_sensor_shows_neither_the_articles_values_nor_its_digits() -> None:
    page = calibration.html_page(found(), {}, OWN)
    assert "Beside scenario own.yaml" in page
    assert "Beside the article" not in page
    assert "<td class=num>1.0372</td>" in page
    assert "class=same" not in page
    assert "<span class=other>1.0372" in page.replace("\u202f", "")
    assert "0.1121" not in page
    assert "Beside" not in calibration.html_page(found(), {})  # of a sensor without nominal values
    said = console_nominal(found(), OWN)
    assert said.startswith("beside scenario own.yaml, (?: not identifiable")
    assert [line.split()[:2] for line in said.splitlines()[3:]] == [
        ["u0_v", "2.48"],
        ["kx_v_per_g", "1.0372"],
    ]  # of kxx Fourier knows nothing
    assert console_nominal(found(), None) == ""


def test_alpha0_is_drawn_near_what_is_known_of_it() -> None:
    said = Nominal(source="p", values={"alpha0_deg": "0.5"})
    for nominal, title, lines in ((said, "near the nominal value", 1), (OWN, "near the narrowest", 0)):
        picture = plots.alpha0_figure(found(), nominal)
        assert picture is not None
        assert picture.axes[1].get_title(loc="left") == title
        assert sum(line.get_linestyle() == "--" for line in picture.axes[1].lines) == lines
        low, high = picture.axes[1].get_xlim()
        assert (low < 0.5 < high) == bool(lines)


def test_a_passport_is_read_and_kept_in_a_recording(tmp_path: Path) -> None:
    path = tmp_path / "sn17.yaml"
    path.write_text("kx_v_per_g: 1.0372\nu0_v: 2.48\n")
    nominal = read_passport(path)
    assert nominal == Nominal(source="passport sn17.yaml", values={"u0_v": "2.48", "kx_v_per_g": "1.0372"})
    for each in (nominal, ARTICLE, None):
        assert nominal_of_dict(json.loads(json.dumps(nominal_dict(each)))) == each


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "expected lines NAME: VALUE$"),
        ("- 1", r"expected lines NAME: VALUE, got \[1\]"),
        ("k: 1", "expected u0_v, alpha0_deg, .*, got k"),
        ("u0_v: yes", "u0_v: expected a number, got True"),
        ("u0_v: .inf", "u0_v: expected a number, got inf"),
        ("u0_v: {", "while parsing"),
    ],
)
def test_a_file_that_is_no_passport_is_refused(text: str, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(text)
    with pytest.raises(BadInput, match=expected):
        read_passport(path)
    with pytest.raises(BadInput, match="expected a passport, got no such file"):
        read_passport(tmp_path / "nowhere.yaml")

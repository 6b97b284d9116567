"""Readers of increments: every form gives the same numbers in SI, and what is wrong is named with its row or column."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from psabench.conform.sources import mf4
from psabench.errors import BadInput
from psabench.sins.increments import Increments
from psabench.sins.layout import Layout, layout_of, read_layout, turn
from psabench.sins.readers import read_increments

DT_S, N = 0.01, 50
RNG = np.random.default_rng(3)
RATE, FORCE = RNG.normal(0, 10, (N, 3)), RNG.normal(0, 1, (N, 3))  # deg/s, g
TIME_S = 100.0 + DT_S * np.arange(N)
UNITS = Layout(gyro_unit="deg/s", accel_unit="g")
BY_NAME = replace(UNITS, gyro=("wx", "wy", "wz"), accel=("ax", "ay", "az"), time="t")
BY_PLACE = replace(UNITS, format="float64", gyro=(2, 3, 4), accel=(5, 6, 7), time=1)
COLUMNS = ["t", "wx", "wy", "wz", "ax", "ay", "az"]


def table() -> np.ndarray:
    return np.column_stack([TIME_S, RATE, FORCE])


def write_csv(path: Path, rows: np.ndarray, head: str = ",".join(COLUMNS)) -> Path:
    path.write_text("# a unit\n" + head + "\n" + "".join(",".join(map(repr, map(float, r))) + "\n" for r in rows))
    return path


def write_mcap(path: Path, rows: np.ndarray) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("imu", "jsonschema", b"{}")
        channel = writer.register_channel("/imu", "json", schema)
        for i, (t, *w) in enumerate(rows.tolist()):
            message = {"t": t, "w": dict(zip("xyz", w[:3], strict=True)), "a": dict(zip("xyz", w[3:], strict=True))}
            writer.add_message(channel, log_time=i, publish_time=i, data=json.dumps(message).encode())
        writer.finish()  # type: ignore[no-untyped-call]
    return path


MF4 = """
import sys, json, numpy as np, asammdf
rows = np.load(sys.argv[1])
mdf = asammdf.MDF(version="4.10")
mdf.append([asammdf.Signal(rows[:, i + 1], rows[:, 0], name=n) for i, n in enumerate(sys.argv[3:])])
mdf.save(sys.argv[2], overwrite=True)
"""


def write_mf4(path: Path, rows: np.ndarray) -> Path:
    np.save(path.with_suffix(".npy"), rows)
    done = subprocess.run(
        [sys.executable, "-c", MF4, path.with_suffix(".npy"), path, *COLUMNS[1:]],
        env={"PYTHONPATH": mf4.search_path(), "PATH": "/usr/bin"},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    return path


def write_raw(path: Path, rows: np.ndarray, kind: str = "<f8") -> Path:
    rows.astype(kind).tofile(path)
    return path


FORMS = {
    "csv": (write_csv, BY_NAME),
    "mcap": (write_mcap, replace(UNITS, gyro=("w.x", "w.y", "w.z"), accel=("a.x", "a.y", "a.z"), time="t")),
    "mf4": (write_mf4, replace(UNITS, gyro=("wx", "wy", "wz"), accel=("ax", "ay", "az"), time="time")),
    "bin": (write_raw, BY_PLACE),
}


WITH_MF4 = pytest.mark.skipif(not mf4.asammdf_is_there(), reason="asammdf is not there: make setup")


@pytest.mark.parametrize("form", [pytest.param(f, marks=WITH_MF4) if f == "mf4" else f for f in FORMS])
def test_every_form_gives_the_same_numbers_in_si(form: str, tmp_path: Path) -> None:
    write, layout = FORMS[form]
    found = read_increments(write(tmp_path / f"unit.{form}", table()), layout)
    assert found.dt_s == pytest.approx(DT_S, rel=1e-9)
    assert found.end_s == pytest.approx(TIME_S, abs=1e-9)
    assert found.dtheta_rad == pytest.approx(np.radians(RATE) * DT_S, rel=1e-9)
    assert found.dv_mps == pytest.approx(FORCE * 9.80665 * DT_S, rel=1e-9)


def test_float32_of_a_toolbox_with_a_rounded_clock(tmp_path: Path) -> None:
    """The interval that is given counts; the clock is looked at for gaps all the same."""
    rows = np.column_stack([RATE, FORCE, 0.0100098 * np.arange(1, N + 1)])
    layout = Layout(format="float32", gyro=(1, 2, 3), accel=(4, 5, 6), time=7, interval_s=DT_S)
    found = read_increments(write_raw(tmp_path / "imu.bin", rows, "<f4"), layout)
    assert found.dt_s == DT_S
    assert found.dtheta_rad == pytest.approx(RATE, rel=1e-6)
    with pytest.raises(BadInput, match="before row 21"):
        read_increments(write_raw(tmp_path / "gap.bin", np.delete(rows, range(20, 25), axis=0), "<f4"), layout)


def test_axes_are_turned_into_right_forward_up(tmp_path: Path) -> None:
    """From forward, right, down."""
    layout = replace(BY_NAME, axes="+y +x -z")
    found = read_increments(write_csv(tmp_path / "frd.csv", table()), layout)
    assert found.dv_mps == pytest.approx(FORCE[:, [1, 0, 2]] * [1, 1, -1] * 9.80665 * DT_S, rel=1e-9)
    assert np.array_equal(turn("+y +x -z"), [[0, 1, 0], [1, 0, 0], [0, 0, -1]])


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda r: np.insert(r, 7, r[6], axis=0), r"ascend, got a repeated row in row 8: 100\.060000 s"),
        (lambda r: r[[0, 1, 2, 5, 4, 3, 6, 7, 8, 9]], "ascend, got time that goes back in row 5"),
        (lambda r: np.delete(r, 9, axis=0), "expected intervals of 0.010000 s, got 0.020000 s before row 10"),
        (lambda r: np.where(r == r[4, 2], np.nan, r), "expected finite numbers, got nan in row 5 of 50"),
        (
            lambda r: np.column_stack([np.cumsum(np.repeat([0.01, 0.015], 25)), r[:, 1:]]),
            "expected stamps within 0.015000 s of their grid, got row 25 0.06",
        ),
        (lambda r: r[:1], "expected 2 intervals or more, got 1"),
        (lambda r: r[:0], "expected rows of numbers, got none"),
        (lambda r: r * [1e6, 1, 1, 1, 1, 1, 1], "expected an interval above 0, up to 1 s, got 10000"),
    ],
)
def test_rows_that_are_no_even_stream_are_refused(tmp_path: Path, damage: object, said: str) -> None:
    path = write_csv(tmp_path / "bad.csv", damage(table()))  # type: ignore[operator]
    with pytest.raises(BadInput, match=f"^{path}: .*{said}"):
        read_increments(path, BY_NAME)


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    for text, said in (
        ("t,wx\n", "expected columns wx, wy, wz, ax, ay, az, t, got no wy among t, wx"),
        (",".join(COLUMNS) + "\n1,2,3,4,5,6,seven\n", "line 2: expected numbers, got 1,2,3,4,5,6,seven"),
        (",".join(COLUMNS) + "\n1,2,3\n", "line 2: expected numbers, got 1,2,3"),
    ):
        path.write_text(text)
        with pytest.raises(BadInput, match=said):
            read_increments(path, BY_NAME)
    for name, said in (
        ("none.csv", "no such file"),
        ("x.txt", "expected an ending of .csv .mcap .mf4"),
        ("", "a folder"),
    ):
        (tmp_path / "x.txt").write_text("")
        with pytest.raises(BadInput, match=said):
            read_increments(tmp_path / name, BY_NAME)
    (tmp_path / "odd.bin").write_bytes(b"1234567")
    with pytest.raises(BadInput, match="expected whole rows of 7 float64, 56 bytes each, got 7 bytes"):
        read_increments(tmp_path / "odd.bin", BY_PLACE)
    mcap = write_mcap(tmp_path / "x.mcap", table())
    with pytest.raises(BadInput, match="expected messages of topic /other in JSON, got none"):
        read_increments(mcap, replace(FORMS["mcap"][1], topic="/other"))
    with pytest.raises(BadInput, match=r"message 1: expected a member wx, got none"):
        read_increments(tmp_path / "x.mcap", BY_NAME)
    (tmp_path / "x.mf4").write_bytes(b"no MDF")
    with pytest.raises(BadInput, match="expected an MF4 file"):
        read_increments(tmp_path / "x.mf4", BY_NAME)


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ([1], "layout: expected keys and values"),
        ({"gyros": []}, "layout: expected gyro, gyro_unit.*got gyros"),
        ({"gyro": ["a", "b", "a"]}, "gyro: expected three columns"),
        ({"gyro": "abc"}, "gyro: expected a list of three columns"),
        ({"gyro_unit": "rpm"}, "gyro_unit: expected rad, deg"),
        ({"accel_unit": "gal"}, "accel_unit: expected m/s"),
        ({"time": None}, "expected time, interval_s or both"),
        ({"interval_s": -1}, "interval_s: expected above 0"),
        ({"axes": "+x +y -z"}, "expected three axes that make a right-handed frame"),
        ({"axes": "+x +x +z"}, "expected three axes that make a right-handed frame"),
        ({"format": "float16"}, "format: expected float32 or float64"),
        ({"format": "float32"}, "expected places of columns, 1 to 7, got dtheta_x_rad"),
        ({"columns": "7"}, "columns: expected a number"),
        ({"gyro_unit": ["rad"]}, r"gyro_unit: expected rad, deg.* got \['rad'\]"),
    ],
)
def test_a_layout_that_is_none_is_refused(tmp_path: Path, found: object, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        layout_of(found)
    path = tmp_path / "layout.yaml"
    path.write_text(json.dumps(found))
    with pytest.raises(BadInput, match=f"^{path}: .*{said}"):
        read_layout(path)


def test_a_csv_of_a_spreadsheet_is_read_and_one_field_without_end_is_refused(tmp_path: Path) -> None:
    """The first begins with a byte order mark."""
    path = write_csv(tmp_path / "bom.csv", table())
    text = path.read_text().removeprefix("# a unit\n")
    path.write_text(text, encoding="utf-8-sig")
    assert len(read_increments(path, BY_NAME)) == N
    path.write_text(text + "9" * 200_000)
    with pytest.raises(BadInput, match=f"^{path}: line {N + 2}: expected CSV, got field larger"):
        read_increments(path, BY_NAME)


def test_a_device_is_no_folder() -> None:
    with pytest.raises(BadInput, match=r"^/dev/null: expected increments of a unit, got a device or a pipe"):
        read_increments(Path("/dev/null"), BY_NAME)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=400), form=st.sampled_from(["csv", "mcap", "bin"]))
def test_arbitrary_bytes_are_refused_or_read(tmp_path: Path, data: bytes, form: str) -> None:
    path = tmp_path / f"bytes.{form}"
    path.write_bytes(data if form != "csv" else ",".join(COLUMNS).encode() + b"\n" + data)
    try:
        found: Increments | str = read_increments(path, FORMS[form][1])
    except BadInput as e:
        found = str(e)
    assert found.startswith(str(path)) if isinstance(found, str) else len(found) > 1

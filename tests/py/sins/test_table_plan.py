"""Plans of rotations on a table of up to three axes: its angles give the attitude that the plan's turns give."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from psabench.errors import BadInput
from psabench.native.sins import Turn
from psabench.sins.increments import Increments
from psabench.sins.layout import read_layout
from psabench.sins.plan import read_plan
from psabench.sins.readers import read_increments
from psabench.sins.table import attitudes, moves_of
from psabench.sins.table_run import TableData
from psabench.sins.table_store import ANGLES, INCREMENTS, LAYOUT, read_angles, write_data
from scipy.spatial.transform import Rotation


@pytest.mark.parametrize("plan", ["article", "two_rates"])
def test_moves_of_the_table_make_the_turns_of_the_plan(plan: str) -> None:
    turns = read_plan(plan).turns
    angles, at = np.zeros(3), attitudes(0.4, np.zeros((1, 3)))[0]
    for turn, move in zip(turns, moves_of(turns, 3), strict=True):
        at = at @ Rotation.from_rotvec(np.array(turn.axis_b) * turn.rate_radps * turn.duration_s).as_matrix()
        angles[move.axis - 1] += math.radians(move.angle_deg)
        assert attitudes(0.4, angles[None])[0] == pytest.approx(at, abs=1e-9)


def test_at_angles_of_zero_x_points_along_the_axis_and_z_down() -> None:
    c_nb = attitudes(math.radians(30.0), np.zeros((1, 3)))[0]
    assert c_nb[:, 0] == pytest.approx([0.5, math.sqrt(0.75), 0.0])
    assert c_nb[:, 2] == pytest.approx([0.0, 0.0, -1.0])


def test_a_turn_that_no_axis_can_make_is_refused_with_its_number() -> None:
    about_x = Turn(axis_b=(1.0, 0.0, 0.0), rate_radps=0.1, duration_s=10.0)
    about_y = Turn(axis_b=(0.0, 1.0, 0.0), rate_radps=0.1, duration_s=10.0)
    assert [m.axis for m in moves_of([about_x, about_y], 2)] == [1, 2]
    with pytest.raises(
        BadInput, match=r"plan: turn 2: expected an axis that lies along axis 1 of the table, got \(0.0, 1"
    ):
        list(moves_of([about_x, about_y], 1))
    with pytest.raises(BadInput, match="plan: turn 1: expected turns of the table, got remount"):
        list(moves_of([Turn(axis_b=(1.0, 0.0, 0.0), rate_radps=0.1, duration_s=1.0, remount=True)], 3))


def recorded() -> TableData:
    rng = np.random.default_rng(2)
    data = Increments(
        end_s=np.asarray(0.01 * np.arange(1, 101), np.float64),
        dt_s=0.01,
        dtheta_rad=rng.normal(0, 1, (100, 3)),
        dv_mps=rng.normal(0, 1, (100, 3)),
    )
    return TableData(
        increments=data,
        stand_s=np.array([0.1, 0.2, 0.3]),
        stand_deg=rng.normal(0, 90, (3, 3)),
    )


def test_what_a_run_recorded_comes_back_from_its_files(tmp_path: Path) -> None:
    was = recorded()
    write_data(tmp_path, was)
    increments = read_increments(tmp_path / INCREMENTS, read_layout(tmp_path / LAYOUT))
    found = read_angles(tmp_path / ANGLES, increments)
    assert np.array_equal(found.increments.dtheta_rad, was.increments.dtheta_rad)
    assert np.array_equal(found.increments.dv_mps, was.increments.dv_mps)
    assert found.stand_s == pytest.approx(was.stand_s, abs=1e-9)
    assert found.stand_deg == pytest.approx(was.stand_deg, abs=1e-9)
    assert len(read_angles(None, increments).stand_s) == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "expected rows of angles, got none"),
        ("t,a\n", "line 1: expected t_s,axis1_deg,axis2_deg,axis3_deg, got t,a"),
        ("t_s,axis1_deg,axis2_deg,axis3_deg\n1,2,3\n", "line 2: expected 4 numbers, got 1,2,3"),
        ("t_s,axis1_deg,axis2_deg,axis3_deg\n1,2,3,nan\n", "line 2: expected 4 numbers"),
        ("t_s,axis1_deg,axis2_deg,axis3_deg\n1,0,0,0\n1,0,0,0\n", "expected times that ascend, got 1 s in row 2"),
    ],
)
def test_a_file_of_angles_that_is_none_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(BadInput, match=said):
        read_angles(tmp_path / "a.csv", recorded().increments)

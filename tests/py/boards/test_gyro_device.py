"""A gyro unit over CAN: settings by name, what it refuses in its own words; the node is a stand-in."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from psabench.boards.gyro.device import SETTINGS, Began, Flag, Gyro, Mode, Phase, SelfTest
from psabench.errors import BadInput, DeviceError

from tests.py.boards.test_devices import at_node

ZERO = dict.fromkeys(SETTINGS.values(), 0)


def real32(data: bytes) -> float:
    return float(struct.unpack("<f", data)[0])


def test_every_setting_is_an_object_of_the_eds_and_may_be_written() -> None:
    gyro, _ = at_node(Gyro, 9, {})
    for index, sub in [*SETTINGS.values(), (0x2100, 1), (0x2103, 32)]:
        variable = gyro.node._od.get_variable(index, sub)
        assert variable is not None, (index, sub)
        assert variable.access_type == "rw", (index, sub)


def test_settings_go_out_in_the_type_of_the_object() -> None:
    gyro, node = at_node(Gyro, 9, ZERO)
    gyro.set(latitude_deg=55.5, repeat=6)
    assert [(at[0], at[1]) for at in node.wrote] == [SETTINGS["latitude_deg"], SETTINGS["repeat"]]
    assert real32(node.wrote[0][2]) == 55.5
    assert node.wrote[1][2] == b"\6"


def test_positions_are_written_with_their_count() -> None:
    gyro, node = at_node(Gyro, 9, ZERO | {(0x2103, k): 0 for k in range(1, 33)})
    gyro.positions_deg = (0.0, 180.0, 90.0)
    assert [(at[0], at[1]) for at in node.wrote] == [(0x2103, 1), (0x2103, 2), (0x2103, 3), (0x2102, 1)]
    assert [real32(w[2]) for w in node.wrote[:3]] == [0.0, 180.0, 90.0]
    for angles in ((), tuple(range(33))):
        with pytest.raises(BadInput, match=f"positions: expected 1 to 32 positions, got {len(angles)}"):
            gyro.positions_deg = angles


def test_state_is_read_as_what_it_means() -> None:
    values = {(0x2100, 1): 4, (0x2100, 2): 3, (0x2100, 3): 7, (0x2100, 4): 6, (0x2200, 3): 2**30, (0x2109, 1): 5}
    values[0x2200, 6] = 250_000
    gyro, _ = at_node(Gyro, 9, values)
    assert (gyro.mode, gyro.phase, gyro.position) == (Mode.GYROCOMPASS, Phase.WINDOW, 7)
    assert gyro.flags == Flag.LEVEL_LOST | Flag.ENCODER_FAULT
    assert gyro.encoder_deg == 90.0
    assert gyro.beta_deg == 0.5
    assert gyro.level_node == 5


def test_the_clock_of_the_unit() -> None:
    gyro, _ = at_node(Gyro, 9, {(0x210A, 1): 5_000_000, (0x210A, 2): 2**31 - 1})
    assert gyro.step_s == pytest.approx(5e-3, rel=1e-12)
    assert gyro.steps == 2**31 - 1


def test_conditions_since_the_mode_began() -> None:
    """Counts in the order of the flags' bits, then steps."""
    gyro, _ = at_node(Gyro, 9, {(0x2108, k): 10 * k for k in range(1, 9)})
    assert gyro.began() == {
        Flag.SATURATED: Began(10, 50),
        Flag.LEVEL_LOST: Began(20, 60),
        Flag.ENCODER_FAULT: Began(30, 70),
        Flag.NOT_SETTLED: Began(40, 80),
    }


def test_the_self_test_has_no_result_while_it_is_under_way() -> None:
    gyro, node = at_node(Gyro, 9, {(0x210B, 1): 1, (0x210B, 2): 2})
    gyro.begin_self_test()
    assert node.wrote == [(0x210B, 1, b"\1")]
    assert gyro.self_test is None
    gyro, _ = at_node(Gyro, 9, {(0x210B, 1): 0, (0x210B, 2): 2})
    assert gyro.self_test is SelfTest.FAILED


class Refusing:
    """Takes the place of a node's write: refuses with an abort code."""

    def __init__(self, code: int) -> None:
        self.code = code

    def __call__(self, *_: Any) -> None:
        raise DeviceError("write", self.code, "words of the standard")


@pytest.mark.parametrize(("code", "kind"), [(0x06090031, BadInput), (0x06090030, BadInput), (0x08000022, DeviceError)])
def test_what_it_refuses_is_told_in_its_own_words(
    code: int, kind: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    gyro, _ = at_node(Gyro, 9, ZERO | {(0x2031, 0): "no level unit is fitted", (0x2100, 1): 0})
    monkeypatch.setattr(gyro.node, "write", Refusing(code))
    with pytest.raises(kind, match="no level unit is fitted") as caught:
        gyro.mode = Mode.LEVEL
    assert type(caught.value) is kind

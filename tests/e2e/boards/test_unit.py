"""A PSA-2 over each transport: set-up, registers, frames, refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import Form
from psabench.errors import DeviceError
from rig import BENCH, MakeRig

ACAL, BUFEN = 0x04, 0x02  # of STATUS
DC_GAIN = 1.0001690  # of the minimum-phase filter with its published integer taps, docs/chips/ads1282.md


def volts_at_rest() -> float:
    """Channel X of the bench with the head at 0: model (1) with a = (-sin alpha0, -cos alpha0) g."""
    a0 = np.radians(0.1121)
    ax, ay = -np.sin(a0), -np.cos(a0)
    return float(DC_GAIN * (2.50 + 1.0 * ax + 0.0098 * ay + 0.0010 * ax * ay))


def test_the_set_up_of_the_article_stands_in_the_registers(transport: str, make_rig: MakeRig) -> None:
    unit = make_rig(transport).unit
    unit.wait_ready()
    for converter in "xyz":
        assert unit.register(converter, 1) == 0x56  # CONFIG0: pulse sync, 1000 SPS, minimum phase, sinc + FIR
        assert [unit.register(converter, a) for a in range(5, 11)] == [0, 0, 0, 0, 0, 0x40]  # OFC 000000h, FSC 400000h
    assert unit.register("t", 0) & (ACAL | BUFEN) == ACAL  # BUFEN cleared by the second write, as silicon does
    assert unit.register("t", 3) == 0x82  # DRATE: 100 SPS


@pytest.mark.host
@pytest.mark.parametrize(
    ("profile", "status", "word_bits"),
    [("article", ACAL, 32), ("intent", ACAL | BUFEN, 32), ("w24", ACAL, 24), ("w16", ACAL, 16)],
)
def test_the_profile_decides_the_set_up(
    make_rig: MakeRig, tmp_path: Path, profile: str, status: int, word_bits: int
) -> None:
    scenario = tmp_path / "bench.yaml"
    scenario.write_text(BENCH.read_text().replace("profile: article", f"profile: {profile}"))
    unit = make_rig("socketcand", scenario).unit
    unit.wait_ready()
    assert unit.register("t", 0) & (ACAL | BUFEN) == status
    assert unit.node.read(0x2021) == word_bits


def test_frames_are_settled_in_order_and_one_millisecond_apart(transport: str, make_rig: MakeRig) -> None:
    unit = make_rig(transport).unit
    unit.wait_ready()
    frames = unit.stream(200)
    assert frames.settled.all()
    assert not frames.clipped.any()
    assert np.allclose(np.diff(frames.t_sample_s), 1e-3, atol=8.1e-6)  # the stamp counts 4 us
    assert (unit.frames.counters.lost, unit.frames.counters.torn, unit.frames.counters.overruns) == (0, 0, 0)


@pytest.mark.parametrize(
    ("what", "action", "code"),
    [
        ("ID is read-only", lambda u: u.write_register("x", 0, 0xFF), 0x06010002),
        ("no 12th register", lambda u: u.node.read(0x2000, 12), 0x06090011),
        ("no such object", lambda u: u.node.read(0x2FFF, 0), 0x06020000),
        ("form 9", lambda u: u.node.write(0x2020, 0, 9), 0x06090030),
        ("FD on a classic bus", lambda u: setattr(u, "form", Form.FRAME), 0x08000022),
        ("reserved data rate", lambda u: u.write_register("x", 1, 0x6E), 0x06090030),
        ("write-only opcode", lambda u: u.node.read(0x2010, 1), 0x06010001),
        ("pairs at 4000 a second", lambda u: u.write_register("x", 1, 0x66), 0x08000022),
        ("reserved opcode", lambda u: u.opcode("accel", 0xEE), 0x06090030),
    ],
)
@pytest.mark.host
def test_refusals_carry_their_abort_code_and_the_unit_goes_on(
    make_rig: MakeRig, what: str, action: Callable[[Psa2], object], code: int
) -> None:
    unit = make_rig("socketcand", extra=("--data-bitrate", "0")).unit
    unit.wait_ready()
    with pytest.raises(DeviceError) as refused:
        action(unit)
    assert refused.value.abort_code == code, what
    assert len(unit.stream(5)) == 5


def test_a_written_register_changes_all_three_converters_and_the_codes(transport: str, make_rig: MakeRig) -> None:
    unit = make_rig(transport).unit
    unit.wait_ready()
    before = unit.stream(1).u_v[0]
    unit.write_register("y", 10, 0x20)  # FSC 200000h: half the gain, on X, Y and Z: DIn is common
    assert [unit.register(c, 10) for c in "xyz"] == [0x20] * 3
    after = unit.stream(3).u_v[-1]
    assert np.allclose(after, before / 2, atol=4e-6)


@pytest.mark.host
def test_a_stop_between_the_halves_of_a_pair_is_no_fault(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand")
    rig.unit.wait_ready()
    ids: list[int] = []
    rig.host.listeners.append(lambda m: ids.append(m.arbitration_id))
    halves = 0
    for k in range(40):
        ids.clear()
        rig.unit.start()
        rig.host.advance(2e-3 + k * 25e-6)  # across a sample's period
        rig.unit.stop()
        halves += ids.count(0x185) - ids.count(0x285)
    assert halves > 0  # it did happen
    assert rig.unit.frames.counters.torn == 0


def test_no_frame_comes_after_a_stop(transport: str, make_rig: MakeRig) -> None:
    rig = make_rig(transport)
    rig.unit.wait_ready()
    for _ in range(5):
        rig.unit.start()
        rig.host.advance(0.0304)  # in step pace the stop comes in the middle of a sample's frames
        rig.unit.stop()
        rig.unit.frames.forget()
        rig.host.advance(0.01)
        assert len(rig.unit.frames) == 0
    assert rig.unit.frames.counters.torn == 0


@pytest.mark.parametrize("form", [Form.PAIR, Form.FAST, Form.FRAME, Form.BLOCK])
def test_every_frame_form_that_the_link_carries_tells_the_volts_of_model_1(
    transport: str, make_rig: MakeRig, form: Form
) -> None:
    if form in (Form.FRAME, Form.BLOCK) and transport in ("socketcand", "slc0"):
        pytest.skip(f"{transport} has no FD form")
    unit = make_rig(transport).unit
    unit.wait_ready()
    unit.form = form
    frames = unit.stream(20)
    lsb_v = 10.0 / 2 ** (20 if form is Form.FAST else 23)
    assert np.allclose(frames.axis("x"), volts_at_rest(), rtol=0, atol=lsb_v + 1e-6)
    assert unit.frames.counters.lost == 0


def test_reset_brings_the_set_up_back(transport: str, make_rig: MakeRig) -> None:
    unit = make_rig(transport).unit
    unit.wait_ready()
    unit.write_register("x", 10, 0x20)
    unit.reset()
    unit.wait_ready()
    assert unit.register("x", 10) == 0x40
    assert unit.register("x", 1) == 0x56

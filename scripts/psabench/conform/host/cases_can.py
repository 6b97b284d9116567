"""Boards, good and bad, as a host on CAN meets them: what is done with the board before the host comes, and after."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass

from psabench.conform.host.check import HEARTBEAT_S, limits
from psabench.conform.host.stimulus import READY_S, HostBench

NODE = 5
SCENARIO = f"""\
# The board that is played to a host: every axis another voltage, noise of the converters on, a supply that can fail.
seed: 1
bus: {{bitrate_hz: 1000000}}
site: {{g_mps2: 9.8094}}
head: {{resolution_arcsec: 0, setting_error_arcsec_rms: 0, periodic_arcsec: 0, mount_error_arcsec_rms: 0, turn_s: 0}}
supply: {{volt_v: 12, brownout_v: 9, hysteresis_v: 0.5}}
units:
  - name: a
    board: BOARD
    profile: PROFILE
    node: {NODE}
    serial: 1
    temp_degc: [20, -40, 60, 80]
    axes:
      x: {{sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0}}
      y: {{sensor: mems, u0_v: -1.25, kx_v_per_g: 0.25}}
      z: {{sensor: mems, u0_v: 0.7, kx_v_per_g: -1.0}}
"""
FAMILY, ON_CAN = ("psa2", "psa1"), ("can", "pty")
BUSY = 50
XY, ZT, FAST = 0x180 + NODE, 0x280 + NODE, 0x380 + NODE
STREAM: Mapping[str, int] = {"can_id": 0x080 + NODE, "can_id_mask": 0x4FF}  # these, and no heartbeat or answer


def _nothing(s: HostBench) -> None:
    """The board as it is."""


@dataclass(frozen=True, slots=True)
class Case:
    """title: what the board does. before: when it is powered and no host is there; play: once the stream runs."""

    name: str
    title: str
    _: KW_ONLY
    play: Callable[[HostBench], None]
    before: Callable[[HostBench], None] = _nothing
    streams: bool = True  # a good host starts the stream
    boards: tuple[str, ...] = FAMILY  # of the case
    links: tuple[str, ...] = ON_CAN  # of the case
    profile: str = ""  # it wants this one, whatever the user said
    scenario: str = SCENARIO
    form: int = 0  # frame form that the host has to ask for
    busy: int = BUSY  # frames in 50 ms that say that the stream runs; 0: there is none before
    ready_s: float = READY_S  # simulated, for a host to start it
    ends: bool = False  # what the host tells at the end of the link is checked, too


def _good(s: HostBench) -> None:
    s.run(0.3)
    s.run(float(limits("HOST-RES-02").limit("duration_s")), speed=0.0)


def _just_before_the_wrap(s: HostBench) -> None:
    s.run(float(limits("HOST-CAN-03").limit("seq_modulo")) * 1e-3 - 5.0, speed=0.0)


def _drop(s: HostBench, frames: int, **only: int) -> None:
    """The next frames of the stream, or of one identifier, do not reach anybody."""
    s.run_to_quiet()
    s.fault("link.drop", "a.can", frames=frames, **(only or STREAM))


def _lost(s: HostBench) -> None:
    for frames in (2, 4):
        s.run(0.1)
        _drop(s, frames)
    s.run(0.1)
    _drop(s, 2000)
    s.run(1.1)
    s.clear()
    s.run(0.1)


def _hit(kind: str, halves: tuple[int, ...], frames: int = 1) -> Callable[[HostBench], None]:
    """That happens to the next frames with each of these identifiers in turn, a tenth of a second apart."""

    def play(s: HostBench) -> None:
        for half in halves:
            s.run(0.1)
            s.run_to_quiet()
            s.fault(kind, "a.can", frames=frames, can_id=half)
        s.run(0.1)

    return play


def _mixed(s: HostBench) -> None:
    """PSA2_ZT of a sample and PSA2_XY of the next one are lost: what is left looks like a pair."""
    s.run(0.2)
    for _ in range(3):
        s.run_to_quiet()
        s.fault("link.drop", "a.can", frames=1, can_id=ZT)
        s.run(0.0008)
        s.fault("link.drop", "a.can", frames=1, can_id=XY)
        s.run(0.1)


def _delayed(s: HostBench) -> None:
    s.run(0.1)
    s.run_to_quiet()
    s.fault("link.delay", "a.can", hold_s=0.03, **STREAM)
    s.run(0.4)


def _fast(s: HostBench) -> None:
    """One PSA2_FAST is lost, three times."""
    for _ in range(3):
        _drop(s, 1, can_id=FAST)
        s.run(0.1)


def _length(s: HostBench) -> None:
    """Between two samples a frame that looks like a first half and is too short."""
    for _ in range(2):
        s.run(0.1)
        s.run_to_quiet()
        s.put(f"{XY:03X}#11223344556677")
    s.run(0.1)


def _others(s: HostBench) -> None:
    """A neighbour's samples in the middle of ours, a frame destroyed on the bus, the controller off it and back."""
    s.run(0.1)
    for half in ("186#1122334455660001", "286#1122334455667788", "706#05", "086#01FF8101000000FF"):
        s.control.call("run.until", event="INT_RISE")
        s.put(half)
        s.run(0.01)
    s.fault("link.error_frame", "a.can", frames=2)
    s.run(0.1)
    s.fault("link.bus_off", "a.can")
    s.run(0.1)


def _over_range(s: HostBench) -> None:
    row = limits("HOST-RANGE-01")
    for axis in "xyz":
        for sign in (1, -1):
            for name in ("in_range_v", "over_range_v"):
                s.fault("sensor.stuck", f"a.sensor.{axis}", out_v=sign * float(row.limit(name)))
                s.run(0.08)
                s.clear()
            s.run(0.08)


def _restart(s: HostBench) -> None:
    s.run(0.1)
    s.fault("supply.brownout", "supply", drop_v=6, for_s=0.02)
    s.run(0.05)
    s.await_stream()
    s.run(0.1)
    s.put(f"000#81{NODE:02X}")
    s.run(0.05)
    s.await_stream()
    s.run(0.1)


def _flags(s: HostBench) -> None:
    """Somebody writes CONFIG1, and 63 words are not settled; then samples that tell of a conversion that was lost."""
    s.run(0.1)
    s.put(f"{0x600 + NODE:03X}#2F00200309000000")
    s.run(0.15)
    s.run_to_quiet()
    s.put(f"000#02{NODE:02X}")
    s.run(0.002)
    for _ in range(3):
        t_ns = s.control.call("run.until", event="DRD_A").t_ns
        seq = round(t_ns * 1e-6 - FIRST_MS) & 0xFFFF
        s.put(f"{XY:03X}#112200332200{seq.to_bytes(2, 'little').hex().upper()}")
        s.put(f"{ZT:03X}#443300102705{(t_ns // 4000 & 0xFFFF).to_bytes(2, 'little').hex().upper()}")
        s.run(0.0005)
    s.run_to_quiet()
    s.put(f"000#01{NODE:02X}")
    s.run(0.1)


FIRST_MS = 189.330  # conversion number 0 after power-on (docs/boards/psa2.md, set-up after Res)


def _silence(s: HostBench) -> None:
    row = limits("HOST-STALE-01")
    s.run(0.1)
    _drop(s, 2 * round(float(row.limit("silent_max_s")) * 1e3))
    s.run(0.2)
    s.clear()
    s.run_to_quiet()
    s.await_read()  # a host that is late would see less of the silence
    s.mark("silent")
    s.fault("link.drop", "a.can", **STREAM)
    s.run(float(row.limit("told_after_s")), speed=1.0)
    s.clear()
    s.mark("back")
    s.run(0.3, speed=1.0)


def _frozen(s: HostBench) -> None:
    s.run(0.1)
    s.fault("controller.frozen_words", "a.kpsa")
    s.run(2.0 * float(limits("HOST-STALE-02").limit("frozen_after_s")))
    s.clear()
    s.run(0.2)


def _in_wrong_order(s: HostBench) -> None:
    s.fault("controller.setup_order", "a.kpsa")
    s.control.call("unit.reset", unit="a")
    s.run(0.4, speed=0.0)


def _with_a_wrong_register(axis: str) -> Callable[[HostBench], None]:
    def before(s: HostBench) -> None:
        s.run(0.3, speed=0.0)
        s.fault("chip.flip", f"a.adc.{axis}", register=1, mask=0x08)

    return before


def _until_reported(s: HostBench) -> None:
    """A good host reads every register of the set-up first, which takes a slow one a second."""
    s.await_report()
    s.run(0.3, speed=1.0)


def _rate(s: HostBench) -> None:
    row = limits("HOST-RATE-01")
    s.run(0.1)
    for axis in "xyz":
        s.fault("chip.clock", f"a.adc.{axis}", clock_ppm=int(row.limit("silent_ppm")))
    s.run(1.2)
    s.clear()
    s.mark("off")
    for axis in "xyz":
        s.fault("chip.clock", f"a.adc.{axis}", clock_ppm=-2 * int(row.limit("report_ppm")))
    s.run(1.5)


def _emcy(s: HostBench) -> None:
    s.run(0.1)
    s.fault("chip.drdy_stuck", "a.adc.x", level="high")
    s.run(0.4, speed=1.0)
    s.clear()
    s.run(0.2)


def _off(s: HostBench) -> None:
    """Its supply is switched off and stays so."""
    s.run(0.1)
    s.control.call("supply.output", on=False)
    beats = float(limits("HOST-CAN-07").limit("gone_after_periods"))
    s.run(beats * HEARTBEAT_S + 1.0, speed=1.0)


def _with_slow_answers(s: HostBench) -> None:
    s.run(0.3, speed=0.0)
    s.fault(
        "link.delay", "bus.can0", can_id=0x580 + NODE, frames=2, hold_s=0.6 * limits("HOST-CAN-10").limit("timeout_s")
    )


CASES: Mapping[str, Case] = {
    c.name: c
    for c in (
        Case("good", "a good board, over the wraps of SEQ and TSTAMP", before=_just_before_the_wrap, play=_good),
        Case("power_on", "a board at power-on", play=lambda s: s.run(0.2)),
        Case("slow", "answers that take 0.6 s", before=_with_slow_answers, play=lambda s: s.run(0.1)),
        Case("lost", "1, 2 and 1000 samples are lost", play=_lost),
        Case("torn", "halves of samples are lost", play=_hit("link.drop", (ZT, XY, ZT))),
        Case("mixed", "the second half of a sample and the first of the next are lost", play=_mixed),
        Case("order", "halves come in another order", play=_hit("link.reorder", (ZT, XY))),
        Case("twice", "halves come twice", play=_hit("link.duplicate", (ZT, XY), frames=2)),
        Case("delayed", "frames come 30 ms late", play=_delayed),
        Case("corrupt", "a bit of a frame is wrong without a CRC error", play=_hit("link.corrupt", (ZT, XY, ZT, XY))),
        Case("fast", "frame form 1, and three frames are lost", play=_fast, form=1, busy=30),
        Case("length", "a PSA2_XY of 7 bytes", play=_length),
        Case("others", "frames of another node, error frames, off the bus and back", play=_others),
        Case("over_range", "each axis at 9.9 V and beyond the range, both ways", play=_over_range),
        Case("restart", "a brown-out, then reset node by another master", play=_restart),
        Case("flags", "words that have not settled, conversions that were lost", play=_flags),
        Case("silence", "no frame, for a moment and for longer", play=_silence),
        Case("frozen", "codes stand still while numbers go on", play=_frozen),
        Case("setup_order", "a set-up in the wrong order", before=_in_wrong_order, play=_until_reported, streams=False),
        Case(
            "config0_x",
            "an incorrect CONFIG0 of converter X",
            before=_with_a_wrong_register("x"),
            play=_until_reported,
            streams=False,
        ),
        Case(
            "config0_z",
            "an incorrect CONFIG0 of converter Z",
            before=_with_a_wrong_register("z"),
            play=_until_reported,
            streams=False,
        ),
        Case("rate", "a converter's clock 100 ppm off, then 2000 ppm", play=_rate),
        Case("emcy", "data-ready sticks: an emergency, and its end", play=_emcy),
        Case("off", "the supply is switched off", play=_off),
    )
}

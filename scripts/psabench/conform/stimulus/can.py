"""Stimuli of the services that all boards have on CAN."""

from __future__ import annotations

from psabench.boards.objects import Common
from psabench.boards.registry import BOARDS
from psabench.boards.unit import tpdo_numbers
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut
from psabench.conform.plan import stimulus
from psabench.conform.raw_can import OFF, Nmt, Talk, flood, read, talk
from psabench.conform.verdict import Inconclusive, expect

BEATS_S, STREAM_S = 3.3, 0.2
FLOOD_S, TRIES = 0.15, 5  # each flood twice as long as the one before
CALM_S = 2.0  # an overload is over after one second
CALLED = (Common.DEVICE_TYPE, Common.ERROR_REGISTER, Common.DEVICE_NAME, Common.IDENTITY, Common.HEARTBEAT_MS, 0x5FFF)


@stimulus("services", boards=BOARDS)
def services(s: Dut) -> Capture:
    """A reset, heartbeats, SDO requests good and bad, a stream."""
    with talk(s) as t, s.take(lines=False) as take:
        t.take = take
        take.marks["reset"] = s.bench.time_s
        s.reset()
        s.run_for(BEATS_S)
        for index in CALLED:
            t.send(t.sdo_rx, read(index))
            s.run_for(0.005)
        t.nmt(Nmt.START)
        s.run_for(STREAM_S)
        t.hush()
    return s.capture("services", take)


@stimulus("overload", boards=BOARDS)
def overload(s: Dut) -> Capture:
    """Every TPDO switched on, a stream, a bus that others fill until samples are lost, two seconds of calm."""
    with talk(s, reset=True) as t:
        s.wait_ready()
        everything_on(t)
        with s.take(lines=False) as take:
            t.take = take
            before = t.counter("Dropped")
            t.nmt(Nmt.START)
            s.run_for(STREAM_S)
            for k in range(TRIES):
                take.marks["flood"] = float(len(take.frames))
                flood(t, FLOOD_S * 2**k)
                s.run_for(CALM_S)
                if t.counter("Dropped") != before:
                    break
            t.hush()
            take.facts["dropped"] = t.counter("Dropped") - before
            take.facts["history"] = t.upload(Common.ERROR_HISTORY, 1)
    if not take.facts["dropped"]:
        _nothing_lost(s)
    return s.capture("overload", take)


def _nothing_lost(s: Dut) -> None:
    expect(not s.lockstep, "no sample dropped on a bus that was full for seconds", "samples dropped and counted")
    raise Inconclusive("the bus could not be filled long enough for a sample to be lost")


def everything_on(t: Talk) -> None:
    """TPDOs that the host may switch on. Those of a PSA-2 are chosen by its frame form."""
    node = t.s.unit.node
    if t.s.variant.family == "psa2":
        return
    for k in tpdo_numbers(node):
        cob = t.number(Common.TPDO + k, 1)
        if cob & OFF:
            t.download(Common.TPDO + k, 1, (cob & ~OFF).to_bytes(4, "little"))

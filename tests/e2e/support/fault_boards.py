"""A host of the boards other than PSA-2, told the pages alone: what it sees on CAN in a while of simulated time.

docs/reference/protocol_psd1.md, protocol_pmka.md and protocol_pik.md define the messages, psabench.dbc their packing.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import cast

import cantools
import numpy as np
from fault_host import HEARTBEAT, Floats, Host
from psabench.link.can_host import Message
from rig import DBC, HERE

EMCY = 0x080
TS_S, UREF_V = 4.8e-3, 10.0  # PMKA: period; a reset in each of them balances UREF
RESET_CODES = UREF_V * TS_S / 2 / (1e4 * 0.47e-6) / 10.0 * 2**15  # by which one moves the code: Ur of 10 V
PIK6_HZ_PER_V = 2000.0


@dataclass(frozen=True, slots=True)
class Board:
    """How a board says what."""

    first: str  # message of a reading that is looked at first
    counter: str  # its number, in message `numbered`
    numbered: str
    numbered_id: int  # of node 0
    wraps: int
    period_s: float
    full_v: float  # the largest input that it can tell
    part: str  # of its controller


BOARDS = {
    "psd1": Board("PSD1_CYCLE", "CNT", "PSD1_CYCLE", 0x180, 256, 0.972e-3, 10.0, "kpsd"),
    "pmka": Board("PMKA_CODES", "SEQ", "PMKA_STATE", 0x280, 65536, TS_S, UREF_V, "controller"),
    "pik": Board("PIK_COUNTS", "SEQ", "PIK_COUNTS", 0x180, 256, 0.01, 10.0, "controller"),
}

# The bench of the tests: d PSD-1, m PMKA, p PIK-6.
SCENARIO = HERE / "faults_boards.yaml"
SETUP_S = 0.5
# What must be accepted; everything else must be refused.
ACCEPTED = {
    "sensor.open": r"none",
    "sensor": r"[dmp]\.sensor\.[xyz]",
    "analog.load_open": r"[dmp]\.afe\.z",
    "analog.load_short": r"[dmp]\.afe\.z",
    "analog": r"[dmp]\.afe\.[xyz]",
    "chip.drdy_stuck": r"d\.adc\.x",
    "chip.dout_dead": r"d\.adc\.[xyz]|m\.adc|p\.conv\.[xyz]",
    "chip.lost_sync": r"none",
    "chip.clock": r"d\.adc\.[xyz]|p\.clock",
    "chip.flip": r"d\.adc\.[xyz]|m\.rom|p\.conv\.[xyz]",
    "controller.frozen_words": r"d\.kpsd|[mp]\.controller",
    "controller.skip_sync_t": r"none",
    "controller.setup_order": r"none",
    "controller": r"m\.controller",
    "line.open": r"(?!)",  # no differential pairs
    "line.missing_pulse": r"d\.line\.SCLK|m\.line\.CONV",
    "line.extra_pulse": r"d\.line\.SCLK|m\.line\.CONV",
    "line": r"[dmp]\.line\..*",
    "link.error_frame": r"[dmp]\.can|bus\.can0",
    "link.bus_off": r"[dmp]\.can",
    "link.stall": r"client\.\d+",
    "link": r"[dmp]\.can|bus\.can0|client\.\d+",
    "supply": r"supply",
    "platform": r"platform\..*",  # there is none here
    "receiver": r".*\.solver",  # there is none here
    "gyro": r".*\.gyro\.[xyz]",  # nor these
    "chamber": r"chamber",  # nor this
    "table": r"table\.\d",  # nor this
    "head": r"head",
    "scpi": r"scpi\.(head|supply)",
}

_database = cast(cantools.database.can.Database, cantools.database.load_file(DBC))


def _decoded(m: Message) -> tuple[str, dict[str, float]] | None:
    try:
        row = _database.get_message_by_frame_id(m.arbitration_id)
    except KeyError:
        return None
    values = row.decode(bytes(m.data), decode_choices=False)
    assert isinstance(values, dict)
    return row.name, {name: float(v) for name, v in values.items() if isinstance(v, int | float)}


@dataclass(frozen=True, slots=True)
class Seen:
    """What a node sent."""

    board: Board
    rows: dict[str, list[dict[str, float]]]  # by message, in order of arrival
    at_s: list[float]  # arrival of each `board.first`
    emcy: list[int]
    boots: int
    errors: int  # error frames of the bus
    repeated: int  # messages that are the one before them, byte for byte

    def column(self, message: str, signal: str) -> Floats:
        return np.array([row[signal] for row in self.rows.get(message, [])])

    def codes(self, axis: int) -> Floats:
        """Raw, reading by reading."""
        return self.column(self.board.first, "XYZ"[axis])

    def volts(self, axis: int) -> Floats:
        """At the load of the axis, reading by reading."""
        codes = self.codes(axis)
        if self.board.first == "PSD1_CYCLE":
            return np.asarray((codes - 2**15) / 2**15 * 10.0)
        if self.board.first == "PIK_COUNTS":
            return np.asarray(codes / self.board.period_s / PIK6_HZ_PER_V)
        resets = self.column("PMKA_STATE", f"RESET_{'XYZ'[axis]}")
        n = min(len(codes), len(resets))
        steps = np.diff(codes[:n] / 10.0 * 2**15) + resets[1:n] * RESET_CODES
        return np.asarray(steps / RESET_CODES * UREF_V)

    def mean_v(self, axis: int) -> float:
        volts = self.volts(axis)
        assert len(volts) >= 20, f"{len(volts)} readings came"
        return float(volts.mean())

    def numbers(self) -> list[int]:
        return [int(n) for n in self.column(self.board.numbered, self.board.counter)]

    def steps(self) -> Floats:
        return np.asarray(np.diff(self.numbers()) % self.board.wraps)

    def complaints(self) -> list[str]:
        """What the protocol does not allow in an undisturbed stream."""
        said = []
        if len(self.numbers()) < 5:
            return ["no stream"]
        if (self.steps() != 1).any():
            said.append("numbers")
        if self.repeated:
            said.append("repeated")
        if self.errors:
            said.append("errors")
        gaps_s = np.diff(self.at_s)
        if (np.abs(gaps_s - np.median(gaps_s)) > 0.5 * self.board.period_s + 5e-4).any():
            said.append("instants")
        return said


def seen(host: Host, unit: str, board: Board) -> Seen:
    """What has come from a unit since the last `watch` of the host began."""
    node = host.node[unit]
    mine = [m for m in host._kept if not m.is_error_frame and m.arbitration_id & 0x7F == node]
    rows: dict[str, list[dict[str, float]]] = {}
    at_s = []
    for m in mine:
        told = _decoded(m)
        if told is None or m.arbitration_id < 0x180 or m.arbitration_id > 0x57F:
            continue
        rows.setdefault(told[0], []).append(told[1])
        if told[0] == board.first:
            at_s.append(m.timestamp)
    return Seen(
        board=board,
        rows=rows,
        at_s=at_s,
        emcy=[int.from_bytes(m.data[:2], "little") for m in mine if m.arbitration_id == EMCY + node],
        boots=sum(m.arbitration_id == HEARTBEAT + node and bytes(m.data) == b"\0" for m in mine),
        errors=sum(m.is_error_frame for m in host._kept),
        repeated=sum((a.arbitration_id, bytes(a.data)) == (b.arbitration_id, bytes(b.data)) for a, b in pairwise(mine)),
    )

"""PSA-2's transfers as a recording of Int, Data and CLK shows them: what lies within each low of Int."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from psabench.conform.capture.intervals import within
from psabench.conform.capture.log import Bools, LineLog
from psabench.conform.verdict import conclusive
from psabench.link.signals import Floats, Ints

WORDS = 4  # a transfer (article, section 5: protocol of exchange)
LEAST = 20  # transfers that a judgement needs


@dataclass(frozen=True, kw_only=True)
class Transfers:
    """n lows of Int that the recording has whole, and the edges of CLK within each."""

    fall_ns: Ints  # (n,) of Int
    rise_ns: Ints  # (n,) of Int
    clk_rise_ns: Ints  # (m,) all rises of CLK in the recording
    clk_fall_ns: Ints
    log: LineLog

    def __len__(self) -> int:
        return len(self.fall_ns)

    @cached_property
    def rises(self) -> list[Ints]:
        """Rises of CLK in each transfer."""
        return [within(self.clk_rise_ns, a, b) for a, b in zip(self.fall_ns, self.rise_ns, strict=True)]

    @cached_property
    def falls(self) -> list[Ints]:
        """Falls of CLK in each transfer, one at its very end included."""
        return [within(self.clk_fall_ns, a, b) for a, b in zip(self.fall_ns, self.rise_ns, strict=True)]

    def of(self, bits: int) -> Transfers:
        """Those with exactly so many rises of CLK."""
        keep = np.array([len(r) == bits for r in self.rises], bool)
        return replace(self, fall_ns=self.fall_ns[keep], rise_ns=self.rise_ns[keep])

    def grid_ns(self, bits: int) -> Floats:
        """(n, 4 * bits) rises of CLK. Every transfer must have them all."""
        return np.array(self.rises, np.float64).reshape(-1, WORDS * bits)

    def bits(self, bits: int) -> Bools:
        """(n, 4 * bits) levels of Data at the rises of CLK."""
        at = np.array(self.rises, np.int64).reshape(-1, WORDS * bits)
        return self.log["Data"].at(at).astype(bool)

    def words(self, bits: int, *, lsb_first: bool = True) -> Ints:
        """(n, 4) unsigned words of transfers that have all their bits, in the order of sending."""
        levels = self.bits(bits).reshape(-1, WORDS, bits)
        weights = np.int64(1) << np.arange(bits, dtype=np.int64)
        words: Ints = levels @ (weights if lsb_first else weights[::-1])
        return words


def transfers(log: LineLog) -> Transfers:
    """Raises Inconclusive where the recording has too few, or no such lines."""
    for name in ("Int", "Data", "CLK"):
        conclusive(name in log, f"the recording has no line {name}")
    fall, rise = log.pulses("Int", 0)
    conclusive(len(fall) >= LEAST, f"{len(fall)} transfers were recorded; expected {LEAST}")
    return Transfers(fall_ns=fall, rise_ns=rise, clk_rise_ns=log.rises("CLK"), clk_fall_ns=log.falls("CLK"), log=log)

"""Limits of the ADS1281/ADS1282's pins (sources 1.4 and 1.5): what breaks one is counted, what keeps it is not."""

from __future__ import annotations

from pathlib import Path

import pytest
from chip_bench import Ads1282


def strobe(s: Ads1282, *widths_ns: int) -> None:
    """SCLK high, low, high, low ... for these times."""
    for n, width_ns in enumerate(widths_ns):
        s.pin("SCLK", 1 - n % 2)
        s.wait_ns(width_ns)


LIMITS = [  # counter, SCLK high and low in turn, breaches; tCLK is 244.14 ns
    ("limit_sclk_period", (250, 239) * 8, 0),  # 2 tCLK are 488.3 ns
    ("limit_sclk_period", (247, 240) * 8, 7),
    ("limit_sclk_period", (1950, 1950) * 8, 0),  # 16 tCLK are 3906 ns
    ("limit_sclk_period", (1960, 1960) * 8, 7),
    ("limit_sclk_width", (196, 300) * 8, 0),  # 0.8 tCLK are 195.3 ns
    ("limit_sclk_width", (194, 300) * 8, 8),
    ("limit_sclk_width", (300, 194) * 8, 7),
    ("limit_sclk_width", (2441, 300) * 8, 0),  # 10 tCLK are 2441.4 ns
    ("limit_sclk_width", (2443, 300) * 8, 8),
]


@pytest.mark.parametrize(("counter", "widths_ns", "breaches"), LIMITS)
def test_limits_of_sclk_are_counted(counter: str, widths_ns: tuple[int, ...], breaches: int, tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.wait_ns(300_000)
        before = s.adc.counters[counter]
        strobe(s, *widths_ns)
        assert s.adc.counters[counter] - before == breaches


@pytest.mark.parametrize(
    ("setup_ns", "hold_ns", "counter"), [(50, 50, ""), (49, 50, "din_setup"), (50, 49, "din_hold")]
)
def test_set_up_and_hold_of_din_are_counted(setup_ns: int, hold_ns: int, counter: str, tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.wait_ns(300_000)
        before = s.adc.counters
        s.pin("DIN", 1)
        s.wait_ns(setup_ns)
        s.pin("SCLK", 1)
        s.wait_ns(hold_ns)
        s.pin("DIN", 0)
        after = s.adc.counters
    found = {name for name in ("din_setup", "din_hold") if after[f"limit_{name}"] > before[f"limit_{name}"]}
    assert found == ({counter} if counter else set())


@pytest.mark.parametrize(
    ("pin", "width_ns", "counter"),
    [
        ("SYNC", 489, ""),
        ("SYNC", 487, "sync_width"),
        ("RESET", 489, ""),
        ("RESET", 487, "reset_width"),
    ],
)
def test_pulses_below_2_clocks_are_counted(pin: str, width_ns: int, counter: str, tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.bench.run_until_ns(100_000_100)  # 41 ns before an edge of CLK and more behind one
        s.pulse(pin, 1 if pin == "SYNC" else 0, width_ns)
        after = s.adc.counters
    found = {name for name in ("sync_width", "reset_width") if after[f"limit_{name}"]}
    assert found == ({counter} if counter else set())


@pytest.mark.parametrize(("away_ns", "counted"), [(31, 0), (29, 1)])
@pytest.mark.parametrize("sign", [-1, 1])
def test_sync_within_30_ns_of_a_clock_edge_is_counted(away_ns: int, counted: int, sign: int, tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.bench.run_until_ns(100_000_000 + sign * away_ns)  # 409600 clocks
        s.pin("SYNC", 1)
        assert s.adc.counters["limit_sync_keepout"] == counted


def test_a_read_in_the_last_4_clocks_is_late_and_tears(tmp_path: Path) -> None:
    """24 bits before, 8 behind the fall of DRDY: the upper bits are the old word's, the lower ones the new word's."""
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.adc.set_volts(0, 1.0)
        s.words(70)
        s.adc.set_volts(0, -1.0)
        old = s.words(1)[0]
        s.fall()
        plain = s.now_ns
        s.bench.run_until_ns(plain + 1_000_000 - 24_500)
        s.adc.spi_clock(1_000_000)
        before = s.adc.counters["torn_reads"]
        torn = s.word()
        assert s.adc.counters["torn_reads"] == before + 1
        assert s.adc.counters["late_reads"] >= 1
        s.adc.spi_clock(1_000_000, 6e-6)
        s.words(1)
        r = s.recording()
    begin_ns = r.nth_ns("SCLK", 1, plain)
    fall_ns = r.nth_ns("DRDY", 0, begin_ns)
    bits_before = len([t for t in r.edges_ns("SCLK", 1) if begin_ns <= t <= fall_ns])
    assert 23 <= bits_before <= 25
    assert old != torn

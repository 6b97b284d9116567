"""Every timing figure of the ADS1255/ADS1256 (sources 2.2 to 2.7), measured in recordings of its pins.

The figures are typed here from the sources; tau is a period of CLKIN. Compared to the nanosecond where the source gives
clock periods, and within the last printed digit where it gives a rounded time.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import pytest
from chip_bench import Ads1256, Clock, Recording, no_complaints

HZ = 7_680_000
CLK = Clock(HZ)

# DRATE: Navg, t18 in ms as printed; 2.2-drate-codes, 2.2-t18
RATES = {
    0xF0: (1, "0.21"),
    0xE0: (2, "0.25"),
    0xD0: (4, "0.31"),
    0xC0: (8, "0.44"),
    0xB0: (15, "0.68"),
    0xA1: (30, "1.18"),
    0x92: (60, "2.18"),
    0x82: (300, "10.18"),
    0x72: (500, "16.84"),
    0x63: (600, "20.18"),
    0x53: (1000, "33.51"),
    0x43: (1200, "40.18"),
    0x33: (2000, "66.84"),
    0x23: (3000, "100.18"),
    0x13: (6000, "200.18"),
    0x03: (12000, "400.18"),
}
SETTLE_TAU = 1382  # t18 = (1382 + 256 Navg) tau
DRDY_PULSE_TAU = 16  # t17
START_TAU = 8192  # of a clock, after power-up
CRYSTAL_NS = 30_000_000

# DRATE: SELFOCAL and SYSOCAL; SYSGCAL; SELFGCAL and SELFCAL for gains 1, 2, 4, 8, 16..64. us below 1 ms; 2.7-t-*
US = {
    0xF0: ("387", "417", "417 417 451 517 651", "596 596 692 696 892"),
    0xE0: ("453", "484", "484 484 484 551 617", "696 696 696 762 896"),
    0xD0: ("587", "617", "617 617 617 617 751", "896 896 896 896 1029"),
    0xC0: ("853", "884", "884 884 884 884 884", "1300 1300 1300 1300 1300"),
}
MS = {
    0xB0: ("1.3", "1.4", "1.4", "2.0"),
    0xA1: ("2.3", "2.4", "2.4", "3.6"),
    0x92: ("4.3", "4.5", "4.5", "6.6"),
    0x82: ("20.3", "21.0", "21.0", "31.2"),
    0x72: ("33.7", "34.1", "34.1", "50.9"),
    0x63: ("40.3", "41.7", "41.7", "61.8"),
    0x53: ("67.0", "67.8", "67.8", "101.3"),
    0x43: ("80.3", "83.0", "83.0", "123.2"),
    0x33: ("133.7", "135.3", "135.3", "202.1"),
    0x23: ("200.3", "207.0", "207.0", "307.2"),
    0x13: ("400.3", "413.7", "413.7", "613.8"),
    0x03: ("800.3", "827.0", "827.0", "1227.2"),
}
WAKEUP, RDATA, RDATAC, SDATAC, SELFCAL, SELFOCAL, SELFGCAL, SYSOCAL, SYSGCAL = (
    0,
    1,
    3,
    0xF,
    0xF0,
    0xF1,
    0xF2,
    0xF3,
    0xF4,
)
SYNC, STANDBY, RESET = 0xFC, 0xFD, 0xFE
MUX, ADCON, DRATE = 1, 2, 3


def ready(path: Path, **options: float) -> Ads1256:
    """A part that has calibrated itself after power-up, without noise."""
    s = Ads1256(path, "ads1256", seed=1, noise_scale=0, **options)
    s.adc.run_until_level("DRDY", 0)
    return s


def period_tau(drate: int) -> int:
    return 256 * RATES[drate][0]


def t18_tau(drate: int) -> int:
    return SETTLE_TAU + period_tau(drate)


def ns(text: str, unit_ns: int) -> tuple[Fraction, Fraction]:
    """A printed time in ns, and half of its last digit."""
    value = Fraction(text) * unit_ns
    digits = len(text.partition(".")[2])
    return value, Fraction(unit_ns, 2 * 10**digits)


def last_fall(r: Recording, begin_ns: int, byte: int = 1) -> int:
    """When the last bit of a byte was taken, of those sent from begin_ns on."""
    return r.nth_ns("SCLK", 0, begin_ns, 8 * byte)


def restart_by_pin(s: Ads1256) -> int:
    """When the SYNC pin rose."""
    return s.pulse("SYNC", 0, 1_000)


def restart_by_command(s: Ads1256) -> int:
    """When the first SCLK of WAKEUP rose: half a period of SCLK after its byte began."""
    s.send(SYNC)
    return s.send(WAKEUP) + 10**9 // s.SCLK_HZ // 2


@pytest.mark.parametrize("drate", RATES, ids=lambda d: f"{d:02X}h")
def test_first_word_comes_t18_after_a_synchronisation_and_then_every_period(drate: int, tmp_path: Path) -> None:
    complaints = []
    printed_ns, half_digit_ns = ns(RATES[drate][1], 10**6)
    for cause in (restart_by_pin, restart_by_command):
        with ready(tmp_path / "a.vcd", cells_max=1) as s:
            s.write(DRATE, drate)
            start_ns = cause(s)
            for _ in range(3):
                s.fall()
            r = s.recording()
        if cause is restart_by_command:
            assert start_ns in r.edges_ns("SCLK", 1)
        heard_ns = start_ns if cause is restart_by_pin else last_fall(r, start_ns)  # a command is one with its last bit
        falls = [t for t in r.edges_ns("DRDY", 0) if t > heard_ns]
        rises = [t for t in r.edges_ns("DRDY", 1) if t > heard_ns]
        what = f"{drate:02X}h, {cause.__name__}"
        complaints += [
            CLK.complaint(f"{what}: t18", start_ns, falls[0], t18_tau(drate)),
            CLK.complaint(f"{what}: period", falls[0], falls[1], period_tau(drate)),
            CLK.complaint(f"{what}: period", falls[1], falls[2], period_tau(drate)),
            CLK.complaint(f"{what}: t17", rises[-1], falls[2], DRDY_PULSE_TAU),
            "" if r.level("DRDY", heard_ns) else f"{what}: DRDY low after the restart",
        ]
        # The printed column is rounded in some rows, cut off in others.
        if not -2 * half_digit_ns < falls[0] - start_ns - printed_ns < 2 * half_digit_ns + CLK.edge_ns(1):
            complaints.append(f"{what}: t18 {falls[0] - start_ns} ns, printed {RATES[drate][1]} ms")
    no_complaints(complaints)


@pytest.mark.parametrize("hz", [100_000, 4_096_000, 10_000_000])
def test_times_scale_with_the_clock(hz: int, tmp_path: Path) -> None:
    clk = Clock(hz)
    with Ads1256(tmp_path / "a.vcd", noise_scale=0, clkin_hz=hz) as s:
        s.adc.spi_clock(hz // 8)
        s.adc.run_until_level("DRDY", 0)
        s.wait_ns(int(clk.edge_ns(50)))
        s.write(DRATE, 0x82)
        start_ns = s.pulse("SYNC", 0, int(clk.edge_ns(8)))
        s.fall()
        s.fall()
        r = s.recording()
    falls = [t for t in r.edges_ns("DRDY", 0) if t > start_ns]
    no_complaints(
        [
            clk.complaint(f"{hz} Hz: t18", start_ns, falls[0], t18_tau(0x82)),
            clk.complaint(f"{hz} Hz: period", falls[0], falls[1], period_tau(0x82)),
            clk.complaint(f"{hz} Hz: t17", r.nth_ns("DRDY", 1, falls[0]), falls[1], DRDY_PULSE_TAU),
        ]
    )
    words_per_s = hz / period_tau(0x82)
    assert words_per_s == pytest.approx({100_000: 1.3021, 4_096_000: 53.33, 10_000_000: 130.2}[hz], rel=1e-3)


def durations(drate: int, gain_code: int) -> dict[int, tuple[Fraction, Fraction]]:
    """Printed duration of each calibration and half of its last digit, ns, by opcode."""
    unit_ns, row = (10**3, US[drate]) if drate in US else (10**6, MS[drate])
    offset, sysgcal, selfgcal, selfcal = (row[0], row[1], row[2].split(), row[3].split())
    column = min(gain_code, 4)
    return {
        SELFOCAL: ns(offset, unit_ns),
        SYSOCAL: ns(offset, unit_ns),
        SYSGCAL: ns(sysgcal, unit_ns),
        SELFGCAL: ns(selfgcal[min(column, len(selfgcal) - 1)], unit_ns),
        SELFCAL: ns(selfcal[min(column, len(selfcal) - 1)], unit_ns),
    }


@pytest.mark.parametrize("drate", RATES, ids=lambda d: f"{d:02X}h")
def test_calibrations_last_as_printed(drate: int, tmp_path: Path) -> None:
    """From the last bit of the command to DRDY's fall: the printed time, to its last digit and one tau."""
    complaints = []
    gains = range(7) if drate in US else (0, 6)
    for gain_code in gains:
        with ready(tmp_path / "a.vcd", cells_max=1) as s:
            s.write(ADCON, 0x20 | gain_code)
            s.write(DRATE, drate)
            begun = {}
            for opcode in durations(drate, gain_code):
                volts = 2.4 / 2**gain_code if opcode == SYSGCAL else 0.0
                s.adc.set_volts(0, 2.5 + volts)
                s.adc.set_volts(1, 2.5)
                begun[opcode] = s.send(opcode)
                s.fall(20)
            r = s.recording()
        for opcode, (printed_ns, half_digit_ns) in durations(drate, gain_code).items():
            start_ns = last_fall(r, begun[opcode])
            end_ns = r.nth_ns("DRDY", 0, start_ns)
            what = f"{opcode:02X}h at {drate:02X}h, gain code {gain_code}"
            if not r.level("DRDY", start_ns):
                complaints.append(f"{what}: DRDY stays low")
            if abs(end_ns - start_ns - printed_ns) > half_digit_ns + CLK.edge_ns(1):
                complaints.append(f"{what}: {end_ns - start_ns} ns, printed {float(printed_ns)}")
            if opcode in (SELFOCAL, SYSOCAL):  # 0.32 ms + 512 Navg tau, 0.32 ms being 2458 tau
                complaints.append(CLK.complaint(what, start_ns, end_ns, 2458 + 512 * RATES[drate][0]))
    no_complaints(complaints)


@pytest.mark.parametrize(
    ("start", "wait_ns"),
    [("clock", CLK.edge_ns(START_TAU)), ("crystal", Fraction(CRYSTAL_NS))],
    ids=["clock", "crystal"],
)
def test_power_up_waits_then_calibrates(start: str, wait_ns: Fraction, tmp_path: Path) -> None:
    with Ads1256(tmp_path / "a.vcd", noise_scale=0, start=start) as s:
        s.adc.run_until_level("DRDY", 0)
        begin_ns = s.send(SELFCAL)  # takes as long again, without the wait
        s.fall()
        r = s.recording()
    first_ns, again_ns = r.edges_ns("DRDY", 0)[0], r.nth_ns("DRDY", 0, last_fall(r, begin_ns))
    cal_tau = CLK.clocks(last_fall(r, begin_ns), again_ns)
    printed_ns, half_digit_ns = durations(0xF0, 0)[SELFCAL]
    assert abs(first_ns - wait_ns - printed_ns) <= half_digit_ns + CLK.edge_ns(1)
    no_complaints([CLK.complaint("power-up", int(wait_ns), first_ns, round(cal_tau))])


def reset_by_pin(s: Ads1256) -> int:
    return s.pulse("RESET", 0, 1_000)


def reset_by_command(s: Ads1256) -> int:
    s.send(RESET)
    return s.now_ns


def reset_by_pattern(s: Ads1256) -> int:
    """t12..t15: SCLK high 307, 550, 1050 tau with 5 tau of low between."""
    s.wait_ns(50_000)
    for high_tau in (307, 550, 1050):
        s.pin("SCLK", 1)
        s.wait_ns(round(CLK.edge_ns(high_tau)))
        end_ns = s.pin("SCLK", 0)
        s.wait_ns(round(CLK.edge_ns(5)) + 1)
    return end_ns


@pytest.mark.parametrize("cause", [reset_by_pin, reset_by_command, reset_by_pattern])
def test_a_reset_ends_with_a_self_calibration_at_the_default_rate(cause: object, tmp_path: Path) -> None:
    assert callable(cause)
    with ready(tmp_path / "a.vcd") as s:
        s.write(DRATE, 0x92)
        s.fall()
        start_ns = cause(s)
        s.fall()
        drate = s.read(DRATE)
        r = s.recording()
    printed_ns, half_digit_ns = durations(0xF0, 0)[SELFCAL]
    end_ns = r.nth_ns("DRDY", 0, start_ns)
    assert drate == b"\xf0"
    assert r.level("DRDY", start_ns) == 1
    assert abs(end_ns - start_ns - printed_ns) <= half_digit_ns + 2 * CLK.edge_ns(1)


@pytest.mark.parametrize(
    ("highs", "resets"),
    [((290, 550, 1050), False), ((307, 500, 1050), False), ((307, 550, 1300), False), ((499, 749, 1249), True)],
)
def test_the_pattern_resets_only_within_its_limits(highs: tuple[int, ...], resets: bool, tmp_path: Path) -> None:
    with ready(tmp_path / "a.vcd") as s:
        s.write(DRATE, 0x92)
        s.fall()
        s.wait_ns(50_000)
        for high_tau in highs:
            s.pin("SCLK", 1)
            s.wait_ns(round(CLK.edge_ns(high_tau)))
            s.pin("SCLK", 0)
            s.wait_ns(round(CLK.edge_ns(6)))
        s.wait_ns(5_000_000)
        r = s.recording()
    falls = r.edges_ns("DRDY", 0)
    assert bool(CLK.clocks(falls[-2], falls[-1]) == pytest.approx(256, abs=1)) == resets
    assert s.path


def test_standby_sleeps_after_the_present_word_and_wakeup_takes_t18_and_a_little(tmp_path: Path) -> None:
    with ready(tmp_path / "a.vcd") as s:
        s.write(DRATE, 0xA1)
        s.fall()
        s.fall()
        begin_ns = s.send(STANDBY)
        s.wait_ns(20_000_000)
        wake_ns = s.send(WAKEUP)
        s.fall()
        r = s.recording()
    asleep = r.between_ns("DRDY", 0, begin_ns, wake_ns)
    assert len(asleep) <= 1
    up_ns = r.nth_ns("DRDY", 0, wake_ns)
    assert t18_tau(0xA1) <= CLK.clocks(wake_ns, up_ns) <= Fraction(11, 10) * t18_tau(0xA1)


@pytest.mark.parametrize(("low_tau", "down"), [(20 * 256 * 30 - 8, False), (20 * 256 * 30 + 8, True)])
def test_sync_low_for_20_periods_powers_down(low_tau: int, down: bool, tmp_path: Path) -> None:
    """Out of it as after power-up, which takes 8192 tau; before that as after a synchronisation."""
    with ready(tmp_path / "a.vcd") as s:
        s.write(DRATE, 0xA1)
        s.fall()
        start_ns = s.pulse("SYNC", 0, round(CLK.edge_ns(low_tau)))
        s.adc.run_until_level("DRDY", 0)
        r = s.recording()
    end_ns = r.nth_ns("DRDY", 0, start_ns)
    waits = START_TAU if down else 0
    no_complaints([CLK.complaint("to the first word", start_ns, end_ns, waits + t18_tau(0xA1), within=int(down))])


def test_drdy_rises_with_the_24th_bit_and_stays_low_after_fewer(tmp_path: Path) -> None:
    with ready(tmp_path / "a.vcd") as s:
        s.write(DRATE, 0x92)
        s.send(RDATAC)
        reads = []
        for count in (3, 2, 3):
            s.fall()
            reads.append((s.now_ns, count))
            s.wait_ns(10_000)
            s.adc.spi(bytes(count))
            s.wait_ns(10_000)
        s.fall()
        r = s.recording()
    period_ns = CLK.edge_ns(period_tau(0x92))
    for begin_ns, count in reads:
        up_ns = r.nth_ns("DRDY", 1, begin_ns)
        if count == 3:
            assert r.nth_ns("SCLK", 1, begin_ns, 24) <= up_ns <= r.nth_ns("SCLK", 0, begin_ns, 24)
        else:
            no_complaints([CLK.complaint("t17", up_ns, r.nth_ns("DRDY", 0, up_ns), DRDY_PULSE_TAU)])
            assert up_ns - begin_ns > period_ns - CLK.edge_ns(DRDY_PULSE_TAU + 2)


def test_dout_changes_at_rising_edges_of_sclk(tmp_path: Path) -> None:
    with ready(tmp_path / "a.vcd") as s:
        s.adc.set_volts(0, 2.5123)
        s.adc.set_volts(1, 2.5)
        s.codes(20)
        s.read(0, 11)
        r = s.recording()
    rises = {*r.edges_ns("SCLK", 1)}
    changes = [*r.edges_ns("DOUT", 0), *r.edges_ns("DOUT", 1)]
    assert len(changes) > 40
    assert [t for t in changes if t not in rises and r.level("CS", t) == 0] == []


@pytest.mark.parametrize(("gap_tau", "whole"), [(51, True), (46, False)])
def test_data_sooner_than_t6_are_garbled_when_strict(gap_tau: int, whole: bool, tmp_path: Path) -> None:
    """From the last falling edge of RDATA to the first rising edge of the data."""
    with ready(tmp_path / "a.vcd", strict_timing=True) as s:
        s.adc.set_volts(0, 2.6)
        s.adc.set_volts(1, 2.5)
        s.fall()
        s.fall()
        begin_ns = s.send(RDATA)
        s.wait_ns(round(CLK.edge_ns(gap_tau)) - 500)
        word = s.adc.spi(bytes(3))
        r = s.recording()
    gap = CLK.clocks(0, r.nth_ns("SCLK", 1, begin_ns, 9)) - CLK.clocks(0, last_fall(r, begin_ns))
    assert (gap >= 50) == whole
    assert (word != b"\xff\xff\xff") == whole


def strobe(s: Ads1256, *half_ns: int) -> None:
    """SCLK high, low, high, low ... for these times; DIN stays."""
    for n, width_ns in enumerate(half_ns):
        s.pin("SCLK", 1 - n % 2)
        s.wait_ns(width_ns)


@pytest.mark.parametrize(
    ("halves_ns", "counted"),
    [
        ((261, 261) * 8, 0),  # t1 4 tau are 520.8 ns
        ((257, 257) * 8, 7),
        ((201, 325) * 8, 0),  # t2, 200 ns
        ((195, 330) * 8, 8),
        ((330, 195) * 8, 7),
    ],
)
def test_t1_and_t2_are_counted_below_their_figures(halves_ns: tuple[int, ...], counted: int, tmp_path: Path) -> None:
    with ready(tmp_path / "a.vcd") as s:
        s.wait_ns(100_000)
        before = s.adc.counters["sclk_violations"]
        strobe(s, *halves_ns)
        assert s.adc.counters["sclk_violations"] - before == counted


@pytest.mark.parametrize(("setup_ns", "hold_ns", "counted"), [(50, 50, 0), (49, 50, 1), (50, 49, 1)])
def test_t4_and_t5_are_counted_below_their_figures(setup_ns: int, hold_ns: int, counted: int, tmp_path: Path) -> None:
    """DIN changes setup_ns before the falling edge of SCLK and again hold_ns after it."""
    with ready(tmp_path / "a.vcd") as s:
        s.wait_ns(100_000)
        before = s.adc.counters["din_violations"]
        s.pin("SCLK", 1)
        s.wait_ns(400 - setup_ns)
        s.pin("DIN", 1)
        s.wait_ns(setup_ns)
        s.pin("SCLK", 0)
        s.wait_ns(hold_ns)
        s.pin("DIN", 0)
        assert s.adc.counters["din_violations"] - before == counted


def test_dout_is_released_6_to_10_tau_after_the_last_bit(tmp_path: Path) -> None:
    """t9, seen where the last bit is 1: the bus pulls the released line low."""
    with ready(tmp_path / "a.vcd") as s:
        assert s.read(MUX)[-1] & 1
        last_ns = s.now_ns
        s.wait_ns(5_000)
        r = s.recording()
    assert r.level("DOUT", last_ns) == 1
    assert 6 <= (r.nth_ns("DOUT", 0, last_ns) - last_ns) * HZ / 1e9 <= 10


@pytest.mark.parametrize(("gap_tau", "counted"), [(8, 0), (7, 1)])
def test_t10_is_counted_below_its_figure(gap_tau: int, counted: int, tmp_path: Path) -> None:
    with ready(tmp_path / "a.vcd") as s:
        s.write(MUX, 0x23)
        before = s.adc.counters["gap_violations"]
        s.wait_ns(round(CLK.edge_ns(gap_tau)) + 1)
        s.pin("CS", 1)
        assert s.adc.counters["gap_violations"] - before == counted


@pytest.mark.parametrize("pin", ["RESET", "SYNC"])
def test_t16_is_counted_below_its_figure(pin: str, tmp_path: Path) -> None:
    for tau, counted in ((4, 0), (3, 1)):
        with ready(tmp_path / "a.vcd") as s:
            before = s.adc.counters["gap_violations"]
            s.pulse(pin, 0, round(CLK.edge_ns(tau)) + 1)
            assert s.adc.counters["gap_violations"] - before == counted


@pytest.mark.parametrize(("command", "tau"), [((0x50, 0, 0), 4), ((SYNC,), 24)], ids=["WREG", "SYNC"])
def test_t11_is_counted_below_its_figure(command: tuple[int, ...], tau: int, tmp_path: Path) -> None:
    for gap_tau, counted in ((tau + 1, 0), (tau - 1, 1)):
        with ready(tmp_path / "a.vcd") as s:
            s.adc.spi_clock(1_900_000)
            s.fall()
            s.wait_ns(20_000)
            before = s.adc.counters["gap_violations"]
            begin_ns = s.send(*command)
            half_ns = round(1e9 / 1_900_000 / 2)
            s.wait_ns(round(CLK.edge_ns(gap_tau)) - half_ns)
            s.adc.spi(b"\x00")
            after = s.adc.counters["gap_violations"]
            r = s.recording()
        edges = r.nth_ns("SCLK", 1, begin_ns, 8 * len(command) + 1), last_fall(r, begin_ns, len(command))
        gap = (edges[0] - edges[1]) * HZ / 1e9
        assert (gap < tau) == bool(counted)
        assert after - before == counted, f"{command}: a gap of {gap:.2f} tau"


def test_drdy_rises_at_the_start_of_calibration_synchronisation_and_reset(tmp_path: Path) -> None:
    with ready(tmp_path / "a.vcd", sync_halts=1) as s:
        s.write(DRATE, 0x92)
        starts = []
        for opcode in (SELFCAL, SYNC, RESET):
            s.fall()
            s.wait_ns(100_000)
            starts.append((opcode, s.send(opcode)))
            if opcode == SYNC:
                s.wait_ns(5_000)
                s.send(WAKEUP)
        s.fall()
        r = s.recording()
    no_complaints(
        "" if 0 <= r.nth_ns("DRDY", 1, t) - last_fall(r, t) <= CLK.edge_ns(1) else f"{opcode:02X}h"
        for opcode, t in starts
    )


def test_falls_of_drdy_are_a_period_apart_whatever_is_read(tmp_path: Path) -> None:
    with ready(tmp_path / "a.vcd") as s:
        s.write(DRATE, 0xA1)
        s.fall()
        begin_ns = s.now_ns
        for n in range(20):
            s.fall()
            if n % 3:
                s.wait_ns(37_000 * n)
                s.rdata()
        r = s.recording()
    falls = [t for t in r.edges_ns("DRDY", 0) if t > begin_ns]
    assert len(falls) == 20
    no_complaints(CLK.complaint("period", a, b, period_tau(0xA1)) for a, b in pairwise(falls))

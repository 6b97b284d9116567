"""Every timing figure of the ADS1281/ADS1282 (sources 1.3 to 1.6), measured in recordings of its pins.

The figures are typed here from the sources, in clock periods, and compared to the nanosecond.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from chip_bench import Ads1282, Clock, Recording, no_complaints

HZ = 4_096_000
CLK = Clock(HZ)
PULSE_NS = 1_000  # SYNC and RESET want 2 tCLK, 488 ns

T_DR = {0: 1_032_340, 1: 516_404, 2: 258_436, 3: 129_452, 4: 64_960}  # tCLK by DR; 1.6-tdr
T_DR_SINC = {4: 440, 3: 616, 2: 968, 1: 1672, 0: 2824}  # 1.6-tdr-sinc
PERIOD = {dr: 4 * 32 * ratio for dr, ratio in enumerate((128, 64, 32, 16, 8))}  # 1.8-rates
SINC_PERIOD = {dr: p // 32 for dr, p in PERIOD.items()}
POWER_UP = 2**16  # 1.6-power-up
DRDY_PULSE = 4  # 1.5-drdy-pulse
GAP = 24  # 1.4-gap
TIMEOUT_PERIODS = 64  # 1.4-timeout
CAL_PERIODS = 16  # 1.7-cal-length

WAKEUP, STANDBY, SYNC, RESET, RDATAC, SDATAC, RDATA, OFSCAL, GANCAL = 0, 2, 4, 6, 0x10, 0x11, 0x12, 0x60, 0x61
FIR, SINC_ONLY = 2, 1


def config0(dr: int, phase: int = 0, filtr: int = FIR, continuous: int = 0) -> int:
    return continuous << 7 | 0x40 | dr << 3 | phase << 2 | filtr


def eighth_rise(r: Recording, begin_ns: int, byte: int = 1) -> int:
    """When the last bit of a byte was taken, of those sent from begin_ns on."""
    return r.nth_ns("SCLK", 1, begin_ns, 8 * byte)


def restart_by_pin(s: Ads1282) -> tuple[int, int]:
    return s.pulse("SYNC", 1, PULSE_NS) - PULSE_NS, 0


def restart_by_opcode(s: Ads1282) -> tuple[int, int]:
    return s.send(SYNC)[0], 1


RESTARTS: list[Callable[[Ads1282], tuple[int, int]]] = [restart_by_pin, restart_by_opcode]


@pytest.mark.parametrize("dr", T_DR)
def test_first_word_comes_t_dr_after_a_synchronisation_and_then_every_period(dr: int, tmp_path: Path) -> None:
    complaints = []
    for phase in (0, 1):
        for cause in RESTARTS:
            with Ads1282.ready(tmp_path / "a.vcd") as s:
                s.write(1, config0(dr, phase))
                s.wait_ns(3_333_333)
                begin_ns, byte = cause(s)
                s.fall()
                s.fall()
                end_ns = s.fall()
                r = s.recording()
            start_ns = eighth_rise(r, begin_ns, byte) if byte else begin_ns
            falls = [t for t in r.edges_ns("DRDY", 0) if start_ns < t <= end_ns]
            what = f"DR {dr}, phase {phase}, {cause.__name__}"
            complaints += [
                CLK.complaint(f"{what}: t_DR", start_ns, falls[0], T_DR[dr]),
                CLK.complaint(f"{what}: period", falls[0], falls[1], PERIOD[dr]),
                CLK.complaint(f"{what}: period", falls[1], falls[2], PERIOD[dr]),
                "" if len(falls) == 3 else f"{what}: {len(falls)} falls of DRDY, 3 wanted",
                "" if r.level("DRDY", start_ns) else f"{what}: DRDY low after the restart",
            ]
    no_complaints(complaints)


@pytest.mark.parametrize("offset_ns", range(0, 245, 49))
def test_a_synchronisation_acts_at_the_next_clock_edge(offset_ns: int, tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.bench.run_until_ns(400_000_000 + offset_ns)
        start_ns = s.pin("SYNC", 1)
        s.fall()
        r = s.recording()
    no_complaints([CLK.complaint("t_DR", start_ns, r.nth_ns("DRDY", 0, start_ns), T_DR[2])])


@pytest.mark.parametrize("dr", T_DR)
def test_a_new_rate_restarts_at_the_last_bit_of_its_write(dr: int, tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        begin_ns = s.write(1, config0(dr, phase=1))
        s.adc.run_until_level("DRDY", 0)
        r = s.recording()
    start_ns = eighth_rise(r, begin_ns, 3)
    no_complaints([CLK.complaint("t_DR", start_ns, r.nth_ns("DRDY", 0, start_ns), T_DR[dr])])


@pytest.mark.parametrize("dr", T_DR_SINC)
def test_sinc_only_settles_and_repeats_as_printed(dr: int, tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.write(1, config0(dr, filtr=SINC_ONLY))
        s.wait_ns(5_000_000)
        start_ns = s.pulse("SYNC", 1, PULSE_NS) - PULSE_NS
        s.wait_ns(2_000_000)
        r = s.recording()
    falls = [t for t in r.edges_ns("DRDY", 0) if t > start_ns]
    no_complaints(
        [CLK.complaint(f"DR {dr}: t_DR", start_ns, falls[0], T_DR_SINC[dr])]
        + [CLK.complaint(f"DR {dr}: period", a, b, SINC_PERIOD[dr]) for a, b in pairwise(falls)]
    )


def test_reset_by_pin_and_opcode_settle_at_the_default_rate(tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.write(1, config0(4))
        s.wait_ns(20_000_000)
        pin_ns = s.pulse("RESET", 0, PULSE_NS)
        s.fall()
        s.write(1, config0(4))
        s.wait_ns(20_000_000)
        begin_ns, _ = s.send(RESET)
        s.fall()
        r = s.recording()
    opcode_ns = eighth_rise(r, begin_ns)
    no_complaints(
        CLK.complaint(what, t, r.nth_ns("DRDY", 0, t), T_DR[2]) for what, t in (("pin", pin_ns), ("opcode", opcode_ns))
    )


def test_power_up_and_release_of_pwdn_take_an_internal_reset_more(tmp_path: Path) -> None:
    with Ads1282(tmp_path / "a.vcd") as s:
        s.adc.run_until_level("DRDY", 0)
        s.wait_ns(12_345_678)
        s.pin("PWDN", 0)
        s.wait_ns(10_000_000)
        pwdn_ns = s.pin("PWDN", 1)
        s.adc.run_until_level("DRDY", 0)
        r = s.recording()
    falls = r.edges_ns("DRDY", 0)
    no_complaints(
        [
            CLK.complaint("power-up", 0, falls[0], POWER_UP + T_DR[2]),
            CLK.complaint("PWDN", pwdn_ns, r.nth_ns("DRDY", 0, pwdn_ns), POWER_UP + T_DR[2]),
        ]
    )


def test_wakeup_restarts_after_standby(tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.send(STANDBY)
        standby_ns = s.now_ns
        s.wait_ns(200_000_000)
        begin_ns, _ = s.send(WAKEUP)
        s.adc.run_until_level("DRDY", 0)
        r = s.recording()
    start_ns = eighth_rise(r, begin_ns)
    assert r.between_ns("DRDY", 0, standby_ns, start_ns) == []
    no_complaints([CLK.complaint("t_DR", start_ns, r.nth_ns("DRDY", 0, start_ns), T_DR[2])])


def test_drdy_not_read_is_high_for_4_clocks_before_it_falls(tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.wait_ns(10_000_000)
        r = s.recording()
    rises, falls = r.edges_ns("DRDY", 1), r.edges_ns("DRDY", 0)
    assert len(falls) == 11
    no_complaints(
        CLK.complaint("pulse", up, down, DRDY_PULSE) for up, down in zip(rises[-10:], falls[-10:], strict=True)
    )


def test_drdy_rises_at_the_first_falling_edge_of_a_read_and_dout_at_falling_edges(tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.adc.set_volts(0, -0.123)
        for _ in range(70):
            s.fall()
            s.wait_ns(1_234)
            s.adc.spi(bytes(4))
        r = s.recording()
    sclk_falls, drdy_falls = r.edges_ns("SCLK", 0), r.edges_ns("DRDY", 0)
    complaints = [
        "" if up == r.nth_ns("SCLK", 0, down) else f"DRDY rises at {up} ns"
        for down, up in ((t, r.nth_ns("DRDY", 1, t)) for t in drdy_falls[1:-1])
    ]
    allowed = {*sclk_falls, *drdy_falls}
    complaints += [
        f"DOUT changes at {t} ns" for t in (*r.edges_ns("DOUT", 0), *r.edges_ns("DOUT", 1)) if t not in allowed
    ]
    no_complaints(complaints)
    assert len(r.edges_ns("DOUT", 1)) > 70


def test_bit_31_is_on_dout_at_the_fall_of_drdy(tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.adc.set_volts(0, -1.0)
        words = s.words(70)
        r = s.recording()
    falls = r.edges_ns("DRDY", 0)[1:]
    assert [r.level("DOUT", t) for t in falls] == [int(w < 0) for w in words]
    assert words[-1] < 0


def test_rdata_waits_for_the_next_word_at_most_a_period(tmp_path: Path) -> None:
    complaints = []
    for wait_ns in (0, 250_000, 500_000, 999_000):
        with Ads1282.ready(tmp_path / "a.vcd") as s:
            s.send(SDATAC)
            s.fall()
            s.wait_ns(wait_ns)
            begin_ns, _ = s.send(RDATA)
            s.adc.run_until_level("DRDY", 0)
            s.word()
            s.wait_ns(2_000_000)
            r = s.recording()
        asked_ns = eighth_rise(r, begin_ns)
        answer_ns = r.nth_ns("DRDY", 0, asked_ns)
        complaints.append("" if r.level("DRDY", asked_ns) else f"DRDY low at the eighth bit of RDATA, {asked_ns} ns")
        complaints.append("" if CLK.clocks(asked_ns, answer_ns) <= PERIOD[2] else f"RDATA: answer after {answer_ns} ns")
        first_ns = r.edges_ns("DRDY", 0)[0]
        whole = round(CLK.clocks(first_ns, answer_ns) / PERIOD[2])
        complaints.append(CLK.complaint("on the grid", first_ns, answer_ns, whole * PERIOD[2]))
    no_complaints(complaints)


def test_a_gap_below_24_clocks_is_counted_and_24_is_not(tmp_path: Path) -> None:
    """From the last rising edge of a byte to the first of the next; the recording says what the gaps were."""
    for sclk_hz, pause_ns, counted in (
        (1_000_000, 5_000, 0),
        (1_000_000, 4_700, 1),
        (2_000_000, 5_400, 0),
        (2_000_000, 5_100, 1),
    ):
        with Ads1282.ready(tmp_path / "a.vcd") as s:
            s.send(SDATAC)
            before = s.adc.counters["gap_violations"]
            s.wait_ns(20_000)
            s.adc.spi_clock(sclk_hz, pause_ns / 1e9)
            begin_ns = s.now_ns
            s.adc.spi(b"\x21\x00")
            after = s.adc.counters["gap_violations"]
            r = s.recording()
        gap = (r.nth_ns("SCLK", 1, begin_ns, 9) - r.nth_ns("SCLK", 1, begin_ns, 8)) * HZ / 1e9
        assert (gap < GAP) == bool(counted)
        assert after - before == counted, f"a gap of {gap:.2f} tCLK"


def test_the_serial_port_realigns_after_64_periods_of_rest(tmp_path: Path) -> None:
    """Four bits, a rest, then SDATAC: obeyed (no more data on DOUT) only when the rest was long enough."""
    for periods, obeyed in ((TIMEOUT_PERIODS + 1, True), (TIMEOUT_PERIODS - 1, False)):
        with Ads1282.ready(tmp_path / "a.vcd") as s:
            s.adc.set_volts(0, -1.0)
            s.words(70)
            s.wait_ns(10_000)
            for _ in range(4):  # unaligned, SDATAC reads as WAKEUP
                s.pin("SCLK", 1)
                s.wait_ns(500)
                s.pin("SCLK", 0)
                s.wait_ns(500)
            last_ns = s.now_ns - 500
            s.wait_ns(int(CLK.edge_ns(periods * PERIOD[2])))
            s.send(SDATAC)
            s.fall()
            s.fall()
            level = s.adc.pins["DOUT"].level
            r = s.recording()
        assert r.nth_ns("SCLK", 1, last_ns + 1) - last_ns > CLK.edge_ns(periods * PERIOD[2])
        assert level == (0 if obeyed else 1), f"{periods} periods"


def test_continuous_synchronisation_keeps_a_whole_number_of_periods(tmp_path: Path) -> None:
    """SYNC at 3 data periods, to one clock: no restart. At 3.25: a restart each time, DOUT low, DRDY goes on."""
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        s.write(1, config0(2, continuous=1))
        s.adc.set_volts(0, -1.0)
        begin_ns = s.now_ns
        for n in range(40):
            s.bench.run_until_ns(begin_ns + 1_000_000 + 3_000_000 * n + (n % 2) * 200)
            s.pulse("SYNC", 1, PULSE_NS)
        settled_ns = s.now_ns
        undisturbed = s.adc.counters["restarts"]
        s.wait_ns(1_500_000)
        word_level = s.adc.pins["DOUT"].level
        for n in range(1, 9):
            s.bench.run_until_ns(settled_ns + 3_250_000 * n)
            s.pulse("SYNC", 1, PULSE_NS)
        last_sync_ns = s.now_ns - PULSE_NS
        assert s.adc.counters["restarts"] == undisturbed + 8
        s.wait_ns(100_000_000)
        r = s.recording()
    first_sync_ns = r.nth_ns("SYNC", 1, begin_ns)
    falls = [t for t in r.edges_ns("DRDY", 0) if first_sync_ns < t < settled_ns]
    complaints = [CLK.complaint("undisturbed", a, b, PERIOD[2]) for a, b in pairwise(falls)]
    after = [t for t in r.edges_ns("DRDY", 0) if t > last_sync_ns]
    lows = [t for t in after if not r.level("DOUT", t)]
    complaints.append("" if len(lows) in (62, 63) else f"a restart costs {len(lows)} words, 63 wanted")
    complaints.append(CLK.complaint("settled", last_sync_ns, after[len(lows)], T_DR[2], within=PERIOD[2]))
    no_complaints(complaints)
    assert word_level == 1


@pytest.mark.parametrize("opcode", [OFSCAL, GANCAL])
def test_a_calibration_lasts_16_periods(opcode: int, tmp_path: Path) -> None:
    """DRDY is high from the command to the end of the 16th period, on the grid of the words before."""
    for wait_ns in (0, 400_000, 960_000):
        with Ads1282.ready(tmp_path / "a.vcd") as s:
            s.adc.set_volts(0, 0.0 if opcode == OFSCAL else 2.4)
            s.words(70)
            s.send(SDATAC)
            s.fall()
            s.wait_ns(wait_ns)
            begin_ns, _ = s.send(opcode)
            s.fall()
            r = s.recording()
        start_ns = eighth_rise(r, begin_ns)
        before_ns = [t for t in r.edges_ns("DRDY", 0) if t < start_ns][-1]
        done_ns = r.nth_ns("DRDY", 0, start_ns)
        assert r.level("DRDY", start_ns) == 1
        no_complaints([CLK.complaint(f"{wait_ns} ns", before_ns, done_ns, CAL_PERIODS * PERIOD[2])])


def test_figures_scale_with_the_clock(tmp_path: Path) -> None:
    for hz in (1_000_000, 3_333_333):
        clk = Clock(hz)
        with Ads1282(tmp_path / "a.vcd", noise_scale=0, clk_hz=hz) as s:
            s.adc.run_until_level("DRDY", 0)
            start_ns = s.pulse("SYNC", 1, 4_000) - 4_000
            s.fall()
            s.fall()
            r = s.recording()
        falls = [t for t in r.edges_ns("DRDY", 0) if t > start_ns]
        no_complaints(
            [
                clk.complaint(f"{hz} Hz: t_DR", start_ns, falls[0], T_DR[2]),
                clk.complaint(f"{hz} Hz: period", falls[0], falls[1], PERIOD[2]),
                clk.complaint(f"{hz} Hz: pulse", r.nth_ns("DRDY", 1, falls[0]), falls[1], DRDY_PULSE),
            ]
        )


def test_modulator_bits_come_at_a_quarter_of_the_clock_and_decode_to_the_input(tmp_path: Path) -> None:
    """3 M0[n-2] - 6 M0[n-3] + 4 M0[n-4] + 9 (M1[n] - 2 M1[n-1] + M1[n-2]) with bits +-1; 1.7-modulator."""
    means = []
    for part in (0.0, 0.3, -0.7):
        with Ads1282.ready(tmp_path / "a.vcd") as s:
            s.write(1, config0(2, filtr=0))
            s.adc.set_volts(0, 2.5 * part)
            s.wait_ns(8_000_000)
            r = s.recording()
        rises = r.edges_ns("MCLK", 1)[-4100:-100]
        assert len(rises) == 4000
        no_complaints(CLK.complaint("MCLK", a, b, 4) for a, b in pairwise(rises))
        m0, m1 = (2 * r.vcd.wires[pin].at(np.array(rises) + 244).astype(int) - 1 for pin in ("M0", "M1"))
        y = 3 * m0[2:-2] - 6 * m0[1:-3] + 4 * m0[:-4] + 9 * (m1[4:] - 2 * m1[3:-1] + m1[2:-2])
        means.append(float(np.average(y, weights=np.hanning(len(y)) ** 2)))  # the error is shaped, a plain mean is not
    scale = means[2] / -0.7  # of the bits for full scale: not in the sources
    assert 0.5 < scale <= 1.0
    assert means[:2] == pytest.approx([0.0, 0.3 * scale], abs=1e-5)


def test_mflag_shows_an_input_at_or_beyond_full_scale(tmp_path: Path) -> None:
    with Ads1282.ready(tmp_path / "a.vcd") as s:
        for volts, flag in ((2.49, 0), (2.51, 1), (-2.49, 0), (-2.51, 1), (0.0, 0)):
            s.adc.set_volts(0, volts)
            begin_ns = s.now_ns
            s.wait_ns(1_000_000)
            assert s.adc.pins["MFLAG"].level == flag, f"{volts} V"
        r = s.recording()
    assert len(r.edges_ns("MFLAG", 1)) == 2
    assert r.level("MFLAG", begin_ns + 100_000) == 0


@pytest.mark.parametrize("code", range(4))
def test_pin_mode_takes_the_rate_from_its_pins(code: int, tmp_path: Path) -> None:
    """1.1-pinmode-rates: 00 250, 01 500, 10 1000, 11 2000 SPS; synchronised by the pin."""
    with Ads1282(tmp_path / "a.vcd", "ads1281", noise_scale=0, pin_mode=True, power_up_tclk=0) as s:
        s.pin("DR0", code & 1)
        s.pin("DR1", code >> 1)
        s.wait_ns(1_000_000)
        start_ns = s.pulse("SYNC", 1, PULSE_NS) - PULSE_NS
        s.fall()
        s.fall()
        r = s.recording()
    falls = [t for t in r.edges_ns("DRDY", 0) if t > start_ns]
    no_complaints(
        [
            CLK.complaint("t_DR", start_ns, falls[0], T_DR[code]),
            CLK.complaint("period", falls[0], falls[1], PERIOD[code]),
        ]
    )


@pytest.mark.parametrize("chain", ["modulator", "direct"])
def test_other_chains_have_the_same_times(chain: str, tmp_path: Path) -> None:
    with Ads1282(tmp_path / "a.vcd", chain=chain, power_up_tclk=0) as s:
        s.write(1, config0(3, phase=1))
        start_ns = s.pulse("SYNC", 1, PULSE_NS) - PULSE_NS
        for _ in range(3):
            s.fall()
        r = s.recording()
    falls = [t for t in r.edges_ns("DRDY", 0) if t > start_ns]
    no_complaints(
        [
            CLK.complaint("t_DR", start_ns, falls[0], T_DR[3]),
            CLK.complaint("period", falls[0], falls[1], PERIOD[3]),
            CLK.complaint("pulse", r.nth_ns("DRDY", 1, falls[1]), falls[2], DRDY_PULSE),
        ]
    )

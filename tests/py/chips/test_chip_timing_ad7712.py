"""Every timing figure of the AD7710 family (sources 3.2, 3.4), measured in recordings of its pins.

The figures are typed here from the sources; tau is a period of MCLK IN. Compared to the nanosecond where the source
gives clock periods; a limit ("at most", "at least") is held from both sides: the chip keeps its own, and counts a
driver that does not, one nanosecond beyond it.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
from chip_bench import Ad7712, Clock, Recording, no_complaints

HZ = 10_000_000
CLK = Clock(HZ)
TAU_NS = 100
MODULATOR_TAU = 512
LOAD_TAU = 4  # a written word acts so long after its last bit (E0)
PULSE_TAU = 500  # DRDY high before an unread word is replaced (sister parts)
CODES = (19, 20, 50, 326, 2000)
# MD: output periods from the reset of the filter to DRDY
PERIODS = {0: 3, 1: 9, 2: 4, 3: 4, 4: 9, 5: 6}


def control(md: int = 0, code: int = 19, gain_log2: int = 0, channel: int = 0, bits24: bool = True) -> int:
    return md << 21 | gain_log2 << 18 | channel << 17 | bits24 << 15 | code


def period_tau(code: int) -> int:
    return MODULATOR_TAU * code


def chip(path: Path, word: int = control(), **options: float | str | bool) -> Ad7712:
    """A part with a control word, its first word ready; no noise."""
    s = Ad7712(path, "ad7712", seed=1, noise_scale=0, **options)
    s.write(word)
    s.fall()
    return s


def modulator_edge(load_tau: int, origin_tau: int) -> int:
    """The first edge of the modulator's clock at or after a count; its edges are origin_tau + 512 k."""
    return origin_tau - (origin_tau - load_tau) // MODULATOR_TAU * MODULATOR_TAU


def start_after(last_fall_ns: int, origin_tau: int, clk: Clock = CLK) -> int:
    """CLKIN count at which the filter starts that a write resets."""
    return modulator_edge(clk.count_from(last_fall_ns) + LOAD_TAU, origin_tau)


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("md", PERIODS)
def test_modes_take_their_output_periods(md: int, code: int, tmp_path: Path) -> None:
    with Ad7712(tmp_path / "a.vcd", noise_scale=0, looks="1") as s:
        last_ns = s.write(control(md, code))
        s.adc.run_until_level("DRDY", 0, 10.0)
        s.fall()
        r = s.recording()
    falls = r.edges_ns("DRDY", 0)
    start_ns = int(CLK.edge_ns(start_after(last_ns, 0)))
    no_complaints(
        [
            CLK.complaint(f"MD {md}", start_ns, falls[0], PERIODS[md] * period_tau(code)),
            CLK.complaint(f"MD {md}, next", falls[0], falls[1], (6 if md == 5 else 1) * period_tau(code)),
        ]
    )


@pytest.mark.parametrize("hz", [400_000, 2_457_600, 9_830_400])
def test_times_scale_with_the_clock(hz: int, tmp_path: Path) -> None:
    clk = Clock(hz)
    with Ad7712(tmp_path / "a.vcd", noise_scale=0, clkin_hz=hz) as s:
        s.pin("SYNC", 0)
        s.wait_ns(123_457)
        start_ns = s.pin("SYNC", 1)
        s.adc.run_until_level("DRDY", 0, 10.0)
        s.fall()
        r = s.recording()
    falls = r.edges_ns("DRDY", 0)
    rises = [t for t in r.edges_ns("DRDY", 1) if t > falls[0]]
    no_complaints(
        [
            clk.complaint("first word", start_ns, falls[0], 3 * period_tau(325)),
            clk.complaint("period", start_ns, falls[1], 4 * period_tau(325)),
            clk.complaint("pulse", start_ns, rises[0], 4 * period_tau(325) - PULSE_TAU),
        ]
    )


@pytest.mark.parametrize(
    "word", [control(code=20), control(gain_log2=3), control(channel=1)], ids=["FS", "gain", "channel"]
)
def test_a_write_restarts_and_drdy_is_to_be_ignored_for_a_modulator_period(word: int, tmp_path: Path) -> None:
    """DRDY is low when the command comes, goes high within 512 tau, and low again three periods after that edge."""
    complaints = []
    for late_ns in (0, 13_000, 27_100, 44_444):
        with Ad7712(tmp_path / "a.vcd", noise_scale=0, looks="1") as s:
            first_ns = s.write(control())
            s.adc.run_until_level("DRDY", 0, 1.0)
            s.wait_ns(late_ns)
            last_ns = s.write(word)
            s.fall()
            r = s.recording()
        start_tau = start_after(last_ns, start_after(first_ns, 0))
        rise_ns = r.nth_ns("DRDY", 1, last_ns)
        period = period_tau(word & 0xFFF)
        start_ns = int(CLK.edge_ns(start_tau))
        complaints += [
            "" if rise_ns == start_ns else f"rise at {rise_ns}, not {start_ns}",
            "" if rise_ns - last_ns < (MODULATOR_TAU + LOAD_TAU) * TAU_NS else "later than 512 tau",
            CLK.complaint("restart", start_ns, r.nth_ns("DRDY", 0, rise_ns), 3 * period),
        ]
    no_complaints(complaints)


def test_sync_and_standby_take_three_periods(tmp_path: Path) -> None:
    complaints = []
    for name in ("SYNC", "STANDBY"):
        with chip(tmp_path / "a.vcd") as s:
            s.wait_ns(12_345)
            down_ns = s.pin(name, 0)
            s.wait_ns(3_000_057)
            up_ns = s.pin(name, 1)
            s.fall()
            r = s.recording()
        complaints += [
            "" if r.level("DRDY", down_ns) else f"{name}: DRDY stays low",
            "" if not r.between_ns("DRDY", 0, down_ns, up_ns) else f"{name}: a word while low",
            CLK.complaint(name, up_ns, r.nth_ns("DRDY", 0, up_ns), 3 * period_tau(19)),
        ]
    no_complaints(complaints)


def test_an_unread_word_raises_drdy_before_the_next(tmp_path: Path) -> None:
    with chip(tmp_path / "a.vcd") as s:
        for _ in range(3):
            s.fall()
        r = s.recording()
    falls, rises = r.edges_ns("DRDY", 0), r.edges_ns("DRDY", 1)
    highs = [t for t in rises if t > falls[0]]
    no_complaints(
        [CLK.complaint("pulse", up, down, PULSE_TAU) for up, down in zip(highs, falls[1:], strict=True)]
        + [CLK.complaint("period", a, b, period_tau(19)) for a, b in pairwise(falls)]
    )


def driven(path: Path, **options: float | str | bool) -> tuple[Recording, int, int, int]:
    """A read of the word FFFFFFh at the very fall of DRDY: the recording, RFS low, last fall of SCLK, RFS high."""
    with chip(path, control(), **options) as s:
        s.adc.set_volts(0, 3.0)
        s.pin("A0", 1)
        for _ in range(5):
            s.fall()
        rfs_ns = s.pin("RFS", 0)  # DRDY low to RFS low: 0 ns
        s.wait_ns(s.FIRST_NS)
        assert s.bits(24) == 0xFFFFFF
        last_ns = s.now_ns
        up_ns = s.end("RFS")
        assert s.adc.counters["stale_reads"] == 0
        r = s.recording()
    assert rfs_ns in r.edges_ns("DRDY", 0)
    return r, rfs_ns, last_ns, up_ns


@pytest.mark.parametrize(
    ("options", "access_ns", "bit_ns", "rise_ns"),
    [
        ({}, 300, 100, 100),
        ({"rfs_access_ns": 400, "bit_access_ns": 220, "drdy_rise_ns": 110}, 400, 220, 110),
        ({"rfs_access_ns": 1, "bit_access_ns": 10, "drdy_rise_ns": 1}, 1, 10, 1),
    ],
)
def test_outputs_keep_their_delays(
    options: dict[str, float], access_ns: int, bit_ns: int, rise_ns: int, tmp_path: Path
) -> None:
    """First bit after RFS and before any SCLK, at most 4 tau; the next 10 ns to 2 tau + 20 ns after the fall; DRDY at
    most tau + 10 ns after the last one."""
    assert access_ns <= 4 * TAU_NS
    assert 10 <= bit_ns <= 2 * TAU_NS + 20
    assert rise_ns <= TAU_NS + 10
    r, rfs_ns, last_ns, _ = driven(tmp_path / "a.vcd", **options)
    assert r.nth_ns("SDATA", 1, rfs_ns) == rfs_ns + access_ns < r.nth_ns("SCLK", 1, rfs_ns)
    assert r.nth_ns("SDATA", 0, rfs_ns) == last_ns + bit_ns  # behind the last bit: low
    assert r.nth_ns("DRDY", 1, rfs_ns) == last_ns + rise_ns


def test_data_change_at_the_falls_and_are_steady_at_the_rises(tmp_path: Path) -> None:
    with chip(tmp_path / "a.vcd") as s:
        s.adc.set_volts(0, 2.5 / 3)  # D55555h or so: a change at nearly each bit
        for _ in range(5):
            s.fall()
        rfs_ns = s.begin("RFS", 1)
        s.wait_ns(s.FIRST_NS)
        word = s.bits(24)
        s.end("RFS")
        r = s.recording()
    falls = [t for t in r.edges_ns("SCLK", 0) if t > rfs_ns]
    rises = [t for t in r.edges_ns("SCLK", 1) if t > rfs_ns]
    changes = sorted(t for level in (0, 1) for t in r.edges_ns("SDATA", level) if rfs_ns + 300 < t <= falls[-1])
    assert len(changes) > 15
    assert {t - 100 for t in changes} <= set(falls)
    assert [r.level("SDATA", t) for t in rises] == [word >> (23 - i) & 1 for i in range(24)]


def test_sdata_is_released_after_rfs(tmp_path: Path) -> None:
    """At most 2.5 tau + 50 ns; who drives SDATA then is seen at once."""
    with chip(tmp_path / "a.vcd") as s:
        s.adc.set_volts(0, 3.0)
        for _ in range(5):
            s.fall()
        s.begin("RFS", 1)
        s.wait_ns(s.FIRST_NS)
        s.bits(3)
        s.wait_ns(s.LAST_NS)
        up_ns = s.pin("RFS", 1)
        s.wait_ns(1_000)
        r = s.recording()
    released_ns = r.nth_ns("SDATA", 0, up_ns)
    assert released_ns == up_ns + 2 * TAU_NS <= up_ns + 5 * TAU_NS // 2 + 50


def test_drdy_follows_the_word_and_nothing_else(tmp_path: Path) -> None:
    """It rises behind bit 16 or 24 by WL, not behind a control word, not one bit early."""
    for bits24, count in ((False, 16), (True, 24)):
        with chip(tmp_path / "a.vcd", control(bits24=bits24)) as s:
            s.begin("RFS", 1)
            s.wait_ns(s.FIRST_NS)
            s.bits(count - 1)
            s.wait_ns(5_000)
            assert s.adc.pins["DRDY"].level == 0
            last_ns = s.pin("SCLK", 1)
            s.wait_ns(s.HALF_NS)
            last_ns = s.pin("SCLK", 0)
            s.end("RFS")
            assert s.read(0) == control(bits24=bits24)
            s.fall()
            r = s.recording()
        assert r.nth_ns("DRDY", 1, last_ns) == last_ns + TAU_NS


def counted(path: Path, counter: str, **change: int) -> int:
    """What a read with one time changed adds to a counter: a0_ns, high_ns, low_ns, last_ns."""
    times = {"a0_ns": 400, "high_ns": 400, "low_ns": 400, "last_ns": 500} | change
    with chip(path) as s:
        rfs_ns = s.begin("RFS", 1, times["a0_ns"])
        s.wait_ns(s.FIRST_NS)
        for i in range(24):
            if i:
                s.wait_ns(times["low_ns"])
            s.pin("SCLK", 1)
            s.wait_ns(times["high_ns"])
            s.pin("SCLK", 0)
        s.wait_ns(times["last_ns"])
        s.pin("RFS", 1)
        s.pin("A0", 0)  # A0 after RFS high: 0 ns
        counters = s.adc.counters
        r = s.recording()
    # The recording has the edges that were meant.
    rises, falls = ([t for t in r.edges_ns("SCLK", level) if t > rfs_ns] for level in (1, 0))
    assert {b - a for a, b in zip(rises, falls, strict=True)} == {times["high_ns"]}
    assert {b - a for a, b in pairwise(rises)} == {times["high_ns"] + times["low_ns"]}
    assert rfs_ns - max(t for t in r.edges_ns("A0", 1) if t <= rfs_ns) == times["a0_ns"]
    assert r.nth_ns("RFS", 1, falls[-1]) - falls[-1] == times["last_ns"]
    names = ("a0_violations", "sclk_violations", "sdata_violations", "frame_violations")
    assert sum(counters[n] for n in names) == counters[counter]
    return counters[counter]


@pytest.mark.parametrize(
    ("counter", "kept", "broken", "times"),
    [
        ("a0_violations", {"a0_ns": 200}, {"a0_ns": 199}, 1),  # 2 tau
        ("sclk_violations", {"high_ns": 250, "low_ns": 250}, {"high_ns": 250, "low_ns": 249}, 23),  # 5 tau
        ("sclk_violations", {"high_ns": 200}, {"high_ns": 199}, 24),  # 2 tau
        ("sclk_violations", {"low_ns": 200, "high_ns": 600}, {"low_ns": 199, "high_ns": 600}, 23),
        ("frame_violations", {"last_ns": 10}, {"last_ns": 9}, 1),
    ],
)
def test_limits_of_a_read_are_counted_one_ns_beyond(
    counter: str, kept: dict[str, int], broken: dict[str, int], times: int, tmp_path: Path
) -> None:
    assert counted(tmp_path / "a.vcd", counter, **kept) == 0
    assert counted(tmp_path / "a.vcd", counter, **broken) == times


def written(setup_ns: int, high_ns: int, hold_ns: int, last_ns: int, path: Path) -> dict[str, int]:
    """Counters after a write whose every bit comes setup_ns before the rise and goes hold_ns after it; A0 moves with
    TFS."""
    word = control(code=100)
    with chip(path) as s:
        s.read()
        s.pin("A0", 1)
        s.wait_ns(1_000)
        s.pin("A0", 0)
        s.pin("TFS", 0)  # A0 to TFS: 0 ns
        s.wait_ns(500)
        for i in range(24):
            bit = word >> (23 - i) & 1
            s.pin("SDATA", 1 - bit)
            s.wait_ns(600)
            s.pin("SDATA", bit)
            s.wait_ns(setup_ns)
            s.pin("SCLK", 1)
            s.wait_ns(hold_ns)
            s.pin("SDATA", 1 - bit)
            s.wait_ns(high_ns - hold_ns)
            s.pin("SCLK", 0)
        s.wait_ns(last_ns)
        s.pin("TFS", 1)
        s.pin("A0", 1)
        s.wait_ns(1_000)
        assert [s.adc.peek(a) for a in range(3)] == list(word.to_bytes(3, "big"))  # lenient: it acts all the same
        r = s.recording()
        found = s.adc.counters
    rises = r.edges_ns("SCLK", 1)[-24:]
    assert {min(t for t in [*r.edges_ns("SDATA", 0), *r.edges_ns("SDATA", 1)] if t > up) - up for up in rises} == {
        hold_ns
    }
    return {n: found[n] for n in ("a0_violations", "sclk_violations", "sdata_violations", "frame_violations")}


@pytest.mark.parametrize(
    ("setup_ns", "high_ns", "hold_ns", "last_ns", "counter", "times"),
    [
        (0, 200, 30, 400, "", 0),  # 2 tau less the high time is 0 here; TFS 4 tau
        (0, 400, 30, 400, "", 0),
        (400, 400, 29, 400, "sdata_violations", 24),
        (400, 400, 30, 399, "frame_violations", 1),
    ],
)
def test_limits_of_a_write_are_counted_one_ns_beyond(
    setup_ns: int, high_ns: int, hold_ns: int, last_ns: int, counter: str, times: int, tmp_path: Path
) -> None:
    found = written(setup_ns, high_ns, hold_ns, last_ns, tmp_path / "a.vcd")
    assert found == {n: times if n == counter else 0 for n in found}


def test_self_clocking_edges(tmp_path: Path) -> None:
    """First fall 4 tau after RFS or TFS, low 3/2, high 1/2 tau, as many pulses as bits; SDATA steady at the rises."""
    for frame, bits in (("RFS", 16), ("TFS", 24)):
        with chip(tmp_path / "a.vcd", control(bits24=False)) as s:
            s.adc.set_volts(0, 2.5 / 3)
            s.pin("MODE", 1)
            for _ in range(5):
                s.fall()
            begin_ns = s.begin(frame, 1 if frame == "RFS" else 0)
            s.wait_ns(20_000)
            s.pin(frame, 1)
            r = s.recording()
        falls, rises = ([t for t in r.edges_ns("SCLK", level) if t >= begin_ns] for level in (0, 1))
        assert falls == [begin_ns + 400 + 200 * i for i in range(bits)]
        assert rises == [t + 150 for t in falls]
        if frame == "RFS":
            changes = [t for level in (0, 1) for t in r.edges_ns("SDATA", level) if t > begin_ns + 300]
            assert changes
            assert {(t - begin_ns - 400) % 200 for t in changes if t <= rises[-1]} == {50}

"""The first pass that follows a run: the same as over the whole recording, whatever the parts; what the line says."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from psabench.native.nav import Floats
from psabench.native.sins import DEG, Sins, SinsConfig, feed_data
from psabench.progress import Bar
from psabench.sins.live import LivePass, sigma_words
from psabench.sins.table import attitudes

DT_S, RATE_DPS, COUNT = 0.01, 10.0, 6000
AT_S = 700.0  # of the unit's time, at which the recording begins


def config(dt_s: float, stand: bool) -> SinsConfig:
    return SinsConfig(sample_s=round(dt_s, 9), clone=True, stand=stand)


def recording() -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """A turn about axis 1: ends of intervals, increments; instants and angles of the table."""
    end_s: Floats = AT_S + DT_S * np.arange(1, COUNT + 1, dtype=np.float64)
    dtheta = np.tile([RATE_DPS * DEG * DT_S, 0.0, 0.0], (COUNT, 1))
    roll = RATE_DPS * DEG * DT_S * (np.arange(COUNT) + 0.5)
    dv = -9.81 * DT_S * np.stack([np.zeros(COUNT), np.sin(roll), np.cos(roll)], -1)
    at_s: Floats = AT_S + 0.1 * np.arange(1, COUNT // 10, dtype=np.float64)
    angles: Floats = np.stack([RATE_DPS * (at_s - AT_S), 0.0 * at_s, 0.0 * at_s], -1)
    return end_s, np.asarray(dtheta), np.asarray(dv), at_s, angles


def whole(stand: bool, count: int) -> Sins:
    _, dtheta, dv, at_s, angles = recording()
    s = Sins(config(DT_S, stand), attitudes(0.0, np.zeros((1, 3)))[0], feedback=True)
    given = (at_s - AT_S, attitudes(0.0, np.radians(angles))) if stand else None
    feed_data(s, dtheta[:count], dv[:count], given)
    return s


@pytest.mark.parametrize("stand", [True, False])
def test_parts_end_where_the_whole_does(stand: bool) -> None:
    """The table's angles come 0.2 s late; readings wait for them."""
    end_s, dtheta, dv, at_s, angles = recording()
    live = LivePass(lambda dt_s: config(dt_s, stand), 0.0)
    assert live.words == ""
    low = told = 0
    for high in (130, 131, 1777, 4000, COUNT):
        live.take(end_s[low:high], dtheta[low:high], dv[low:high])
        ready = int(np.searchsorted(at_s, end_s[high - 1] - 0.2))
        if stand:
            live.follow(at_s[told:ready], angles[told:ready])
        low, told = high, ready
    count = math.floor((at_s[told - 1] - AT_S) / DT_S + 1e-6) if stand else COUNT
    assert live.words == f"{count * DT_S:.0f} s, sd {sigma_words(whole(stand, count))}"


def test_every_block_is_in_the_words() -> None:
    words = sigma_words(Sins(replace(config(DT_S, True), quad_sd_s2pm=1e-5, delay_sd_s=0.01), np.eye(3)))
    assert words == (
        "ν 0.5 °/h, Θ 1000 ppm 180 ″, Δf 20000 µm/s², Γ 1000 ppm 180 ″, q 98 µg/g², τ_a 10 ms, δ 3600 ″, τ 50 ms"
    )


def test_what_the_filter_refuses_ends_the_look_and_not_the_run() -> None:
    end_s, dtheta, dv, *_ = recording()
    live = LivePass(lambda dt_s: config(dt_s, stand=False), 0.0)
    dv = np.where(np.arange(COUNT)[:, None] == 500, np.nan, dv)
    live.take(end_s, dtheta, dv)
    assert live.words.startswith("live filter: ")
    live.take(end_s, dtheta, dv)
    assert live.words.startswith("live filter: ")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("columns", "bar"), [(60, 21), (200, 30), (36, 0)])
def test_the_bar_gives_way_to_words(monkeypatch: pytest.MonkeyPatch, columns: int, bar: int) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    out = Terminal()
    with Bar(out).step("plan", 1) as advance:
        advance("1350 s, sd ν 0.01")
    line = out.getvalue().partition("\r")[2].partition("\x1b")[0]
    assert line.count("█") == bar
    assert len(line) < columns
    assert line.endswith("1/1, 0 s left; 1350 s, sd ν 0.01"[: columns - 6])


def test_elsewhere_the_words_end_the_line_of_the_step() -> None:
    out = io.StringIO()
    with Bar(out).step("plan", 2) as advance:
        advance("1 s, sd ν 1")
        advance("2 s, sd ν 0.5")
    assert out.getvalue().startswith("plan: 2/2 in 0.")
    assert out.getvalue().endswith(" s; 2 s, sd ν 0.5\n")

"""A recording of a thermal run: the means of its frames, and sensors that give nothing."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.boards.psa2.frames import KELVIN_DEGC, TEMP_CODES_PER_K, Frames
from psabench.errors import LinkError
from psabench.thermal.bench import CASE_CHANNEL, sample_of_frames


def frames_of(**columns: np.ndarray) -> Frames:
    n = 200
    some, none_s = np.zeros(n, dtype=np.int64), np.zeros(n)
    codes = np.full(n, round((20.0 - KELVIN_DEGC) * TEMP_CODES_PER_K))
    given = {"u_v": np.ones((n, 3)), "temp_code": codes, "temp_channel": np.arange(n) % 4, "clipped": some > 0}
    given |= {"settled": some == 0} | columns
    return Frames(t_rx_s=none_s, t_sample_s=none_s, seq=some, **given)


def test_a_recording_is_the_means_of_its_frames_and_half_a_code() -> None:
    code_v = 10.0 / 2**23  # cut off: the voltage was half a code higher on average
    s = sample_of_frames(frames_of(), 7.0, 2.0)
    assert s.u_v.tolist() == pytest.approx([(1.0 + code_v / 2.0) / 2.0] * 3, rel=1e-12)
    assert s.temps_degc == pytest.approx([20.0] * 4, abs=0.01)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"temp_code": np.where(np.arange(200) % 4 == CASE_CHANNEL, 0, 19000)}, "channel case: .* 0 K: it is open"),
        ({"temp_code": np.full(200, 30000)}, "sensor of channel x: expected -90 to 130 degC, got 184"),
        ({"temp_channel": np.zeros(200, dtype=np.int64)}, "channel y: expected readings, got none in 200 samples"),
        ({"clipped": np.ones(200, dtype=bool)}, "channel x: expected readings within its range, got one at its limit"),
        ({"settled": np.zeros(200, dtype=bool)}, "expected settled readings, got 200 that are not"),
    ],
)
def test_a_sensor_that_gives_nothing_is_named(columns: dict[str, np.ndarray], says: str) -> None:
    with pytest.raises(LinkError, match=says):
        sample_of_frames(frames_of(**columns), 0.0, 1.0)

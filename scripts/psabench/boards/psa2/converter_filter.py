"""The decimation chain of the ADS1281/ADS1282 in exact integers, from the published coefficients alone.

Written from sources 1.8, it shares nothing with the emulator: coefficients are typed again, the sinc is the fifth power
of a moving sum at the modulator rate, stages are polynomials. Frequencies are in units of the data rate, times in data
periods, one data period being 32 sinc blocks; an input is held over a block, N modulator clocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

BLOCKS = 32  # sinc blocks in a data period: the stages decimate 2, 2, 4, 2

# fmt: off
STAGE_1 = (
    3, 0, -25, 0, 150, 256, 150, 0, -25, 0, 3,
)

STAGE_2 = (
    -10944, 0, 103807, 0, -507903, 0, 2512192, 4194304, 2512192, 0, -507903, 0, 103807, 0, -10944,
)

STAGE_3_LINEAR = (
    0, 0, -73, -874, -4648, -16147, -41280, -80934, -120064, -118690, -18203, 224751, 580196, 893263, 891396,
    293598, -987253, -2635779, -3860322, -3572512, -822573, 4669054, 12153698, 19911100, 25779390, 27966862,
    25779390, 19911100, 12153698, 4669054, -822573, -3572512, -3860322, -2635779, -987253, 293598, 891396, 893263,
    580196, 224751, -18203, -118690, -120064, -80934, -41280, -16147, -4648, -874, -73, 0, 0,
)

STAGE_3_MINIMUM = (
    819, 8211, 44880, 174712, 536821, 1372637, 3012996, 5788605, 9852286, 14957445, 20301435, 24569234, 26260385,
    24247577, 18356231, 9668991, 327749, -7171917, -10926627, -10379094, -6505618, -1333678, 2972773, 5006366,
    4566808, 2505652, 126331, -1496514, -1933830, -1410695, -502731, 245330, 565174, 492084, 231656, -9196, -125456,
    -122207, -61813, -4445, 22484, 22245, 10775, 940, -2953, -2599, -1052, -43, 214, 132, 33, 0, 0,
)

STAGE_4_LINEAR = (
    -132, -432, -75, 2481, 6692, 7419, -266, -10663, -8280, 10620, 22008, 348, -34123, -25549, 33460, 61387, -7546,
    -94192, -50629, 101135, 134826, -56626, -220104, -56082, 263758, 231231, -215231, -430178, 34715, 580424,
    283878, -588382, -693209, 366118, 1084786, 132893, -1300087, -878642, 1162189, 1741565, -522533, -2490395,
    -688945, 2811738, 2425494, -2338095, -4511116, 641555, 6661730, 2950811, -8538057, -10537298, 9818477, 41426374,
    56835776, 41426374, 9818477, -10537298, -8538057, 2950811, 6661730, 641555, -4511116, -2338095, 2425494,
    2811738, -688945, -2490395, -522533, 1741565, 1162189, -878642, -1300087, 132893, 1084786, 366118, -693209,
    -588382, 283878, 580424, 34715, -430178, -215231, 231231, 263758, -56082, -220104, -56626, 134826, 101135,
    -50629, -94192, -7546, 61387, 33460, -25549, -34123, 348, 22008, 10620, -8280, -10663, -266, 7419, 6692, 2481,
    -75, -432, -132,
)

STAGE_4_MINIMUM = (
    11767, 133882, 769961, 2940447, 8262605, 17902757, 30428735, 40215494, 39260213, 23325925, -1757787, -21028126,
    -21293602, -3886901, 14396783, 16314388, 1518875, -12979500, -11506007, 2769794, 12195551, 6103823, -6709466,
    -9882714, -353347, 8629331, 5597927, -4389168, -7594158, -428064, 6566217, 4024593, -3679749, -5572954, 332589,
    5136333, 2351253, -3357202, -3767666, 1087392, 3847821, 919792, -2918303, -2193542, 1493873, 2595051, -79991,
    -2260106, -963855, 1482337, 1480417, -586408, -1497356, -168417, 1166800, 644405, -675082, -806095, 211391,
    740896, 141976, -527673, -327618, 278227, 363809, -70646, -304819, -63159, 205798, 124363, -107173, -131357,
    31104, 107182, 15644, -71728, -36319, 38331, 38783, -13557, -31453, -1230, 20983, 7729, -11463, -8791, 4659,
    7126, -732, -4687, -976, 2551, 1339, -1103, -1085, 314, 681, 16, -349, -96, 144, 78, -46, -42, 9, 16, 0, -4,
)
# fmt: on

STAGES = {
    "linear": (STAGE_1, STAGE_2, STAGE_3_LINEAR, STAGE_4_LINEAR),
    "minimum": (STAGE_1, STAGE_2, STAGE_3_MINIMUM, STAGE_4_MINIMUM),
}
SCALE = 2 ** (9 + 23 + 27 + 27)  # of the four stages together
STRIDE = (1, 2, 4, 16)  # sinc blocks between two taps of a stage


def product(a: Sequence[int], b: Sequence[int]) -> list[int]:
    """Of two polynomials, lowest power first."""
    out = [0] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        if x:
            for j, y in enumerate(b):
                out[i + j] += x * y
    return out


@cache
def sinc_weights(ratio: int) -> tuple[int, ...]:
    """What a block held over `ratio` modulator clocks adds to the output now and in the next four; sum ratio^5."""
    h = [1]
    for _ in range(5):
        h = product(h, [1] * ratio)
    h += [0] * (5 * ratio - len(h))
    return tuple(sum(h[i : i + ratio]) for i in range(0, 5 * ratio, ratio))


@cache
def impulse(ratio: int, phase: str) -> tuple[int, ...]:
    """Response of the whole chain to one block, in steps of a block, times ratio^5 SCALE."""
    h = list(sinc_weights(ratio))
    for taps, stride in zip(STAGES[phase], STRIDE, strict=True):
        spread = [0] * (stride * (len(taps) - 1) + 1)
        spread[::stride] = taps
        h = product(spread, h)
    return tuple(h)


def weights(ratio: int, phase: str) -> NDArray[np.float64]:
    """The same as fractions of full scale: their sum is the gain at DC."""
    scale = ratio**5 * SCALE
    return np.array([x / scale for x in impulse(ratio, phase)])


def response(ratio: int, phase: str, f: float) -> complex:
    """Gain at f for an input that the chip looks at once a block; phase as of the newest block of a word."""
    h = weights(ratio, phase)
    return complex(np.sum(h * np.exp(-2j * np.pi * f / BLOCKS * np.arange(len(h)))))


def hold(ratio: int, f: float) -> float:
    """What holding the input over a block does to the sinc, as a factor: 1 at DC, 0.0020 dB down at 0.375."""
    x = np.pi * f / (BLOCKS * ratio)
    sinc = (np.sin(ratio * x) / (ratio * np.sin(x))) ** 5
    held = np.array(sinc_weights(ratio)) / ratio**5
    return float(abs(np.sum(held * np.exp(-2j * np.pi * f / BLOCKS * np.arange(5)))) / abs(sinc))


def corner(ratio: int, phase: str) -> float:
    """Frequency at which the gain is 1 / sqrt 2."""
    low, high = 0.40, 0.43
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (middle, high) if abs(response(ratio, phase, middle)) > 0.5**0.5 else (low, middle)
    return low


def at_modulator(ratio: int, phase: str, f: float) -> float:
    """Gain at f, of any size, for an input that the modulator takes at each of its clocks: as sources 1.8 give it.

    It repeats itself at each multiple of the modulator's clock, 32 ratio data rates.
    """
    turn = np.exp(-2j * np.pi * (f / BLOCKS - np.floor(f / BLOCKS)))
    fir = np.prod([np.polyval(taps, turn**stride) for taps, stride in zip(STAGES[phase], STRIDE, strict=True)])
    return float(abs(fir) / SCALE * abs(sinc(ratio, f)))


def sinc(ratio: int, f: float) -> float:
    """The first stage alone: the fifth power of a mean of `ratio` clocks of the modulator."""
    x = np.pi * (f / (BLOCKS * ratio) - np.floor(f / (BLOCKS * ratio)))
    below = np.sin(x)
    return 1.0 if below == 0.0 else float((np.sin(ratio * x) / (ratio * below)) ** 5)

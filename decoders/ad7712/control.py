"""The control register of the AD7710 family, 24 bits, MD2 first."""

MD_NAMES = (
    "normal", "self-calibration", "system zero-scale calibration", "system full-scale calibration",
    "system offset calibration", "background calibration", "zero-scale coefficient", "full-scale coefficient",
)  # fmt: skip
COEFFICIENTS = {6: "Zero-scale coefficient", 7: "Full-scale coefficient"}  # by MD, reached with A0 high
MODULATOR_CLOCKS = 512  # in one period of the modulator
CODES = range(19, 2001)  # of the first notch; a code outside acts as the nearest one

# Name, first bit on the wire, bits, what each value means: "" is not worth a word
FIELDS = (
    ("MD", 0, 3, MD_NAMES),
    ("G", 3, 3, tuple(f"gain {1 << n}" for n in range(8))),
    ("CH", 6, 1, ("AIN1", "AIN2")),
    ("PD", 7, 1, ("", "power-down")),
    ("WL", 8, 1, ("16 bits", "24 bits")),
    ("IO/RO", 9, 1, ("", "output current on")),  # b14: AD7710 IO, AD7711 RO; the AD7712 does not use it
    ("BO", 10, 1, ("", "burn-out current on")),
    ("B/U", 11, 1, ("bipolar", "unipolar")),
)
NOTCH = ("FS", 12, 12)


def field(word, first, count):
    return word >> (24 - first - count) & ((1 << count) - 1)


def md(word):
    return field(word, 0, 3)


def word_bits(word):
    return 24 if field(word, 8, 1) else 16


def unipolar(word):
    return field(word, 11, 1) == 1


def explain(word, clock_hz):
    """Fields in the order of sending: (name, first bit, bits, value, words), the words "" where there is none."""
    fields = []
    for name, first, count, meanings in FIELDS:
        value = field(word, first, count)
        fields.append((name, first, count, value, meanings[value]))
    code = field(word, *NOTCH[1:])
    acting = min(max(code, CODES[0]), CODES[-1])
    notch = f"first notch {clock_hz / MODULATOR_CLOCKS / acting:.4g} Hz"
    fields.append((*NOTCH, code, notch if code == acting else f"{notch} (acts as {acting})"))
    return fields

"""libsigrokdecode decoder `ad7712`; runs in sigrok's own Python, so it needs nothing but the standard library."""

from itertools import pairwise

import sigrokdecode as srd

from . import control

SCLK, SDATA, RFS, TFS, A0, DRDY, MODE = range(7)
ANN_BIT, ANN_FIELD, ANN_CONTROL, ANN_DATA, ANN_COEFFICIENT, ANN_WARNING = range(6)
CONTROL, DATA, COEFFICIENT, NOTHING = range(4)  # what a frame reaches
LONGEST = 24

# Limits in periods of the master clock, but the last, in ns
A0_TO_RFS, SCLK_PERIOD, SCLK_HALF, SCLK_TO_TFS, SCLK_TO_RFS_NS = 2, 5, 2, 4, 10


class Frame:
    """A read, perhaps in several parts, or a write: what it reaches, how many bits that has, those that were seen."""

    def __init__(self, target, width, began):
        self.target = target
        self.width = width  # None: unknown, 16 or 24
        self.began = began  # sample
        self.bits = []  # (sample, level)
        self.beyond = 0  # pulses after the last bit

    def value(self):
        return int("".join(str(level) for _, level in self.bits), 2)

    def whole(self):
        return len(self.bits) == self.width or (self.width is None and len(self.bits) in (16, 24))


class Decoder(srd.Decoder):
    api_version = 3
    id = "ad7712"
    name = "AD7712"
    longname = "AD7710, AD7711, AD7712"
    desc = "24-bit sigma-delta converters: control register, words, coefficients."
    license = "mit"
    inputs = ["logic"]
    outputs = []
    tags = ["IC", "Analog/digital"]
    channels = (
        {"id": "sclk", "name": "SCLK", "desc": "Bits are taken on the rise"},
        {"id": "sdata", "name": "SDATA", "desc": "Bits in both directions, most significant first"},
        {"id": "rfs", "name": "RFS", "desc": "Low during a read"},
    )
    optional_channels = (
        {"id": "tfs", "name": "TFS", "desc": "Low during a write"},
        {"id": "a0", "name": "A0", "desc": "High: data or coefficient, low: control register"},
        {"id": "drdy", "name": "DRDY", "desc": "Low: a word waits; it is read before the control register"},
        {"id": "mode", "name": "MODE", "desc": "High: the converter drives SCLK"},
    )
    options = (
        {"id": "format", "desc": "Number format of words", "default": "signed", "values": ("signed", "hex")},
        {"id": "word_bits", "desc": "Bits of a word", "default": "auto", "values": ("auto", "16", "24")},
        {"id": "clock_hz", "desc": "Master clock in Hz", "default": 10000000},
        {"id": "limits", "desc": "Warn of limits of the converter", "default": "yes", "values": ("yes", "no")},
    )
    annotations = (
        ("bit", "Bit"),
        ("field", "Field"),
        ("control", "Control register"),
        ("data", "Conversion"),
        ("coefficient", "Coefficient"),
        ("warning", "Warning"),
    )
    annotation_rows = (
        ("bits", "Bits", (ANN_BIT,)),
        ("fields", "Fields", (ANN_FIELD,)),
        ("registers", "Registers", (ANN_CONTROL, ANN_COEFFICIENT)),
        ("conversions", "Conversions", (ANN_DATA,)),
        ("warnings", "Warnings", (ANN_WARNING,)),
    )

    def __init__(self):
        self.samplerate = None
        self.reset()

    def reset(self):
        self.control = None  # the control word, unknown until one is written or read
        self.read = self.write = None  # Frame
        self.reading = False  # RFS is low; self.read without it: RFS has interrupted a read
        self.rise = self.fall = self.a0_moved = None  # samples of the latest edges

    def metadata(self, key, value):
        if key == srd.SRD_CONF_SAMPLERATE:
            self.samplerate = value

    def start(self):
        # Asked once: libsigrokdecode 0.5.3 hands out True and False without owning them, and many calls end in a crash.
        self.has = {channel: self.has_channel(channel) for channel in (TFS, A0, DRDY, MODE)}
        self.out_ann = self.register(srd.OUTPUT_ANN)

    def decode(self):
        # At one sample: what ends, the clock, what begins.
        edges = [(SCLK, "f", self.clock_falls), (RFS, "r", self.read_ends), (TFS, "r", self.write_ends)]
        edges += [(SCLK, "r", self.takes_bit), (A0, "e", self.a0_moves), (DRDY, "f", self.word_comes)]
        edges += [(RFS, "f", self.read_begins), (TFS, "f", self.write_begins)]
        edges = [edge for edge in edges if self.has.get(edge[0], True)]
        conditions = [{channel: edge} for channel, edge, _ in edges]
        while True:
            pins = self.wait(conditions)
            for (_, _, happens), matched in zip(edges, self.matched, strict=True):
                if matched:
                    happens(pins)

    # ---- reads

    def read_begins(self, pins):
        if self.write:
            self.warn(self.samplenum, "RFS and TFS low", "Both")
            return
        self.reading = True
        if self.has[A0]:
            self.least("A0 to RFS", self.a0_moved, A0_TO_RFS)
        if not self.read:  # else it goes on where RFS has interrupted it
            self.read = Frame(*self.read_target(pins), self.samplenum)

    def read_target(self, pins):
        """What a read reaches, and its bits. A word that waits comes before the control register."""
        a0 = not self.has[A0] or pins[A0] == 1
        if a0 and self.coefficient():
            return COEFFICIENT, 24
        if not a0 and not (self.has[DRDY] and pins[DRDY] == 0):
            return CONTROL, 24
        if self.has[DRDY] and pins[DRDY] == 1:
            self.warn(self.samplenum, "Read while DRDY is high", "Stale")
        return DATA, self.width_of_a_word()

    def width_of_a_word(self):
        if self.options["word_bits"] != "auto":
            return int(self.options["word_bits"])
        return None if self.control is None else control.word_bits(self.control)

    def read_ends(self, pins):
        if not self.reading:
            return
        self.reading = False
        if not self.read.bits:
            self.read = None
            return
        self.least_ns("SCLK to RFS", self.fall, SCLK_TO_RFS_NS)
        if self.read.whole():
            self.ends(self.read, "is")
            self.read = None
        elif self.read.width is None and len(self.read.bits) != 8:
            self.gives_up()

    def gives_up(self):
        """What was read of a word is all that there is."""
        if self.read and self.read.bits:
            bits, width = len(self.read.bits), self.read.width or "16 or 24"
            self.warn(self.read.began, f"Cut read: {bits} bits, not {width}", "Cut")
        self.read = None

    def word_comes(self, pins):
        if not self.reading:
            self.gives_up()

    # ---- writes

    def write_begins(self, pins):
        if self.reading:
            self.warn(self.samplenum, "RFS and TFS low", "Both")
            return
        self.gives_up()
        self.write = Frame(self.write_target(pins), 24, self.samplenum)

    def write_target(self, pins):
        if not self.has[A0] or pins[A0] == 0:
            return CONTROL
        if self.control is None or self.coefficient():
            return COEFFICIENT
        self.warn(self.samplenum, "Write with A0 high, MD not 110 or 111", "Lost")
        return NOTHING

    def write_ends(self, pins):
        frame, self.write = self.write, None
        if not frame:
            return
        if frame.whole():
            self.least("SCLK to TFS", self.fall, SCLK_TO_TFS)
            self.ends(frame, "=")
        else:
            self.warn(frame.began, f"Cut write: {len(frame.bits)} bits, not {frame.width}", "Cut")

    # ---- the clock and A0

    def frame(self):
        """The frame under way."""
        return self.write or (self.read if self.reading else None)

    def takes_bit(self, pins):
        frame = self.frame()
        if frame:
            if not (self.has[MODE] and pins[MODE] == 1):
                self.least("SCLK period", self.rise, SCLK_PERIOD)
                self.least("SCLK low", self.fall, SCLK_HALF)
            if len(frame.bits) < (frame.width or LONGEST):
                frame.bits.append((self.samplenum, pins[SDATA]))
            else:
                frame.beyond += 1
        self.rise = self.samplenum

    def clock_falls(self, pins):
        if self.frame() and not (self.has[MODE] and pins[MODE] == 1):
            self.least("SCLK high", self.rise, SCLK_HALF)
        self.fall = self.samplenum

    def a0_moves(self, pins):
        self.a0_moved = self.samplenum
        if self.frame():
            self.warn(self.samplenum, "A0 moved in a frame", "A0")
        else:
            self.gives_up()

    # ---- whole frames

    def ends(self, frame, verb):
        self.put_bits(frame)
        if frame.beyond:
            self.warn(frame.began, f"{frame.beyond} pulses after the last bit", "Pulses")
        say = {CONTROL: self.control_word, DATA: self.data_word, COEFFICIENT: self.coefficient_word}
        if frame.target in say:
            say[frame.target](frame, verb)

    def put_bits(self, frame):
        """The bits, each half a period to both sides; self.spans has where each begins and ends."""
        samples = [sample for sample, _ in frame.bits]
        half = max(min(b - a for a, b in pairwise(samples)) // 2, 1)
        self.spans = [(max(sample - half, 0), sample + half) for sample in samples]
        for (start, end), (_, level) in zip(self.spans, frame.bits, strict=True):
            self.put(start, end, self.out_ann, [ANN_BIT, [str(level)]])

    def control_word(self, frame, verb):
        self.control = frame.value()
        fields = control.explain(self.control, self.options["clock_hz"])
        for name, first, count, value, words in fields:
            text = f"{name} = {value}" + (f": {words}" if words else "")
            self.put(self.spans[first][0], self.spans[first + count - 1][1], self.out_ann, [ANN_FIELD, [text, name]])
        plain = f"Control {verb} {self.control:06X}h"
        self.say(frame, ANN_CONTROL, f"{plain}: {', '.join(f[4] for f in fields if f[4])}", plain, "Control")

    def coefficient_word(self, frame, verb):
        name = self.coefficient() or "Coefficient"
        self.say(frame, ANN_COEFFICIENT, f"{name} {verb} {frame.value():06X}h", name, name[0])

    def data_word(self, frame, verb):
        word, bits = frame.value(), len(frame.bits)
        if self.options["format"] == "hex":
            text = f"{word:0{bits // 4}X}h"
        else:  # offset binary, which is the coding after power-on
            straight = self.control is not None and control.unipolar(self.control)
            text = str(word if straight else word - (1 << (bits - 1)))
        self.say(frame, ANN_DATA, f"Code {text}", text)

    def coefficient(self):
        """Name of the coefficient that a frame with A0 high reaches, None if it reaches words."""
        return None if self.control is None else control.COEFFICIENTS.get(control.md(self.control))

    def say(self, frame, ann, *texts):
        self.put(frame.began, self.samplenum, self.out_ann, [ann, list(texts)])

    def warn(self, start, text, short):
        self.put(start, self.samplenum, self.out_ann, [ANN_WARNING, [text, short]])

    def least(self, what, since, clocks):
        """Warns when the time since a sample is shorter than so many periods of the master clock."""
        if self.options["clock_hz"] > 0:
            self.least_ns(what, since, clocks * 1000000000 // self.options["clock_hz"])

    def least_ns(self, what, since, limit_ns):
        """The same in ns. An edge is up to one sample before the sample that shows it."""
        if self.options["limits"] == "no" or since is None or not self.samplerate:
            return
        samples = self.samplenum - since
        if (samples + 1) * 1000000000 <= limit_ns * self.samplerate:
            self.warn(since, f"{what}: {samples * 1000000000 // self.samplerate} ns, not {limit_ns}", what)

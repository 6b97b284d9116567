"""libsigrokdecode decoder `psd1cycle`; runs in sigrok's own Python, so it needs nothing but the standard library."""

import sigrokdecode as srd

A0, RFX, RFY, RFZ, SCLK, SDAT, FL2, CS, RW, AB, D = *range(9), 9, 13
ANN_BIT, ANN_WORD, ANN_READ, ANN_CYCLE, ANN_WARNING = range(5)
AXES = "XYZ"
BITS = 16
COEFFICIENT_BITS = 24  # read with A0 high in the set-up, for no one
ZERO = 0x8000  # offset binary

# Limits of an AD7712 on 10 MHz, ns (external clocking, 10 MHz: one clock is 100 ns)
A0_TO_RFS, RFS_TO_BIT, SCLK_PERIOD, SCLK_HALF, SCLK_TO_RFS = 200, 400, 500, 200, 10


class Decoder(srd.Decoder):
    api_version = 3
    id = "psd1cycle"
    name = "PSD-1 cycle"
    longname = "PSD-1 cycle of reading"
    desc = "Three-word read-out cycles of PSD-1 converter boards."
    license = "mit"
    inputs = ["logic"]
    outputs = ["psd1cycle"]
    tags = ["Sensor", "Embedded/industrial"]
    channels = (
        {"id": "a0", "name": "A0", "desc": "High during a cycle"},
        {"id": "rfx", "name": "RFX", "desc": "Low while X is transferred"},
        {"id": "rfy", "name": "RFY", "desc": "Low while Y is transferred"},
        {"id": "rfz", "name": "RFZ", "desc": "Low while Z is transferred"},
        {"id": "sclk", "name": "SCLK", "desc": "16 pulses a word; bits are taken on the rise"},
        {"id": "sdat", "name": "SDAT", "desc": "Bits of the words, changes on falling SCLK"},
    )
    optional_channels = (
        {"id": "fl2", "name": "FL2", "desc": "High while a word waits for the host"},
        {"id": "cs", "name": "CS", "desc": "Strobe of the host, active low"},
        {"id": "rw", "name": "RW", "desc": "High: the host reads"},
        *({"id": f"ab{i}", "name": f"AB{i}", "desc": f"Address, bit {i}"} for i in range(4)),
        *({"id": f"d{i}", "name": f"D{i}", "desc": f"Data of the host's bus, bit {i}"} for i in range(16)),
    )
    options = (
        {"id": "format", "desc": "Number format of words", "default": "signed", "values": ("signed", "hex")},
        {"id": "limits", "desc": "Warn of limits of the converters", "default": "yes", "values": ("yes", "no")},
    )
    annotations = (
        ("bit", "Bit"),
        ("word", "Word"),
        ("read", "Host's cycle"),
        ("cycle", "Cycle"),
        ("warning", "Warning"),
    )
    annotation_rows = (
        ("bits", "Bits", (ANN_BIT,)),
        ("words", "Words", (ANN_WORD,)),
        ("reads", "Host", (ANN_READ,)),
        ("cycles", "Cycles", (ANN_CYCLE,)),
        ("warnings", "Warnings", (ANN_WARNING,)),
    )

    def __init__(self):
        self.samplerate = None
        self.reset()

    def reset(self):
        self.number = 0  # of the cycle, from 0 at the start of the recording
        self.words = None  # of the cycle under way; None: between cycles, or its beginning was not seen
        self.transfers = 0  # of the cycle, coefficients included
        self.began = self.rfs = self.strobe = self.rise = self.fall = None  # samples
        self.bits = []  # (sample, level) of the transfer under way
        self.pins = ()  # as the strobe began

    def metadata(self, key, value):
        if key == srd.SRD_CONF_SAMPLERATE:
            self.samplerate = value

    def start(self):
        # Asked once: libsigrokdecode 0.5.3 hands out True and False without owning them, and many calls end in a crash.
        self.has = {channel: self.has_channel(channel) for channel in (FL2, CS, RW, AB, D)}
        self.out_ann = self.register(srd.OUTPUT_ANN)
        self.out_python = self.register(srd.OUTPUT_PYTHON)

    def decode(self):
        edges = [(A0, "r", self.cycle_begins), (A0, "f", self.cycle_ends), (SCLK, "r", self.takes_bit)]
        edges.append((SCLK, "f", self.clock_falls))
        for axis in range(3):
            edges.append((RFX + axis, "f", self.transfer_begins))
            edges.append((RFX + axis, "r", self.transfer_ends))
        if self.has[CS]:
            edges += [(CS, "f", self.strobe_begins), (CS, "r", self.strobe_ends)]
        # At one sample: what ends, the clock, what begins.
        edges.sort(key=lambda e: (e[2] in (self.cycle_begins, self.transfer_begins, self.strobe_begins), e[0]))
        conditions = [{channel: edge} for channel, edge, _ in edges]
        while True:
            pins = self.wait(conditions)
            for (channel, _, happens), matched in zip(edges, self.matched, strict=True):
                if matched:
                    happens(channel, pins)

    # ---- a cycle

    def cycle_begins(self, channel, pins):
        self.words, self.transfers, self.began = [], 0, self.samplenum

    def cycle_ends(self, channel, pins):
        if self.words is None:
            return
        if len(self.words) == 3:
            text = " ".join(f"{n}={self.show(w)}" for n, w in zip(AXES, self.words, strict=True))
            long = f"Cycle {self.number}: {text}"
            self.put(self.began, self.samplenum, self.out_ann, [ANN_CYCLE, [long, f"Cycle {self.number}", "C"]])
            self.put(self.began, self.samplenum, self.out_python, ["CYCLE", self.number, self.words])
            self.number += 1
        elif self.words:
            self.warn(self.began, f"Cut cycle: {len(self.words)} words, not 3", "Cut")
        self.words = None

    # ---- a transfer

    def transfer_begins(self, channel, pins):
        axis = channel - RFX
        self.rfs, self.bits, self.rise, self.fall = self.samplenum, [], None, None
        if self.words is None:
            return
        if axis != self.transfers:
            self.warn(self.samplenum, f"RF{AXES[axis]} out of turn", "Turn")
        if self.transfers == 0:
            self.least("A0 to RFX", self.began, A0_TO_RFS)
        self.transfers += 1

    def takes_bit(self, channel, pins):
        if self.rfs is None:
            return
        if self.rise is None:
            self.least("RFS to SCLK", self.rfs, RFS_TO_BIT)
        else:
            self.least("SCLK period", self.rise, SCLK_PERIOD)
            self.least("SCLK low", self.fall, SCLK_HALF)
        self.rise = self.samplenum
        self.bits.append((self.samplenum, pins[SDAT]))

    def clock_falls(self, channel, pins):
        if self.rise is not None:
            self.least("SCLK high", self.rise, SCLK_HALF)
        self.fall = self.samplenum

    def transfer_ends(self, channel, pins):
        name, start = AXES[channel - RFX], self.rfs
        self.rfs = None
        if start is None:  # its beginning was not seen
            return
        if len(self.bits) != BITS:
            if len(self.bits) != COEFFICIENT_BITS:
                self.warn(start, f"Torn word {name}: {len(self.bits)} bits, not {BITS}", "Torn")
            return
        self.least("SCLK to RFS", self.fall, SCLK_TO_RFS)
        half = max((self.bits[1][0] - self.bits[0][0]) // 2, 1)
        for sample, level in self.bits:
            self.put(sample - half, sample + half, self.out_ann, [ANN_BIT, [str(level)]])
        word = int("".join(str(level) for _, level in self.bits), 2)
        text = self.show(word)
        self.put(start, self.samplenum, self.out_ann, [ANN_WORD, [f"{name}={text}", text, name]])
        if self.words is not None:
            self.words.append(word)

    # ---- the host

    def strobe_begins(self, channel, pins):
        self.strobe, self.pins = self.samplenum, pins
        if self.has[FL2] and pins[FL2] == 0 and self.words is not None and self.reads(pins):
            self.warn(self.samplenum, "Read before FL2", "Early")

    def strobe_ends(self, channel, pins):
        if self.strobe is None:
            return
        text = "Read" if self.reads(self.pins) else "Write"
        if self.has[AB]:
            text += f" {self.number_at(AB, 4)}"
        if self.has[D]:
            text += f": {self.number_at(D, 16):04X}h"
        self.put(self.strobe, self.samplenum, self.out_ann, [ANN_READ, [text, text[0]]])
        self.strobe = None

    def reads(self, pins):
        return not self.has[RW] or pins[RW] == 1

    def number_at(self, first, width):
        """What stood on a bus when the strobe began."""
        return sum((self.pins[first + i] == 1) << i for i in range(width))

    # ---- words

    def show(self, word):
        return f"{word:04X}h" if self.options["format"] == "hex" else str(word - ZERO)

    def warn(self, start, text, short):
        self.put(start, self.samplenum, self.out_ann, [ANN_WARNING, [text, short]])

    def least(self, what, since, limit_ns):
        """Warns when the time since a sample is shorter than a limit."""
        if self.options["limits"] == "no" or since is None or not self.samplerate:
            return
        ns = (self.samplenum - since) * 1000000000 // self.samplerate
        if ns < limit_ns:
            self.warn(since, f"{what}: {ns} ns, not {limit_ns}", what)

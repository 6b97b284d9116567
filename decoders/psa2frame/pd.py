"""libsigrokdecode decoder `psa2frame`; runs in sigrok's own Python, so it needs nothing but the standard library."""

import sigrokdecode as srd

INT, DATA, CLK = range(3)
ANN_BIT, ANN_WORD, ANN_FRAME, ANN_WARNING = range(4)


class Decoder(srd.Decoder):
    api_version = 3
    id = "psa2frame"
    name = "PSA-2 frame"
    longname = "PSA-2 accelerometer frame"
    desc = "Four-word frames of PSA-2 converter boards."
    license = "mit"
    inputs = ["logic"]
    outputs = ["psa2frame"]
    tags = ["Sensor", "Embedded/industrial"]
    channels = (
        {"id": "int", "name": "INT", "desc": "Low while a frame is sent"},
        {"id": "data", "name": "DATA", "desc": "Words, changes on falling CLK"},
        {"id": "clk", "name": "CLK", "desc": "Runs only while bits are sent"},
    )
    options = (
        {"id": "word_bits", "desc": "Bits per word", "default": 32, "values": (16, 24, 32)},
        {"id": "bit_order", "desc": "Bit order", "default": "lsb-first", "values": ("lsb-first", "msb-first")},
        {"id": "words", "desc": "Names of the words, in order of sending", "default": "XYZT"},
        {
            "id": "format",
            "desc": "Number format of signed words",
            "default": "signed",
            "values": ("signed", "hex"),
        },
    )
    annotations = (
        ("bit", "Bit"),
        ("word", "Word"),
        ("frame", "Frame"),
        ("warning", "Warning"),
    )
    annotation_rows = (
        ("bits", "Bits", (ANN_BIT,)),
        ("words", "Words", (ANN_WORD,)),
        ("frames", "Frames", (ANN_FRAME,)),
        ("warnings", "Warnings", (ANN_WARNING,)),
    )

    def __init__(self):
        self.reset()

    def reset(self):
        self.frame = 0  # number of the frame, from 0 at the start of the recording

    def start(self):
        self.out_ann = self.register(srd.OUTPUT_ANN)
        self.out_python = self.register(srd.OUTPUT_PYTHON)

    def decode(self):
        self.wait({INT: "h"})  # a frame under way when the recording begins is not decoded
        while True:
            self.wait({INT: "f"})
            start = self.samplenum
            self.finish(start, *self.collect())

    def collect(self):
        """Samples of the bits until INT rises: [(sample, level)], sample of the rise."""
        bits = []
        while True:
            _, data, _ = self.wait([{CLK: "r"}, {INT: "r"}])
            if self.matched[0]:
                bits.append((self.samplenum, data))
            if self.matched[1]:
                return bits, self.samplenum

    def finish(self, start, bits, end):
        """Annotates one frame, or says why it is none."""
        width = self.options["word_bits"]
        names = self.options["words"]
        if len(bits) != width * len(names):
            text = f"Torn frame: {len(bits)} bits, not {width * len(names)}"
            self.put(start, end, self.out_ann, [ANN_WARNING, [text, "Torn"]])
            return
        half = max((bits[1][0] - bits[0][0]) // 2, 1)  # of a CLK period, in samples
        values = []
        for i, name in enumerate(names):
            word = bits[i * width : (i + 1) * width]
            values.append(self.word(name, word, half))
        text = " ".join(f"{n}={self.show(n, v)}" for n, v in zip(names, values, strict=True))
        self.put(start, end, self.out_ann, [ANN_FRAME, [f"Frame {self.frame}: {text}", f"Frame {self.frame}", "F"]])
        self.put(start, end, self.out_python, ["FRAME", self.frame, values])
        self.frame += 1

    def word(self, name, bits, half):
        """Annotates one word and its bits; returns it as an unsigned number."""
        value = 0
        for place, (sample, level) in enumerate(bits):
            weight = place if self.options["bit_order"] == "lsb-first" else len(bits) - 1 - place
            value |= level << weight
            self.put(sample - half, sample + half, self.out_ann, [ANN_BIT, [str(level)]])
        text = self.show(name, value)
        self.put(bits[0][0] - half, bits[-1][0] + half, self.out_ann, [ANN_WORD, [f"{name}={text}", text, name]])
        return value

    def show(self, name, value):
        """T carries a 16-bit code, 4 bits of channel and 4 of status; the others are two's complement."""
        width = self.options["word_bits"]
        if name == "T":
            fields = f" ch{value >> 16 & 15} st{value >> 20 & 15:X}" if width > 16 else ""
            return f"{value & 0xFFFF:04X}h{fields}"
        if self.options["format"] == "hex":
            return f"{value:0{width // 4}X}h"
        return str(value - (1 << width) if value >> (width - 1) else value)

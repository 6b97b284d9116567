"""libsigrokdecode decoder `psabus`; runs in sigrok's own Python, so it needs nothing but the standard library."""

import sigrokdecode as srd

CS, RW, AB, D = 0, 1, 2, 6
ANN_READ, ANN_WRITE, ANN_WARNING = range(3)


class Decoder(srd.Decoder):
    api_version = 3
    id = "psabus"
    name = "PSA bus"
    longname = "Parallel bus of the converter boards"
    desc = "Read and write cycles on the 16-bit bus of PSD-1, PMKA and PIK boards."
    license = "mit"
    inputs = ["logic"]
    outputs = []
    tags = ["Embedded/industrial"]
    channels = (
        {"id": "cs", "name": "CS", "desc": "Strobe of the host, active low"},
        {"id": "rw", "name": "RW", "desc": "High: the host reads"},
        *({"id": f"ab{i}", "name": f"AB{i}", "desc": f"Address, bit {i}"} for i in range(4)),
        *({"id": f"d{i}", "name": f"D{i}", "desc": f"Data, bit {i}"} for i in range(16)),
    )
    options = ({"id": "strobe_ns", "desc": "Shortest strobe in ns, 0: any", "default": 200},)
    annotations = (("read", "Read"), ("write", "Write"), ("warning", "Warning"))
    annotation_rows = (
        ("cycles", "Cycles", (ANN_READ, ANN_WRITE)),
        ("warnings", "Warnings", (ANN_WARNING,)),
    )

    def __init__(self):
        self.samplerate = None

    def reset(self):
        pass

    def metadata(self, key, value):
        if key == srd.SRD_CONF_SAMPLERATE:
            self.samplerate = value

    def start(self):
        self.out_ann = self.register(srd.OUTPUT_ANN)

    def decode(self):
        while True:
            pins = self.wait({CS: "f"})
            began = self.samplenum
            self.wait({CS: "r"})
            self.cycle(began, pins)

    def cycle(self, began, pins):
        address, word = number_at(pins, AB, 4), number_at(pins, D, 16)
        ann, verb = (ANN_READ, "Read") if pins[RW] == 1 else (ANN_WRITE, "Write")
        long, short = f"{verb} {address:X}h: {word:04X}h", f"{address:X}: {word:04X}"
        self.put(began, self.samplenum, self.out_ann, [ann, [long, short, verb[0]]])
        samples, least_ns = self.samplenum - began, self.options["strobe_ns"]
        # An edge is up to one sample before the sample that shows it.
        if self.samplerate and (samples + 1) * 1000000000 <= least_ns * self.samplerate:
            text = f"Strobe: {samples * 1000000000 // self.samplerate} ns, not {least_ns}"
            self.put(began, self.samplenum, self.out_ann, [ANN_WARNING, [text, "Short"]])


def number_at(pins, first, width):
    return sum((pins[first + i] == 1) << i for i in range(width))

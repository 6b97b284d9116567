"""libsigrokdecode decoder `ads128x`."""

from .commands import ANN_COMMAND, Commands, Register

GAP_BYTES = 4  # bytes further apart than this many byte lengths belong to different bursts

CONFIG0 = Register(
    "CONFIG0",
    (0x80, ("pulse sync", "continuous sync")),
    (0x38, {0: "250 SPS", 1: "500 SPS", 2: "1000 SPS", 3: "2000 SPS", 4: "4000 SPS"}),
    (0x04, ("linear phase", "minimum phase")),
    (0x03, ("modulator output", "sinc", "sinc + FIR", "sinc + FIR + HPF")),
)
CONFIG1 = Register(
    "CONFIG1",
    (0x70, {0: "AIN1", 1: "AIN2", 2: "inputs shorted", 3: "AIN1 + AIN2", 4: "short to AINN2"}),
    (0x08, ("chop off", "chop on")),
    (0x07, {n: f"gain {1 << n}" for n in range(7)}),
)


class Decoder(Commands):
    id = "ads128x"
    name = "ADS128x"
    longname = "ADS1281, ADS1282"
    desc = "31-bit delta-sigma converters for geophysics: registers and conversions."
    options = ({"id": "word_bits", "desc": "Bits read per conversion", "default": 24, "values": (24, 32)},)
    registers = (
        Register("ID"), CONFIG0, CONFIG1, Register("HPF0"), Register("HPF1"), Register("OFC0"), Register("OFC1"),
        Register("OFC2"), Register("FSC0"), Register("FSC1"), Register("FSC2"),
    )  # fmt: skip
    opcodes = {
        0x00: "WAKEUP", 0x01: "WAKEUP", 0x02: "STANDBY", 0x03: "STANDBY", 0x04: "SYNC", 0x05: "SYNC", 0x06: "RESET",
        0x07: "RESET", 0x10: "RDATAC", 0x11: "SDATAC", 0x12: "RDATA", 0x60: "OFSCAL", 0x61: "GANCAL",
    }  # fmt: skip
    wreg, rreg, address_mask = 0x40, 0x20, 0x1F
    continuous_at_reset = True

    def word_bits(self):
        return self.options["word_bits"]

    def data_byte(self, mosi, miso):
        """In continuous mode zero bytes clock a word out, if the burst is as long as a word; else they are WAKEUPs."""
        gap = self.last_es is not None and self.ss - self.last_es > GAP_BYTES * (self.es - self.ss)
        if self.word and (gap or mosi != 0):
            for ss, es, _ in self.word:
                self.put(ss, es, self.out_ann, [ANN_COMMAND, ["WAKEUP"]])
            self.word = []
        if mosi != 0 or not self.continuous:
            return False
        self.word.append((self.ss, self.es, miso))
        self.word_done()
        return True

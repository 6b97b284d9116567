"""libsigrokdecode decoder `ads1256`."""

from .commands import Commands, Register

INPUTS = {n: f"AIN{n}" for n in range(8)} | dict.fromkeys(range(8, 16), "AINCOM")
RATES = {
    0xF0: "30000 SPS", 0xE0: "15000 SPS", 0xD0: "7500 SPS", 0xC0: "3750 SPS", 0xB0: "2000 SPS", 0xA1: "1000 SPS",
    0x92: "500 SPS", 0x82: "100 SPS", 0x72: "60 SPS", 0x63: "50 SPS", 0x53: "30 SPS", 0x43: "25 SPS", 0x33: "15 SPS",
    0x23: "10 SPS", 0x13: "5 SPS", 0x03: "2.5 SPS",
}  # fmt: skip  # at 7.68 MHz

STATUS = Register(
    "STATUS",
    (0x08, ("", "LSB first")),
    (0x04, ("auto-calibration off", "auto-calibration on")),
    (0x02, ("buffer off", "buffer on")),
)
MUX = Register(
    "MUX",
    (0xF0, {n: f"+ {name}" for n, name in INPUTS.items()}),
    (0x0F, {n: f"- {name}" for n, name in INPUTS.items()}),
)
ADCON = Register("ADCON", (0x07, {n: f"gain {1 << min(n, 6)}" for n in range(8)}))
DRATE = Register("DRATE", (0xFF, RATES))


class Decoder(Commands):
    id = "ads1256"
    name = "ADS1256"
    longname = "ADS1255, ADS1256"
    desc = "24-bit delta-sigma converters with multiplexer: registers and conversions."
    options = ()
    registers = (
        STATUS, MUX, ADCON, DRATE, Register("IO"), Register("OFC0"), Register("OFC1"), Register("OFC2"),
        Register("FSC0"), Register("FSC1"), Register("FSC2"),
    )  # fmt: skip
    opcodes = {
        0x00: "WAKEUP", 0xFF: "WAKEUP", 0x01: "RDATA", 0x03: "RDATAC", 0x0F: "SDATAC", 0xF0: "SELFCAL",
        0xF1: "SELFOCAL", 0xF2: "SELFGCAL", 0xF3: "SYSOCAL", 0xF4: "SYSGCAL", 0xFC: "SYNC", 0xFD: "STANDBY",
        0xFE: "RESET",
    }  # fmt: skip
    wreg, rreg, address_mask = 0x50, 0x10, 0x0F
    continuous_at_reset = False

    def word_bits(self):
        return 24

    def data_byte(self, mosi, miso):
        """After RDATAC every byte belongs to a word; SDATAC and RESET are still obeyed (datasheet p. 35)."""
        if not self.continuous:
            return False
        if mosi in (0x0F, 0xFE):
            self.word = []
            return False
        self.word.append((self.ss, self.es, miso))
        self.word_done()
        return True

"""Register commands as the ADS128x and ADS125x families share them: opcode, count - 1, then one byte per register.

Libsigrokdecode runs in sigrok's own Python: standard library only.
"""

import sigrokdecode as srd

ANN_COMMAND, ANN_REGISTER, ANN_DATA, ANN_WARNING = range(4)


class Register:
    """Name of a register and the fields worth reading: (mask, what each value of the field means, or None)."""

    def __init__(self, name, *fields):
        self.name = name
        self.fields = fields

    def explain(self, value):
        """The fields in words, "" if the register is a plain number."""
        parts = []
        for mask, meaning in self.fields:
            shift = (mask & -mask).bit_length() - 1
            field = (value & mask) >> shift
            text = meaning.get(field, "reserved") if isinstance(meaning, dict) else meaning[field]
            if text:
                parts.append(text)
        return ", ".join(parts)


class Commands(srd.Decoder):
    """Stacked on `spi`. A family fills in registers, opcodes and masks, and says what data looks like."""

    api_version = 3
    license = "mit"
    inputs = ["spi"]
    outputs = []
    tags = ["IC", "Analog/digital"]
    annotations = (
        ("command", "Command"),
        ("register", "Register"),
        ("data", "Conversion"),
        ("warning", "Warning"),
    )
    annotation_rows = (
        ("commands", "Commands", (ANN_COMMAND,)),
        ("registers", "Registers", (ANN_REGISTER,)),
        ("conversions", "Conversions", (ANN_DATA,)),
        ("warnings", "Warnings", (ANN_WARNING,)),
    )

    registers = ()
    opcodes = {}
    wreg = rreg = address_mask = 0

    def __init__(self):
        self.reset()

    def reset(self):
        self.continuous = self.continuous_at_reset
        self.last_es = None
        self.drop()

    def drop(self):
        """Forgets a command or word that was broken off."""
        self.state = self.command
        self.word = []  # (ss, es, byte) of the conversion word being read

    def start(self):
        self.out_ann = self.register(srd.OUTPUT_ANN)

    def decode(self, ss, es, data):
        kind, mosi, miso = data
        if kind == "CS-CHANGE" and mosi is not None:
            if self.state != self.command:
                self.put(ss, es, self.out_ann, [ANN_WARNING, ["Chip select ended a command", "CS"]])
            self.drop()
        elif kind == "DATA":
            self.ss, self.es = ss, es
            self.state(mosi or 0, miso or 0)
            self.last_es = es

    def say(self, ann, *texts, ss=None):
        self.put(self.ss if ss is None else ss, self.es, self.out_ann, [ann, list(texts)])

    def command(self, mosi, miso):
        """A byte that may begin a command."""
        if self.data_byte(mosi, miso):
            return
        if mosi & ~self.address_mask in (self.wreg, self.rreg):
            self.first_ss, self.opcode = self.ss, mosi
            self.address = mosi & self.address_mask
            self.state = self.count
        else:
            self.one_byte(mosi)

    def one_byte(self, mosi):
        name = self.opcodes.get(mosi)
        if name is None:
            self.say(ANN_WARNING, f"Unknown opcode {mosi:02X}h", "?")
        else:
            self.say(ANN_COMMAND, name)
            self.obey(name)

    def obey(self, name):
        if name in ("RDATAC", "SDATAC"):
            self.continuous = name == "RDATAC"
        elif name == "RESET":
            self.continuous = self.continuous_at_reset
        elif name == "RDATA":
            self.word = []
            self.state = self.requested

    def count(self, mosi, miso):
        self.left = (mosi & 0x1F) + 1
        writing = self.opcode & ~self.address_mask == self.wreg
        verb = "WREG" if writing else "RREG"
        self.say(ANN_COMMAND, f"{verb} {self.address:02X}h x{self.left}", verb, ss=self.first_ss)
        self.state = self.write if writing else self.read

    def write(self, mosi, miso):
        self.one_register(mosi, "=")

    def read(self, mosi, miso):
        self.one_register(miso, "is")

    def one_register(self, value, verb):
        if self.address < len(self.registers):
            reg = self.registers[self.address]
            plain, why = f"{reg.name} {verb} {value:02X}h", reg.explain(value)
            self.say(ANN_REGISTER, *([f"{plain}: {why}"] if why else []), plain, reg.name)
        else:
            self.say(ANN_WARNING, f"No register {self.address:02X}h", "?")
        self.address += 1
        self.left -= 1
        if self.left == 0:
            self.state = self.command

    def requested(self, mosi, miso):
        """A byte of the word that RDATA asked for."""
        self.word.append((self.ss, self.es, miso))
        if self.word_done():
            self.state = self.command

    def word_done(self):
        """Tells the word if it is complete."""
        if len(self.word) * 8 < self.word_bits():
            return False
        value = int.from_bytes([b for _, _, b in self.word], "big", signed=True)
        self.say(ANN_DATA, f"Code {value}", str(value), ss=self.word[0][0])
        self.word = []
        return True

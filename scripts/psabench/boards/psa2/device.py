"""A PSA-2 unit over CAN: registers, stream, state; SI out. Written from docs/reference/protocol.md and the article.

with CanHost(open_bus("socketcand:127.0.0.1:29536"), WallClock()) as host:
    unit = Psa2(host, node_id=5)
    unit.register("x", "CONFIG0")  # of converter X: 0x56
    frames = unit.stream(100)      # 100 samples, volts at the loads
"""

from __future__ import annotations

from psabench.boards.objects import Psa2Objects as OD
from psabench.boards.psa2.frames import Form, FrameReader, Frames
from psabench.boards.unit import Unit
from psabench.errors import LinkError
from psabench.link.protocol_files import message
from psabench.link.signals import layout

OPCODE = {"accel": 1, "temp": 2}  # sub-index of 2010h
CONFIG0 = 0x01

# Output words a second at 4.096 MHz by the DR field of CONFIG0 (converter data sheet).
DATA_HZ = {0: 250, 1: 500, 2: 1000, 3: 2000, 4: 4000}
# Gain at DC of the converter's FIR by the PHASE bit of CONFIG0: the integer taps of its last two stages sum to these,
# over 2^27 (converter data sheet, coefficient table; docs/chips/ads1282.md). Without the FIR (FILTR 1) it is 1.
FIR_GAIN = {0: 134201050 * 134238266 / 2**54, 1: 134259543 * 134198608 / 2**54}
SINC_ONLY = 1
CODE_V, WORD_V = 10.0 / 2**23, 10.0 / 2**30  # resolution at the load: of a code of the stream, of a whole word
SETTLE_PERIODS = 64  # 62.98 data periods and 468 clocks from a step to a settled word, rounded up


def filter_gain_of(config0: int) -> float:
    """Gain at DC of the filter that this value of CONFIG0 selects."""
    return 1.0 if config0 & 3 == SINC_ONLY else FIR_GAIN[config0 >> 2 & 1]


class Psa2(Unit):
    """One unit on the bus.

    Raises DeviceError with the unit's abort code when it rejects, LinkError when it does not answer.
    """

    board = "psa2"
    title = "PSA-2"
    reading_s = 0.004
    frames: FrameReader

    def _reader(self, node_id: int) -> FrameReader:
        return FrameReader(node_id)

    def opcode(self, group: str, code: int) -> None:
        """Send one command byte to the converters of group "accel" or "temp"."""
        self.node.write(OD.OPCODE, OPCODE[group], code)

    @property
    def data_hz(self) -> int:
        """Samples a second, from CONFIG0."""
        return DATA_HZ[self.register("x", CONFIG0) >> 3 & 7]

    @property
    def filter_gain(self) -> float:
        """Gain of the converters' filter at DC, from CONFIG0: known, and in every code and word."""
        return filter_gain_of(self.register("x", CONFIG0))

    @property
    def form(self) -> Form:
        return Form(int(self.node.read(OD.FRAME_FORM)))

    @form.setter
    def form(self, form: Form) -> None:
        self.node.write(OD.FRAME_FORM, 0, int(form))

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """Until the set-up after Res is over: the controller then serves its registers and frames are settled.

        Raises LinkError when the unit is not ready after timeout_s of bench time.
        """
        deadline_s = self.host.clock.now_s() + timeout_s
        while self.host.clock.now_s() < deadline_s:
            self.stop()
            if self.stream(1).settled.all():
                return
        raise LinkError(f"node {self.node.node_id}: frames are not settled after {timeout_s:g} s")

    def stream(self, count: int, timeout_s: float = 5.0) -> Frames:
        """The next `count` samples; the stream runs only meanwhile. Raises LinkError when fewer come in timeout_s."""
        self._gather(count, timeout_s)
        return self.frames.take().head(count)

    def words_v(self) -> tuple[float, float, float]:
        """Volts at the loads X, Y, Z of the latest conversion, from the whole 32-bit words (object 2201h).

        31 significant bits: 9.3 nV a step, where a code of the stream has 1.19 uV. Needs a profile that reads 32 bits.
        """
        x, y, z = (raw_word_v(int(self.node.read(OD.RAW_WORDS, sub))) for sub in (1, 2, 3))
        return x, y, z


def raw_word_v(word: int) -> float:
    """Volts at the load of a whole 32-bit word of object 2201h."""
    full_scale_v = layout(message("PSA2_XY"))["X"].scale * 2**23
    return word / 2**31 * full_scale_v

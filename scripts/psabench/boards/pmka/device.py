"""A PMKA unit over CAN: codes, resets and rotation of its integrators, its correction ROM, its program of calibration.

Written from docs/reference/protocol_pmka.md.
"""

from __future__ import annotations

from psabench.boards.readings import ReadingLayout
from psabench.boards.unit import BusUnit

ROM_INDEX, ROM_HEAD, ROM_ROW, INTEGRATORS = 0x100, 6, 3, 4


class Pmka(BusUnit):
    """One unit on the bus."""

    board = "pmka"
    title = "PMKA"
    layout = ReadingLayout(board="pmka", messages=("PMKA_CODES", "PMKA_STATE"), counter="SEQ")

    def _address(self, name: str) -> int:
        return next(address for address, called in self.registers("bus").items() if called == name)

    def rom_words(self) -> list[int]:
        """All words of the correction ROM, for estimate.pmka.rom_of(). Several hundred bus cycles."""
        index, data = self._address("INDEX"), self._address("DATA")

        def word(w: int) -> int:
            self.bus_write(index, ROM_INDEX + w)
            return self.bus_read(data)

        head = [word(w) for w in range(ROM_HEAD)]
        return head + [word(ROM_HEAD + w) for w in range(INTEGRATORS * ROM_ROW * head[2] + 1)]

    def autonomous(self, on: bool, *, beat: int | None = None, zero: int | None = None) -> None:
        """Whether the unit turns the calibration itself, in beats of `beat` Ts, `zero` of them for the zero."""
        longer_first = (("BEAT", beat), ("ZERO", zero))
        if beat is not None and zero is not None and beat < self.bus_read(self._address("BEAT")):
            longer_first = (("ZERO", zero), ("BEAT", beat))
        for name, value in longer_first:
            if value is not None:
                self.bus_write(self._address(name), value)
        self.bus_write(self._address("MODE"), int(on))

    def command(self, tau: int = 0, *, cal: int = 0) -> None:
        """The next beat tau 1..5 (0: the present one goes on), and calibration 0 none, 1 zero, 2 resets."""
        self.bus_write(self._address("COMMAND"), tau | cal << 4)

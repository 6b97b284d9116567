"""Recording: what is counted is what is in the file, wherever Ctrl-C falls."""

import os
import signal
from pathlib import Path

import can
import pytest
from psabench.link import record as module
from psabench.link.log_file import LogFile
from psabench.link.record import record


class Endless(can.BusABC):
    """A bus that always has a frame."""

    def __init__(self) -> None:
        super().__init__(channel=0)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return can.Message(arbitration_id=0x123, data=b"12345678", is_extended_id=False, timestamp=1.0), True

    def send(self, msg: can.Message, timeout: float | None = None) -> None: ...


@pytest.mark.parametrize("ending", [".log", ".blf", ".asc"])
@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_falls_between_two_messages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, when: str, ending: str, number: signal.Signals
) -> None:
    path = tmp_path / f"bus{ending}"
    written = 0

    class Interrupted(LogFile):
        def __call__(self, m: can.Message) -> bool:
            nonlocal written
            written += 1
            if when == "before" and written == 3:
                os.kill(os.getpid(), number)
            stored = super().__call__(m)
            if when == "after" and written == 3:
                os.kill(os.getpid(), number)
            return stored

    monkeypatch.setattr(module, "LogFile", Interrupted)

    def unnoted(*_: object) -> None:
        raise AssertionError("the signal did not only end the recording")

    before = signal.signal(number, unnoted)
    try:
        recorded = record(Endless(), path, node=5, for_s=10.0, count=None)
        assert signal.getsignal(number) is unnoted
    finally:
        signal.signal(number, before)
    with can.LogReader(path) as logged:
        assert len(list(logged)) == recorded.stored == 3

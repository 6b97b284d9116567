"""Sentences of a satellite receiver, read as from any serial port: docs/boards/receiver.md."""

import pynmea2
import serial
from psabench.bench import Bench

with (
    Bench.start("receiver", extra=["--serial", "build/gps"]) as bench,
    serial.Serial("build/gps", 9600, timeout=10) as port,
):
    bench.run_for(0.5)
    for _ in range(3):
        bench.run_for(1.0)  # in wall pace (pace="wall") time moves by itself
        fix = pynmea2.parse(port.read_until(b"\r\n").decode())
        print(f"{fix.timestamp:%H:%M:%S} {fix.latitude:.5f} N {fix.longitude:.5f} E, {int(fix.num_sats)} satellites")

"""An ADS1282 that watches a 5 Hz sine: 32 bits at each fall of DRDY. With the name of a file every edge is recorded
for PulseView or GTKWave: python read_ads1282.py run.vcd"""

import math
import sys

from psabench.chips import Bench, ads1282_volts


def sine_v(number: int, t_ns: int) -> float:
    """Voltage at input `number` (0: AIN1), asked for at the instants at which the modulator samples."""
    return 1.5 * math.sin(2 * math.pi * 5.0 * t_ns * 1e-9)


with Bench(seed=1) as bench:
    adc = bench.part("ads1282", vref_v=5.0)
    adc.set_input(sine_v)
    if len(sys.argv) > 1:
        bench.vcd(sys.argv[1])
    print(f"CONFIG0 {adc.peek(1):02X}h: 1000 words a second, FIR filter")
    for n in range(100):
        adc.run_until_level("DRDY", 0)  # after a reset the chip is in RDATAC: the word is there
        word = int.from_bytes(adc.spi(bytes(4)), "big", signed=True)
        if n % 25 == 0:
            print(f"{bench.now_ns / 1e6:8.3f} ms  {ads1282_volts(word, vref_v=5.0):8.5f} V")
    print({name: count for name, count in adc.counters.items() if count})

"""pipyadc 2.1, the Raspberry Pi driver of the ADS1256 from PyPI, unmodified, without a Pi and without a chip."""

import pigpio_shim
from psabench.chips import Bench

with Bench(seed=1) as bench:
    chip = bench.part("ads1256", vref_v=2.5, strict_timing=True)  # a read that comes too early is garbled
    for channel in range(8):
        chip.set_volts(channel, 0.25 * channel)

    # The wires of the Waveshare board, which the driver's own configuration describes.
    pi = pigpio_shim.Pi(chip, {17: "DRDY", 18: "RESET", 22: "CS", 27: "SYNC"})
    pipyadc = pigpio_shim.load("pipyadc", pi)

    with pipyadc.ADS1256() as ads:
        print("ID", ads.chip_ID)
        ads.drate = 0xA1  # 1000 SPS
        ads.cal_self()
        print("offset", ads.ofc, "full scale", hex(ads.fsc))
        channels = [(n << 4) | 8 for n in range(8)]  # AINn against AINCOM
        for code in ads.read_sequence(channels):
            print(f"{code * ads.v_per_digit:9.6f} V")
    print(f"{bench.now_ns * 1e-9:.3f} s simulated")

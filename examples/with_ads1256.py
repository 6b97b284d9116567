"""ads1256 0.2.0, a driver of the ADS1256 from PyPI for Linux's spidev and gpiod, unmodified, without either."""

import spidev_shim
from psabench.chips import Bench

WIRING = {22: "DRDY", 27: "SYNC", 21: "CS"}  # the driver's defaults

with Bench(seed=1) as bench:
    chip = bench.part("ads1256", vref_v=2.5, strict_timing=True)  # a read that comes too early is garbled
    chip.set_volts(0, 1.25)

    driver = spidev_shim.load("ads1256.ads1256", spidev_shim.Machine(chip, WIRING))
    adc = driver.ADS1256()
    adc.set_data_rate(driver.ADSC.DRATE_1000)
    adc.self_calibration()
    adc.set_input(driver.ADSC.POS_AIN0, driver.ADSC.NEG_AINCOM)
    adc.sync()
    print("ID", adc.read_chip_id())
    print(f"{adc.read_voltage():.5f} V")
    print(f"{bench.now_ns * 1e-9:.4f} s simulated")

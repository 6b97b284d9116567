"""An ADS1256 read the way a driver does it: wait for DRDY, RDATA, three bytes."""

from psabench.chips import Bench, ads1256_volts

RDATA = b"\x01"
T6_S = 50 / 7.68e6  # from the command to the first bit of data

with Bench(seed=1) as bench:
    adc = bench.part("ads1256", vref_v=2.5)
    adc.set_volts(0, 1.25)  # AIN0; AIN1 stays at 0 V, and the chip starts with AIN0 - AIN1 selected
    adc.run_until_level("DRDY", 0)  # the self-calibration after power-up is over
    print(f"ready after {bench.now_ns / 1e6:.3f} ms")

    adc.pins["CS"].set(0)
    for _ in range(3):
        adc.run_until_level("DRDY", 0)
        adc.spi(RDATA)
        bench.run_for(T6_S)
        code = int.from_bytes(adc.spi(bytes(3)), "big", signed=True)
        print(f"code {code:7d}: {ads1256_volts(code, vref_v=2.5):.6f} V")

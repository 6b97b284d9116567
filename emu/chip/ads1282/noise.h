/* Published noise of the ADS1281 / ADS1282. Sources 1.9. Pure. */
#ifndef PSABENCH_CHIP_ADS1282_NOISE_H
#define PSABENCH_CHIP_ADS1282_NOISE_H

/* Output noise of the FIR modes in volts rms at the input; rate 0..4 (250..4000 words/s), pga_log2 0..6. From the SNR of a
 * full-scale sine at VREF 5 V; with another reference the volts stay: they are thermal (E0). */
double ads1282_noise_v(unsigned rate, unsigned pga_log2);

#endif

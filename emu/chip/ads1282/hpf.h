/* One-pole high-pass of the ADS1281 / ADS1282 (FILTR = 11), the last filter of the chain. Sources 1.7.
 *
 * With a = HPF[1:0] / 65536: H(z) = (2 - a)/2 (1 - z^-1)/(1 - b z^-1), b = (1 + (1 - a)^2)/2; for a corner fHP the data
 * sheet gives a = 1 - sqrt(1 - 2c), c = (cos w + sin w - 1)/cos w, w = 2 pi fHP/fDATA. Both factors are whole numbers of
 * 2^-17 and 2^-33: the arithmetic here is exact but for one rounding a word to 2^-20 LSB (E0: the chip's own width is not
 * known). Pure but for the state. */
#ifndef PSABENCH_CHIP_ADS1282_HPF_H
#define PSABENCH_CHIP_ADS1282_HPF_H

#include <stdint.h>

struct ads1282_hpf {
    int64_t x; /* last input */
    int64_t y; /* last output, in 2^-20 */
};

/* Forgets the past. */
void ads1282_hpf_clear(struct ads1282_hpf *h);

/* One word, |x| < 2^33; hpf is the register pair. Returns the output rounded to nearest. */
int64_t ads1282_hpf_step(struct ads1282_hpf *h, int64_t x, uint16_t hpf);

#endif

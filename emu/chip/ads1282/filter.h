/* Signal path of the ADS1281 / ADS1282 behind the modulator: sinc5, four FIR stages, OFC/FSC, output word.
 *
 * Bit-true in integers; pure but for the delay lines in the caller's struct; equal on every machine. The modulator is
 * ideal and its input is held over one sinc block (N modulator clocks), so that a block enters the fifth-order sinc as
 * five integer weights: exactly what the sinc at the modulator rate gives for the held input (proved by test).
 *
 * Word widths between the stages are not published; ours (E0) lose less than a quarter of the output's last bit and stay
 * inside int64 for any input up to ADS1282_SATURATION. Full scale in LSB: input block 2^34, after sinc, stages 1 and 2
 * 2^34, after stage 3 2^33, output 2^30; each rounded to nearest. Sources 1.7, 1.8. */
#ifndef PSABENCH_CHIP_ADS1282_FILTER_H
#define PSABENCH_CHIP_ADS1282_FILTER_H

#include "chip/ads1282/fir.h"

#include <stdbool.h>
#include <stdint.h>

#define ADS1282_BLOCKS     32u                /* sinc blocks in a data period: the stages decimate 2, 2, 4, 2 */
#define ADS1282_BLOCK_LOG2 34u                /* input full scale: 2^34 */
#define ADS1282_FS_LSB     (INT64_C(1) << 30) /* full scale of the 31-bit result */
#define ADS1282_SATURATION 1.06               /* of full scale; the modulator clips there (103..106 %, E1/M70) */
#define ADS1282_SINC_TAPS  5

enum ads1282_phase { ADS1282_LINEAR, ADS1282_MINIMUM };

/* A delay line holds the taps - 1 newest samples of the past, then those of the present data period. */
struct ads1282_filter {
    unsigned sinc_ratio; /* N: 8, 16, 32, 64, 128 */
    enum ads1282_phase phase;
    int32_t sinc_tap[ADS1282_SINC_TAPS];
    double noise_gain;
    int64_t sinc[4 + 32], fir1[10 + 32], fir2[14 + 16], fir3[52 + 8], fir4[108 + 2];
};

/* Chooses the decimation and clears the past. */
void ads1282_filter_init(struct ads1282_filter *f, unsigned sinc_ratio, enum ads1282_phase phase);

/* Forgets the past, as a synchronisation does. */
void ads1282_filter_clear(struct ads1282_filter *f);

/* One data period: 32 blocks in, oldest first, one result out, in LSB of ADS1282_FS_LSB, not clipped. The result depends
 * on the last 1971 (linear) or 1963 (minimum phase) blocks, those given here included. */
int64_t ads1282_filter_period(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS]);

/* Its two halves, one in place of the other and not mixed with it: the sinc alone (the sinc-only mode), 32 outputs of full
 * scale 2^34; and the FIR stages alone, from 32 sinc outputs got elsewhere (the bit-true modulator). */
void ads1282_filter_sinc(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS], int64_t out[ADS1282_BLOCKS]);
int64_t ads1282_filter_fir(struct ads1282_filter *f, const int64_t sinc[ADS1282_BLOCKS]);

/* Output rms for white input blocks of unit rms, both in units of full scale: sqrt of the sum of squares of the composite
 * impulse response of the exact chain. */
double ads1282_filter_noise_gain(const struct ads1282_filter *f);

/* The five weights of a held block, divided by N (they all are multiples of it); newest first; their sum is N^4. */
void ads1282_sinc_taps(unsigned sinc_ratio, int32_t tap[ADS1282_SINC_TAPS]);

/* Offset and gain correction, data sheet eq. 7: (y - OFC/2 LSB) FSC / 400000h, OFC in its own LSB of 2^-23 full scale,
 * rounded to nearest, not clipped. |y| < 2^33. */
int64_t ads1282_correct(int64_t y_lsb, int32_t ofc, uint32_t fsc);

/* Output word of the FIR modes: 31 bits left-justified, bit 0 repeats the sign unless clipped. */
uint32_t ads1282_word(int64_t y_lsb, bool *clipped);

#endif

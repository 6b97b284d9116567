#include "chip/ads1282/noise.h"

#include "base/detmath.h"

#include <stdint.h>

/* SNR in dB by rate and gain, chopping on. Column 1: E2 for 250 and 500 words/s, M90 below; other columns M60. */
// clang-format off
static const uint8_t snr_db[5][7] = {
    {130, 130, 129, 128, 125, 119, 114},
    {127, 127, 126, 125, 122, 116, 111},
    {124, 124, 123, 122, 119, 113, 108},
    {121, 121, 120, 119, 116, 110, 105},
    {118, 118, 117, 115, 112, 107, 101},
};
// clang-format on

double ads1282_noise_v(unsigned rate, unsigned pga_log2)
{
    const double fs_rms_v = 2.5 / (1 << pga_log2) * 0.70710678118654752440;
    return fs_rms_v * det_exp(-0.11512925464970228420 * snr_db[rate][pga_log2]);
}

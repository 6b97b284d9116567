/* Published coefficients of the four FIR stages of the ADS1281 / ADS1282. Constant data.
 *
 * Sources 1.8. Stages 1 and 2 and the linear-phase sets: E2 (coefficient tables of the ADS1283/85/87 data
 * sheets, same filter; complete in a published response tool). Minimum-phase sets: rows b0..b14 E2, the rest E3 (checked
 * by stop band and group delay to about 10 counts). */
#ifndef PSABENCH_CHIP_ADS1282_FIR_H
#define PSABENCH_CHIP_ADS1282_FIR_H

#include <stdint.h>

enum { ADS1282_FIR_STAGES = 4 };

struct ads1282_fir {
    const int32_t *tap; /* tap[0] weighs the newest sample */
    unsigned taps, decim;
    unsigned scale_log2; /* the published scale is 2^-scale_log2 */
};

extern const struct ads1282_fir ads1282_fir[2][ADS1282_FIR_STAGES]; /* [enum ads1282_phase][stage] */

#endif

/* One data period through sinc5 and the four FIR stages: the same sums of integers twice, plain and with AVX2, so that
 * the words are equal wherever they are computed. Private to ads1282/filter.c and its tests.
 *
 * Stages 1 and 2 are symmetric and have every second tap zero but the middle one, in both phases. */
#ifndef PSABENCH_CHIP_ADS1282_DECIMATE_H
#define PSABENCH_CHIP_ADS1282_DECIMATE_H

#include "chip/ads1282/filter.h"

#include <string.h>

/* Bits dropped after stages 1..4: the published scale, and 1 and 3 bits of word width after stages 3 and 4. */
enum { ADS1282_SHIFT_1 = 9, ADS1282_SHIFT_2 = 23, ADS1282_SHIFT_3 = 28, ADS1282_SHIFT_4 = 30 };

struct ads1282_decimator {
    int64_t (*period)(struct ads1282_filter *f, const int64_t block[ADS1282_BLOCKS]); /* as ads1282_filter_period() */
    int64_t (*fir)(struct ads1282_filter *f, const int64_t sinc[ADS1282_BLOCKS]);     /* as ads1282_filter_fir() */
};

extern const struct ads1282_decimator ads1282_plain;
const struct ads1282_decimator *ads1282_avx2(void);      /* NULL where the machine has none */
const struct ads1282_decimator *ads1282_decimator(void); /* the quickest here */

/* Windows of the present data period: the samples of the past, then room for its own. */
static inline int64_t *ads1282_window_3(struct ads1282_filter *f)
{
    return f->fir3 + 8 * f->wandered;
}

static inline int64_t *ads1282_window_4(struct ads1282_filter *f)
{
    return f->fir4 + 2 * f->wandered;
}

/* At the end of a data period: its samples become the past. */
static inline void ads1282_next_period(struct ads1282_filter *f)
{
    memcpy(f->odd1, f->odd1 + 16, 5 * sizeof *f->odd1);
    memcpy(f->even1, f->even1 + 16, 2 * sizeof *f->even1);
    memmove(f->odd2, f->odd2 + 8, 7 * sizeof *f->odd2);
    memcpy(f->even2, f->even2 + 8, 3 * sizeof *f->even2);
    if (++f->wandered < ADS1282_WANDER) return;
    memmove(f->fir3, f->fir3 + 8 * ADS1282_WANDER, (ADS1282_WINDOW_3 - 4) * sizeof *f->fir3);
    memmove(f->fir4, f->fir4 + 2 * ADS1282_WANDER, (ADS1282_WINDOW_4 - 2) * sizeof *f->fir4);
    memmove(f->high3, f->high3 + 8 * ADS1282_WANDER, (ADS1282_WINDOW_3 - 4) * sizeof *f->high3);
    memmove(f->high4, f->high4 + 2 * ADS1282_WANDER, (ADS1282_WINDOW_4 - 2) * sizeof *f->high4);
    f->wandered = 0;
}

#endif

/* Conversion column of the ADS1255/ADS1256, between ads1256.c (commands and pins) and ads1256_filter.c (arithmetic).
 *
 * A run is a row of conversions on one time grid: it begins at a CLKIN edge, DRDY falls t18 later and then every data
 * period. A calibration is a wait whose end begins a run. Internal to the chip: nobody else includes it. */
#ifndef PSABENCH_CHIP_ADS1256_CONV_H
#define PSABENCH_CHIP_ADS1256_CONV_H

#include "chip/ads1256.h"

static inline uint8_t ads1256_value(const struct ads1256 *a, enum ads1256_reg r)
{
    return a->value[r];
}

static inline unsigned ads1256_pga_log2(const struct ads1256 *a)
{
    return ads1256_gain_log2(a->value[ADS1256_ADCON] & ADS1256_ADCON_PGA);
}

static inline int64_t ads1256_tau_ns(const struct ads1256 *a, int64_t tau)
{
    return clk_span_ns(a->clkin.hz, tau);
}

void ads1256_conv_init(struct ads1256 *a);

/* Moves the pin and the DRDY bit of STATUS. */
void ads1256_set_drdy(struct ads1256 *a, bool level, int64_t t_ns);

/* Stops whatever runs; DRDY goes high. */
void ads1256_halt(struct ads1256 *a, enum ads1256_mode mode, int64_t t_ns);

/* A new run from the first CLKIN edge at or after t_ns. */
void ads1256_restart(struct ads1256 *a, int64_t t_ns);

/* DRDY high, measure, store OFC and FSC, settle, DRDY low after the printed duration. */
void ads1256_calibrate(struct ads1256 *a, enum ads1256_cal kind, int64_t t_ns);

#endif

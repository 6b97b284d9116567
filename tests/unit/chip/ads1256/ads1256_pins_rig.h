/* An ADS1256 with everything that it can tell and ask for, and SPI bytes over its pins. */
#ifndef PSABENCH_TESTS_ADS1256_PINS_RIG_H
#define PSABENCH_TESTS_ADS1256_PINS_RIG_H

#include "ads1256_rig.h"

static inline double source_ohm(void *ctx, unsigned ain, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->ohm[ain];
}

static inline void on_gpio(void *ctx, unsigned d, bool level, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_equal(t_ns, r->s.now_ns);
    r->gpio[d] = level;
    r->gpio_calls++;
}

static inline void on_dout(void *ctx, bool level, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    assert_true(level != r->dout);
    r->dout = level;
    r->dout_calls++;
}

static inline void power_up_all(struct rig *r, const struct ads1256_cfg *cfg)
{
    const struct ads1256_io io = {
        .ain_v = ain_v, .source_ohm = source_ohm, .drdy = on_drdy, .dout = on_dout, .gpio = on_gpio};
    power_up_io(r, cfg, io, 1);
}

/* The same byte over the pins; a master of mode 1 moves DIN with the rising edge and looks at DOUT before the falling one. */
static inline uint8_t pin_xfer(struct rig *r, uint8_t mosi)
{
    uint8_t miso = 0;
    wait_ns(r, FIRST_NS);
    for (int b = 7; b >= 0; b--) {
        ads1256_din_pin(&r->a, mosi >> b & 1, r->s.now_ns);
        ads1256_sclk_pin(&r->a, true, r->s.now_ns);
        wait_ns(r, HIGH_NS);
        miso = (uint8_t)(miso << 1 | ads1256_dout(&r->a));
        ads1256_sclk_pin(&r->a, false, r->s.now_ns);
        if (b > 0) wait_ns(r, SCLK_NS - HIGH_NS);
    }
    return miso;
}

#endif

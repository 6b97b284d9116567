#include "chip/ad7712/ad7712.h"

#include "chip/ad7712/internal.h"

#include <assert.h>

static void judge_control(struct ad7712 *a)
{
    const unsigned fs = a->control & AD7712_CTL_FS;
    a->n.bad_fs += ad7712_code_of(fs) != fs;
    a->n.bad_bit += a->cfg.part == AD7712_PART_7712 && (a->control & AD7712_CTL_B14);
}

void ad7712_load_control(struct ad7712 *a, uint32_t control, int64_t t_ns)
{
    ad7712_sample_until(a, t_ns);
    const uint32_t was = a->control;
    a->control = control;
    judge_control(a);
    ad7712_follow_pins(a, t_ns);
    if (a->state != AD7712_RUNNING || (was & ~control & AD7712_CTL_PD)) return;
    if (ad7712_must_restart(a, was)) ad7712_restart(a, t_ns);
    else if ((was ^ control) & (AD7712_CTL_G | AD7712_CTL_CH)) ad7712_set_path(a);
}

static enum ad7712_state state_of(const struct ad7712 *a)
{
    if (!a->port.standby || (a->control & AD7712_CTL_PD)) return AD7712_DOWN;
    return a->port.sync || a->fault.lost_sync ? AD7712_RUNNING : AD7712_SYNC_LOW;
}

void ad7712_follow_pins(struct ad7712 *a, int64_t t_ns)
{
    if (a->state == AD7712_OFF) return;
    const enum ad7712_state want = state_of(a);
    if (want == a->state) return;
    a->n.power_downs += want == AD7712_DOWN;
    if (want == AD7712_RUNNING) ad7712_start(a, t_ns);
    else ad7712_freeze(a, want, t_ns);
}

void ad7712_init(struct ad7712 *a, const struct ad7712_cfg *cfg, const struct ad7712_io *io, struct sched *s,
                 struct draws noise)
{
    assert(cfg->clkin_hz >= 400000 && cfg->clkin_hz <= 10000000 && cfg->vref_v > 0.0);
    assert((cfg->cells_max & (cfg->cells_max - 1)) == 0 && cfg->cells_max <= AD7712_CELLS_MAX);
    *a = (struct ad7712){.cfg = *cfg, .io = *io, .sched = s, .noise = noise, .control = AD7712_CTL_RESET, .drdy = true};
    a->clkin = (struct clk){.hz = cfg->clkin_hz, .div = 1};
    ad7712_port_init(a);
    ad7712_pins_init(a);
    ad7712_conv_init(a);
}

static void reset_registers(struct ad7712 *a, int64_t t_ns)
{
    ad7712_freeze(a, AD7712_OFF, t_ns);
    ad7712_port_forget(a, t_ns);
    a->control = AD7712_CTL_RESET;
    a->word = 0;
    for (unsigned c = 0; c < AD7712_CHANNELS; c++) {
        a->zero[c] = AD7712_ZERO_IDEAL;
        a->full[c] = AD7712_FULL_IDEAL;
    }
}

void ad7712_power_up(struct ad7712 *a, int64_t t_ns)
{
    reset_registers(a, t_ns);
    a->state = AD7712_DOWN; /* until the pins say otherwise, at once */
    ad7712_follow_pins(a, t_ns);
}

void ad7712_power_off(struct ad7712 *a, int64_t t_ns)
{
    reset_registers(a, t_ns);
}

void ad7712_sync_pin(struct ad7712 *a, bool level, int64_t t_ns)
{
    a->port.sync = level;
    ad7712_follow_pins(a, t_ns);
}

/* What is under way on the serial port is lost: the chip is deaf from here on. */
void ad7712_standby_pin(struct ad7712 *a, bool level, int64_t t_ns)
{
    if (level == a->port.standby) return;
    a->port.standby = level;
    if (!level) ad7712_port_forget(a, t_ns);
    ad7712_follow_pins(a, t_ns);
}

bool ad7712_drdy(const struct ad7712 *a)
{
    return chip_fault_level(a->fault.drdy, a->drdy);
}

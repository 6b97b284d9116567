#include "board/psa2/internal.h"

#define WREG_MUX 0x51
#define RDATA    0x01
#define AINCOM   0x08
#define T6_TAU   50 /* command to data, sources 2.4 */
#define KELVIN   273.15
#define SENSORS  4u

uint8_t psa2_temp_mux(unsigned channel)
{
    return (uint8_t)(channel << 4 | AINCOM);
}

/* A current proportional to absolute temperature on the load RTD: unipolar volts (E0, as an AD590 would give). */
double psa2_temp_v(const struct psa2 *b, double temp_degc)
{
    return b->profile.temp_sensor_a_per_k * (temp_degc + KELVIN) * b->profile.temp_load_ohm;
}

double psa2_temp_ain_v(void *ctx, unsigned ain, int64_t t_ns)
{
    const struct psa2 *b = ctx;
    if (ain >= SENSORS || ain >= b->profile.temp_channels) return 0.0;
    if (b->open_temps >> ain & 1) return 0.0; /* no current: the load alone holds the input at AINCOM */
    return psa2_temp_v(b, b->base.io.temp_degc(b->base.io.ctx, ain, t_ns));
}

void psa2_temp_await(struct psa2 *b, int64_t t_ns)
{
    sched_at(b->base.sched, &b->temp.timeout, t_ns + PSA2_TIMEOUT_NS + 4 * ads1256_settle_ns(&b->tadc));
}

void psa2_temp_timeout(struct psa2 *b, int64_t t_ns)
{
    b->counters.timeouts++;
    if (!b->temp.fault_notified && b->host.fault) b->host.fault(b->host.ctx, PSA2_FAULT_TEMP_PORT, t_ns);
    b->temp.fault_notified = true;
    b->temp.hold = false;
    b->temp.stage = PSA2_SCAN_MUX;
}

void psa2_temp_restart(struct psa2 *b)
{
    const struct sched_ev timeout = b->temp.timeout;
    b->temp = (struct psa2_temp){.timeout = timeout};
    sched_cancel(b->base.sched, &b->temp.timeout);
}

static void wait_conversion(struct psa2 *b, int64_t t_ns)
{
    b->temp.stage = PSA2_SCAN_WAIT;
    psa2_temp_await(b, t_ns);
}

static void mux_written(struct psa2 *b, int64_t t_ns)
{
    b->temp.stage = PSA2_SCAN_SYNC;
    psa2_pulse(b, PSA2_TEMP, wait_conversion, t_ns);
}

static void read_done(struct psa2 *b, int64_t t_ns)
{
    (void)t_ns;
    struct psa2_temp *m = &b->temp;
    m->code = (uint16_t)(b->spi.rx[3][1] << 8 | b->spi.rx[3][2]);
    m->code_channel = m->channel;
    m->fresh = true;
    m->channel = (uint8_t)((m->channel + 1u) % b->profile.temp_channels);
    m->stage = PSA2_SCAN_MUX;
}

/* KPSA keeps a burst out of the way of the next DRD_A; the profile without gates shows what happens if it does not. */
static bool may_start(const struct psa2 *b, const struct psa2_xfer *x, int64_t t_ns)
{
    return !b->profile.gate_sclk || psa2_window(b, psa2_spi_span_ns(b, &b->spi.past, x, t_ns), t_ns);
}

struct psa2_xfer psa2_temp_write_mux(const struct psa2 *b, unsigned channel)
{
    const uint8_t bytes[] = {WREG_MUX, 0x00, psa2_temp_mux(channel)};
    struct psa2_xfer x = psa2_xfer_temp(b, bytes, sizeof bytes);
    x.done = mux_written;
    return x;
}

struct psa2_xfer psa2_temp_read_data(const struct psa2 *b)
{
    static const uint8_t bytes[] = {RDATA, 0x00, 0x00, 0x00};
    struct psa2_xfer x = psa2_xfer_temp(b, bytes, sizeof bytes);
    x.gap_ns[0] = psa2_tau_ns(b, T6_TAU);
    x.done = read_done;
    return x;
}

bool psa2_temp_start(struct psa2 *b, int64_t t_ns)
{
    const struct psa2_temp *m = &b->temp;
    if (b->profile.temp_channels == 0 || m->hold) return false;
    if (m->stage != PSA2_SCAN_MUX && m->stage != PSA2_SCAN_READ) return false;
    const struct psa2_xfer x = m->stage == PSA2_SCAN_READ ? psa2_temp_read_data(b) : psa2_temp_write_mux(b, m->channel);
    if (!may_start(b, &x, t_ns)) return false;
    psa2_spi_start(b, &x, t_ns);
    return true;
}

void psa2_temp_answered(struct psa2 *b)
{
    b->temp.hold = b->temp.fault_notified = false;
    sched_cancel(b->base.sched, &b->temp.timeout);
}

void psa2_temp_ready(struct psa2 *b)
{
    if (b->temp.stage == PSA2_SCAN_WAIT) b->temp.stage = PSA2_SCAN_READ;
    psa2_temp_answered(b);
}

void psa2_temp_disturbed(struct psa2 *b, int64_t t_ns)
{
    b->temp.hold = true;
    b->temp.stage = PSA2_SCAN_MUX;
    psa2_temp_await(b, t_ns);
}

bool psa2_temp_free(const struct psa2 *b)
{
    return !b->temp.hold && (b->temp.stage == PSA2_SCAN_MUX || b->temp.stage == PSA2_SCAN_READ);
}

#include "api/internal.h"

#include "base/clk.h"

enum { SCLK_HZ_MAX = 50000000 };

#define GAP_NS_MAX INT64_C(1000000000)

/* One exchange: half periods of SCLK are counted from its beginning, so that no rounding adds up. */
struct burst {
    struct psabench_part *p;
    struct clk half;
    int64_t offset_ns; /* of the gaps so far */
};

static void to_half(struct burst *u, int64_t half)
{
    api_move(u->p->bench, clk_edge_ns(&u->half, half) + u->offset_ns);
}

static void drive_pin(struct burst *u, unsigned pin, bool level)
{
    api_drive(u->p, pin, level);
    api_notify(u->p->bench);
}

static bool read_dout(const struct burst *u)
{
    const struct api_pin *row = &u->p->kind->pins[u->p->dout];
    return row->get(u->p, row->arg);
}

/* SCLK rests low, rises in the middle of a bit's period and falls at its end. Mode 0: DIN is there half a period before the
 * rise that samples both lines. Mode 1: DIN changes with the rise, the fall samples. */
static bool exchange_bit(struct burst *u, int64_t half, bool mosi)
{
    const bool mode0 = u->p->kind->spi == API_SPI_MODE0;
    bool miso = false;
    to_half(u, half);
    if (mode0) drive_pin(u, u->p->din, mosi);
    to_half(u, half + 1);
    if (mode0) miso = read_dout(u);
    drive_pin(u, u->p->sclk, true);
    if (!mode0) drive_pin(u, u->p->din, mosi);
    to_half(u, half + 2);
    if (!mode0) miso = read_dout(u);
    drive_pin(u, u->p->sclk, false);
    return miso;
}

static uint8_t exchange_byte(struct burst *u, int64_t half, uint8_t mosi)
{
    uint8_t miso = 0;
    for (int i = 0; i < 8; i++) miso = (uint8_t)(miso << 1 | exchange_bit(u, half + 2 * i, mosi >> (7 - i) & 1));
    return miso;
}

static int check_exchange(psabench_part *p, size_t n)
{
    psabench *b = p->bench;
    if (p->kind->spi == API_NO_SPI)
        return api_fail(b, PSABENCH_NOT_HERE, "%s: expected a part with an SPI port, got %s", p->name, p->kind->name);
    const int may = api_may_move(b, "psabench_spi()");
    if (may) return may;
    if (p->level >> p->sclk & 1)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: psabench_spi(): expected SCLK low, got high", p->name);
    const int late = api_late(b);
    if (late) return late;
    const int64_t byte_ns = clk_span_ns(p->sclk_hz, 8) + 1 + p->gap_ns;
    if (n > (uint64_t)((API_TIME_MAX_NS - b->sched.now_ns) / byte_ns))
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: expected fewer bytes (they end after the last time), got %zu",
                        p->name, n);
    return PSABENCH_OK;
}

int psabench_spi(psabench_part *p, const uint8_t *tx, uint8_t *rx, size_t n)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    const int bad = check_exchange(p, n);
    if (bad) return bad;
    struct burst u = {.p = p, .half = {.t0_ns = p->bench->sched.now_ns, .hz = 2 * (int64_t)p->sclk_hz, .div = 1}};
    p->bench->inside++;
    for (size_t i = 0; i < n; i++) {
        const uint8_t miso = exchange_byte(&u, 16 * (int64_t)i, tx ? tx[i] : 0);
        if (rx) rx[i] = miso;
        u.offset_ns += p->gap_ns;
    }
    p->bench->inside--;
    api_serve(p->bench);
    return PSABENCH_OK;
}

int psabench_spi_clock(psabench_part *p, uint32_t sclk_hz, int64_t gap_ns)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    if (p->kind->spi == API_NO_SPI)
        return api_fail(p->bench, PSABENCH_NOT_HERE, "%s: expected a part with an SPI port, got %s", p->name,
                        p->kind->name);
    if (sclk_hz < 1 || sclk_hz > SCLK_HZ_MAX || gap_ns < 0 || gap_ns > GAP_NS_MAX)
        return api_fail(p->bench, PSABENCH_BAD_ARGUMENT,
                        "%s: expected SCLK of 1 to %d Hz and a gap of 0 to %lld ns, got %lu Hz and %lld ns", p->name,
                        SCLK_HZ_MAX, (long long)GAP_NS_MAX, (unsigned long)sclk_hz, (long long)gap_ns);
    p->sclk_hz = sclk_hz;
    p->gap_ns = gap_ns;
    return PSABENCH_OK;
}

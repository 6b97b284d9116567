#include "board/psa2/internal.h"

#include <assert.h>
#include <string.h>

/* Half periods of SClk in a byte, from its first rising edge. */
enum { HALF_FIRST_FALL = 1, HALF_SAMPLE_A = 14, HALF_SAMPLE_T = 15, HALF_BYTE = 16 };

#define GAP_A_TCLK 24 /* D p30, t_SCLKDLY: between bytes and commands of an ADS128x */
#define GAP_T_TAU  24 /* t11 of an ADS1256 after SYNC and RDATAC; 4 after the others */
#define CST_TAU    8  /* t10: CS low after the last falling SCLK */

static const uint32_t accel_lines =
    1u << PSA2_LINE_SCLK | 1u << PSA2_LINE_DIN | 1u << PSA2_LINE_DOUTX | 1u << PSA2_LINE_DOUTY | 1u << PSA2_LINE_DOUTZ;
static const uint32_t temp_lines = 1u << PSA2_LINE_SCLK | 1u << PSA2_LINE_DINT | 1u << PSA2_LINE_DOUTT;

static int32_t periods_ns(uint32_t hz, int32_t periods)
{
    return (int32_t)(((int64_t)periods * NS_PER_S + hz - 1) / hz);
}

int32_t psa2_tclk_ns(const struct psa2 *b, int32_t periods)
{
    return periods_ns(b->profile.fclk_hz, periods);
}

int32_t psa2_tau_ns(const struct psa2 *b, int32_t periods)
{
    return periods_ns(b->profile.temp_clkin_hz, periods);
}

struct psa2_xfer psa2_xfer_accel(const struct psa2 *b, const uint8_t *tx, unsigned count)
{
    assert(count > 0 && count <= PSA2_XFER_MAX);
    struct psa2_xfer x = {.group = PSA2_ACCEL, .count = (uint8_t)count};
    memcpy(x.tx, tx, count);
    for (unsigned i = 0; i < count; i++) x.gap_ns[i] = psa2_tclk_ns(b, GAP_A_TCLK);
    return x;
}

struct psa2_xfer psa2_xfer_temp(const struct psa2 *b, const uint8_t *tx, unsigned count)
{
    assert(count > 0 && count <= PSA2_XFER_MAX);
    struct psa2_xfer x = {.group = PSA2_TEMP, .count = (uint8_t)count};
    memcpy(x.tx, tx, count);
    x.gap_ns[count - 1] = psa2_tau_ns(b, GAP_T_TAU);
    return x;
}

bool psa2_spi_busy(const struct psa2 *b)
{
    return b->spi.phase != PSA2_SPI_IDLE;
}

/* From the first rising edge of the byte under way. */
static int64_t after_ns(const struct psa2_spi *s, const struct clk_step *way)
{
    return clk_on(s->past.first, way).t_ns;
}

static bool clocks_accel(const struct psa2 *b)
{
    return b->spi.x.group == PSA2_ACCEL || !b->profile.gate_sclk;
}

/* The next instant of the byte under way. */
static void arm_phase(struct psa2 *b, enum psa2_spi_phase phase, int64_t t_ns)
{
    b->spi.phase = phase;
    b->spi.due_ns = t_ns;
    if (!b->spi.stepping) sched_at(b->base.sched, &b->spi.ev, t_ns);
}

/* The first edge at or after t_ns that is not inside the byte before, from whose end on no division is needed. */
static struct clk_pos edge_at(const struct psa2_spi *s, struct clk_pos byte, int64_t t_ns)
{
    const struct clk_pos after = clk_on(byte, &s->byte);
    return t_ns <= after.t_ns ? after : clk_pos_at(&s->half, t_ns);
}

static struct clk_pos rise_from(const struct psa2_spi *s, struct clk_pos from)
{
    return from.k & 1 ? clk_on(from, &s->one) : from;
}

/* The first rising edge of a burst that starts at t_ns, after the byte before. One SClk period first: DOut is valid within
 * 100 ns of DRD_A, DIn needs its set-up. */
static struct clk_pos burst_from(const struct psa2_spi *s, const struct psa2_spi_past *past, enum psa2_group group,
                                 int64_t t_ns)
{
    const struct clk_pos lead = clk_on(edge_at(s, past->first, t_ns), &s->period);
    const int64_t ready_ns = past->ready_ns[group];
    return rise_from(s, ready_ns > lead.t_ns ? edge_at(s, past->first, ready_ns) : lead);
}

static void begin_byte(struct psa2 *b, struct clk_pos first)
{
    b->spi.past.first = first;
    arm_phase(b, PSA2_SPI_FIRST, after_ns(&b->spi, &b->spi.fall));
}

void psa2_spi_start(struct psa2 *b, const struct psa2_xfer *x, int64_t t_ns)
{
    struct psa2_spi *s = &b->spi;
    assert(!psa2_spi_busy(b));
    s->x = *x;
    s->at = 0;
    memset(s->rx, 0, sizeof s->rx);
    if (x->group == PSA2_TEMP) {
        trace_set(&b->base.trace, PSA2_LINE_CST, false, t_ns);
        ads1256_cs_pin(&b->tadc, false, t_ns);
    }
    begin_byte(b, burst_from(s, &s->past, x->group, t_ns));
}

int64_t psa2_spi_pass(const struct psa2 *b, struct psa2_spi_past *past, const struct psa2_xfer *x, int64_t t_ns)
{
    const struct psa2_spi *s = &b->spi;
    const bool temp = x->group == PSA2_TEMP;
    struct clk_pos first = burst_from(s, past, x->group, t_ns);
    for (unsigned i = 0;; i++) {
        const int64_t end_ns = clk_on(first, temp ? &s->sample_t : &s->sample_a).t_ns;
        past->ready_ns[x->group] = end_ns + x->gap_ns[i];
        if (i + 1u < x->count) {
            first = rise_from(s, edge_at(s, first, past->ready_ns[x->group]));
            continue;
        }
        past->first = first;
        return temp ? end_ns + psa2_tau_ns(b, CST_TAU) : clk_on(first, &s->byte).t_ns;
    }
}

int64_t psa2_spi_span_ns(const struct psa2 *b, const struct psa2_spi_past *past, const struct psa2_xfer *x,
                         int64_t t_ns)
{
    const int64_t wait_ns = past->ready_ns[x->group] - t_ns;
    int64_t span_ns = (wait_ns > 0 ? wait_ns : 0) + periods_ns(b->profile.sclk_hz, 2);
    for (unsigned i = 0; i < x->count; i++)
        span_ns += periods_ns(b->profile.sclk_hz, 9) + (i + 1u < x->count ? x->gap_ns[i] : 0);
    return span_ns + (x->group == PSA2_TEMP ? psa2_tau_ns(b, CST_TAU) : periods_ns(b->profile.sclk_hz, 1));
}

/* Bit `shift` of up to four bytes, side by side: the product has bit 8 n of the factor at bit 24 + n, and nothing above. */
static uint32_t bit_of_each(uint32_t bytes, unsigned shift)
{
    return (bytes >> shift & 0x01010101) * 0x01020408 >> 24;
}

/* Bytes of lines whose numbers follow on one another, the first in the low byte. */
_Static_assert(PSA2_LINE_DOUTX == PSA2_LINE_DIN + 1 && PSA2_LINE_DOUTZ == PSA2_LINE_DIN + 3, "DIn, DOutX, Y, Z");
_Static_assert(PSA2_LINE_DOUTT == PSA2_LINE_DINT + 1, "DInT, DOutT");

static uint32_t accel_bytes(const struct psa2_spi *s)
{
    const uint32_t mosi = s->x.group == PSA2_ACCEL ? s->x.tx[s->at] : 0;
    return mosi | (uint32_t)s->rx[0][s->at] << 8 | (uint32_t)s->rx[1][s->at] << 16 | (uint32_t)s->rx[2][s->at] << 24;
}

static uint32_t temp_bytes(const struct psa2_spi *s)
{
    return s->x.tx[s->at] | (uint32_t)s->rx[3][s->at] << 8;
}

/* After the byte: DIn keeps its last bit up to the next byte and rests low after the last, DOut shows what comes next. */
static uint32_t accel_after(const struct psa2_spi *s, uint32_t next)
{
    const bool last = s->at + 1u == s->x.count;
    return (last ? 0 : (accel_bytes(s) & 1) << PSA2_LINE_DIN) | next << PSA2_LINE_DOUTX;
}

/* DOutX, Y, Z as they stand. */
static uint32_t dout_now(const struct psa2 *b)
{
    uint32_t level = 0;
    for (unsigned i = 0; i < 3; i++) level |= (uint32_t)spi_miso(&b->adc[i].spi) << i;
    return level;
}

/* The byte that has ended. Accelerometers, mode 0: data change on the falling edge before the rising one that samples them;
 * temperature, mode 1: on the rising edge. next: DOutX, Y, Z after it. */
static void report_byte(struct psa2 *b, uint32_t next)
{
    const struct psa2_spi *s = &b->spi;
    const bool temp = s->x.group == PSA2_TEMP;
    const uint32_t sclk = UINT32_C(1) << PSA2_LINE_SCLK;
    const uint32_t on_fall = clocks_accel(b) ? accel_lines & ~sclk : 0;
    const uint32_t on_rise = temp ? temp_lines & ~sclk : 0;
    const uint32_t accel = accel_bytes(s), temps = temp_bytes(s);
    struct trace_step *const step = trace_room(&b->base.trace, HALF_BYTE + 2), *p = step;
    if (!step) return;
    const struct clk_step one = s->one;
    struct clk_pos at = clk_on(s->past.first, &s->back);
    *p++ = (struct trace_step){at.t_ns, on_fall, bit_of_each(accel, 7) << PSA2_LINE_DIN};
    for (int shift = 7; shift >= 0; shift--) {
        at = clk_on(at, &one);
        const uint32_t data = temp ? bit_of_each(temps, (unsigned)shift) << PSA2_LINE_DINT : 0;
        *p++ = (struct trace_step){at.t_ns, sclk | on_rise, sclk | data};
        at = clk_on(at, &one);
        *p++ = (struct trace_step){at.t_ns, sclk | on_fall,
                                   shift ? bit_of_each(accel, (unsigned)shift - 1) << PSA2_LINE_DIN
                                         : accel_after(s, next)};
    }
    at = clk_on(at, &one);
    if (temp && s->at + 1u == s->x.count) *p++ = (struct trace_step){at.t_ns, UINT32_C(1) << PSA2_LINE_DINT, 0};
    trace_commit(&b->base.trace, (unsigned)(p - step));
}

/* The same byte unwatched: only the final levels, for late observers. */
static void keep_levels(struct psa2 *b, int64_t t_ns)
{
    const struct psa2_spi *s = &b->spi;
    const bool last = s->at + 1u == s->x.count;
    uint32_t lines = UINT32_C(1) << PSA2_LINE_SCLK, level = 0;
    if (clocks_accel(b)) {
        lines |= accel_lines;
        level |= accel_after(s, dout_now(b));
    }
    if (s->x.group == PSA2_TEMP) {
        lines |= temp_lines;
        level |= (temp_bytes(s) >> 8 & 1) << PSA2_LINE_DOUTT | (last ? 0 : temp_bytes(s) & 1) << PSA2_LINE_DINT;
    }
    trace_put(&b->base.trace, lines, level, t_ns);
}

static void end_xfer(struct psa2 *b, int64_t t_ns)
{
    b->spi.phase = PSA2_SPI_IDLE;
    b->spi.x.done(b, t_ns);
    b->idle(b, t_ns);
}

static void end_byte(struct psa2 *b, int64_t t_ns)
{
    struct psa2_spi *s = &b->spi;
    if (trace_watched(&b->base.trace, accel_lines | temp_lines)) report_byte(b, dout_now(b));
    else keep_levels(b, t_ns);
    const int64_t next_ns = t_ns + s->x.gap_ns[s->at];
    if (++s->at < s->x.count) {
        begin_byte(b, rise_from(s, edge_at(s, s->past.first, next_ns)));
        return;
    }
    s->past.ready_ns[s->x.group] = next_ns;
    if (s->x.group == PSA2_TEMP) arm_phase(b, PSA2_SPI_CST_UP, t_ns + psa2_tau_ns(b, CST_TAU));
    else arm_phase(b, PSA2_SPI_REST, after_ns(s, &s->byte)); /* SClk is low again before CST may move */
}

/* On to the last byte of a read whose bytes are known; what is reported ends with the byte before. */
static void pass_bytes(struct psa2 *b)
{
    struct psa2_spi *s = &b->spi;
    for (; s->at + 1u < s->x.count; s->at++, s->past.first = clk_on(s->past.first, &s->byte)) {
        if (!trace_watched(&b->base.trace, accel_lines)) continue;
        uint32_t next = 0;
        for (unsigned i = 0; i < 3; i++) next |= (uint32_t)s->rx[i][s->at + 1] >> 7 << i;
        report_byte(b, next);
    }
}

/* The read whose first byte has just begun, at one go: nothing else happens before its end, and all the converters do is
 * shift. */
static bool read_at_once(struct psa2 *b)
{
    struct psa2_spi *s = &b->spi;
    if (!s->x.zeros || s->at > 0) return false;
    for (unsigned i = 0; i < 3; i++)
        if (!ads1282_only_shifts(&b->adc[i])) return false;
    const int64_t end_ns = after_ns(s, &s->read);
    if (!sched_go_on(b->base.sched, end_ns)) return false;
    for (unsigned i = 0; i < 3; i++) ads1282_shift(&b->adc[i], s->rx[i], s->x.count, end_ns);
    pass_bytes(b);
    end_byte(b, end_ns);
    return true;
}

static void first_fall(struct psa2 *b, int64_t t_ns)
{
    if (clocks_accel(b))
        for (unsigned i = 0; i < 3; i++) spi_first(&b->adc[i].spi, t_ns);
    if (b->spi.x.group == PSA2_TEMP) spi_first(&b->tadc.spi, t_ns);
    if (read_at_once(b)) return;
    if (clocks_accel(b)) arm_phase(b, PSA2_SPI_SAMPLE_A, after_ns(&b->spi, &b->spi.sample_a));
    else arm_phase(b, PSA2_SPI_SAMPLE_T, after_ns(&b->spi, &b->spi.sample_t));
}

/* A burst for the temperature converter that is not gated clocks the accelerometer converters with DIn low. */
static void sample_accel(struct psa2 *b, int64_t t_ns)
{
    struct psa2_spi *s = &b->spi;
    const bool own = s->x.group == PSA2_ACCEL;
    for (unsigned i = 0; i < 3; i++) s->rx[i][s->at] = spi_byte(&b->adc[i].spi, own ? s->x.tx[s->at] : 0, t_ns);
    if (own) end_byte(b, t_ns);
    else arm_phase(b, PSA2_SPI_SAMPLE_T, after_ns(s, &s->sample_t));
}

static void sample_temp(struct psa2 *b, int64_t t_ns)
{
    b->spi.rx[3][b->spi.at] = spi_byte(&b->tadc.spi, b->spi.x.tx[b->spi.at], t_ns);
    end_byte(b, t_ns);
}

static void cst_up(struct psa2 *b, int64_t t_ns)
{
    ads1256_cs_pin(&b->tadc, true, t_ns);
    psa2_line(b, PSA2_LINE_CST, true, t_ns);
    trace_set(&b->base.trace, PSA2_LINE_DOUTT, false, t_ns); /* high impedance, drawn low */
}

static void end_burst(struct psa2 *b, int64_t t_ns)
{
    if (b->spi.phase == PSA2_SPI_CST_UP) cst_up(b, t_ns);
    end_xfer(b, t_ns);
}

/* A burst between which nothing else happens takes one event. */
static void on_event(void *ctx, int64_t t_ns)
{
    static void (*const step[])(struct psa2 * b, int64_t t_ns) = {[PSA2_SPI_FIRST] = first_fall,
                                                                  [PSA2_SPI_SAMPLE_A] = sample_accel,
                                                                  [PSA2_SPI_SAMPLE_T] = sample_temp,
                                                                  [PSA2_SPI_REST] = end_burst,
                                                                  [PSA2_SPI_CST_UP] = end_burst};
    struct psa2 *b = ctx;
    struct psa2_spi *s = &b->spi;
    s->due_ns = t_ns;
    s->stepping = true;
    do step[s->phase](b, s->due_ns);
    while (s->phase != PSA2_SPI_IDLE && sched_go_on(b->base.sched, s->due_ns));
    s->stepping = false;
    if (s->phase != PSA2_SPI_IDLE) sched_at(b->base.sched, &s->ev, s->due_ns);
}

void psa2_spi_init(struct psa2 *b)
{
    struct psa2_spi *s = &b->spi;
    s->half = (struct clk){.hz = 2 * (int64_t)b->profile.sclk_hz, .div = 1};
    s->one = clk_step(&s->half, 1);
    s->back = clk_step(&s->half, -1);
    s->period = clk_step(&s->half, 2);
    s->fall = clk_step(&s->half, HALF_FIRST_FALL);
    s->sample_a = clk_step(&s->half, HALF_SAMPLE_A);
    s->sample_t = clk_step(&s->half, HALF_SAMPLE_T);
    s->byte = clk_step(&s->half, HALF_BYTE);
    s->read = clk_step(&s->half, HALF_BYTE * (b->profile.read_bits / 8 - 1) + HALF_SAMPLE_A);
    sched_ev_inner(&b->spi.ev, on_event, b);
}

void psa2_spi_stop(struct psa2 *b, int64_t t_ns)
{
    sched_cancel(b->base.sched, &b->spi.ev);
    if (psa2_spi_busy(b) && b->spi.x.group == PSA2_TEMP) cst_up(b, t_ns);
    b->spi.phase = PSA2_SPI_IDLE;
}

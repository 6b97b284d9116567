/* What the Verilog model of PSD-1 in tests/bench/verilog must reproduce: words, and edges of each line, from the emulated board.
 *
 *     bench_psd1_words FILE [CYCLES]
 *
 * FILE gets a line a cycle: words X, Y and Z, in hex, as they stood on the bus. Standard output gets what came of them on
 * the lines, in the order of psd1.v: "frames N checksum H", then "line I edges M when W", with W the sum of when: half
 * periods of 1M25 since A0 rose, for SDAT and DR edges of SCLK since then. */
#include "board/psd1/psd1.h"
#include "looks.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#define STEP_NS  100000
#define HALF_NS  400
#define ROWS_MAX 4096u

enum { A0 = 0, DR = 4, SCLK = 9, SDAT = 10, CS = 12, D0 = 18, LINES = 34, AXES = 3 };

struct words {
    struct sched s;
    struct psd1 b;
    struct trace_sink sink;
    uint64_t level, changed; /* at t_ns */
    int64_t t_ns, a0_ns, dr_ns;
    int64_t from_ns, until_ns; /* edges in from < t <= until count */
    uint64_t sclks;            /* edges since A0 rose */
    uint64_t edges[LINES], when[LINES];
    uint16_t row[ROWS_MAX][AXES];
    unsigned words; /* read, 3 a cycle */
    uint32_t checksum;
};

/* Each axis moves through its range, so that all bits are used. */
static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    static const double slope_vps[AXES] = {31.0, 17.0, 23.0};
    (void)ctx;
    const double v = slope_vps[axis] * (double)t_ns * 1e-9;
    return v - 19.0 * (double)(int64_t)(v / 19.0) - 9.5;
}

LOOKS_ROW(accel_row, accel);

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    return 25.0 + channel;
}

static void rate(void *ctx, int64_t t_ns, double w_ib_b[3])
{
    (void)ctx;
    (void)t_ns;
    for (unsigned i = 0; i < 3; i++) w_ib_b[i] = 0.0;
}

static void word(struct words *w, uint16_t value)
{
    if (w->words == AXES * ROWS_MAX) return;
    w->row[w->words / AXES][w->words % AXES] = value;
    w->words++;
    w->checksum = w->checksum * 31 + value;
}

/* All that has changed at an instant; `before`: levels up to it. */
static void instant(struct words *w, uint64_t before)
{
    const uint64_t rises = w->changed & w->level;
    if (w->changed & ~w->level & TRACE_BIT(DR)) w->dr_ns = w->t_ns;
    if (rises & TRACE_BIT(A0)) {
        w->a0_ns = w->t_ns;
        w->sclks = 0;
    }
    if (w->t_ns <= w->from_ns || w->t_ns > w->until_ns) return;
    w->sclks += w->changed >> SCLK & 1;
    if (rises & TRACE_BIT(CS)) word(w, (uint16_t)(before >> D0));
    for (unsigned i = 0; i < LINES; i++) {
        if (!(w->changed >> i & 1)) continue;
        w->edges[i]++;
        w->when[i] += i == SDAT || i == DR ? w->sclks : (uint64_t)((w->t_ns - w->a0_ns) / HALF_NS);
    }
}

static void steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct words *w = ctx;
    for (unsigned i = 0; i < n;) {
        const uint64_t before = w->level;
        w->t_ns = s[i].t_ns;
        for (; i < n && s[i].t_ns == w->t_ns; i++) w->level = (w->level & ~s[i].lines) | (s[i].level & s[i].lines);
        w->changed = before ^ w->level;
        instant(w, before);
    }
}

static void step(struct words *w)
{
    sched_run_until(&w->s, w->s.now_ns + STEP_NS);
    trace_advance(&w->b.base.trace, w->s.now_ns - TRACE_LAG_NS);
}

static void power_up(struct words *w)
{
    const struct board_io io = {.ctx = w, .accel = accel_row, .temp_degc = degc, .rate_radps = rate};
    struct board_cfg u = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 1, .serial = 1};
    struct psd1_profile p;
    fields_default(&psd1_fields, &p);
    for (unsigned i = 0; i < AXES; i++) {
        u.afe[i] = afe_nominal(AFE_VOLTAGE);
        u.afe[i].divider_ratio = 1.0;
    }
    sched_init(&w->s);
    psd1_init(&w->b, &p, &u, &io, &w->s);
    w->from_ns = w->until_ns = INT64_MAX;
    w->sink = (struct trace_sink){.mask = TRACE_FIRST(LINES), .steps = steps, .ctx = w};
    psd1_power_up(&w->b, 0);
}

/* From half a period after a conversion's end on, in whole conversions. */
static void run(struct words *w, unsigned cycles)
{
    trace_attach(&w->b.base.trace, &w->sink);
    while (w->s.now_ns < 20000000) step(w); /* the set-up is over */
    const int64_t period_ns = ad7712_period_ns(&w->b.adc[0]), last_ns = w->dr_ns;
    w->from_ns = last_ns + period_ns + HALF_NS;
    w->until_ns = w->from_ns + cycles * period_ns;
    while (w->s.now_ns < w->until_ns + 2 * TRACE_LAG_NS) step(w);
}

static bool write_rows(const struct words *w, const char *path)
{
    FILE *out = fopen(path, "w");
    if (!out) return false;
    for (unsigned f = 0; f < w->words / AXES; f++)
        (void)fprintf(out, "%04x %04x %04x\n", w->row[f][0], w->row[f][1], w->row[f][2]);
    return fclose(out) == 0;
}

int main(int argc, char **argv)
{
    static struct words w;
    const unsigned cycles = argc > 2 ? (unsigned)strtoul(argv[2], NULL, 10) : 512;
    if (argc < 2 || cycles == 0 || cycles > ROWS_MAX) {
        (void)fprintf(stderr, "usage: bench_psd1_words FILE [CYCLES]\n");
        return 2;
    }
    power_up(&w);
    run(&w, cycles);
    if (!write_rows(&w, argv[1])) {
        perror(argv[1]);
        return 3;
    }
    printf("frames %u checksum %08" PRIx32 "\n", w.words / AXES, w.checksum);
    for (unsigned i = 0; i < LINES; i++)
        printf("line %u edges %" PRIu64 " when %" PRIu64 "\n", i, w.edges[i], w.when[i]);
    return 0;
}

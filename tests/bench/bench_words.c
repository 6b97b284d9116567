/* What the Verilog models of tests/bench/verilog must reproduce: words, and edges of each line, from the emulated board.
 *
 *     bench_words FILE [FRAMES]
 *
 * FILE gets a line a frame: conversion words X, Y, Z and the temperature word, in hex. Standard output gets what came of
 * them on the lines, in the order of psa2.v: "frames N checksum H", then "line I edges M when W", with W the sum of when:
 * for Data, CLK and Int in half periods of CLK since Int fell, for DOutX/Y/Z in levels of SClk since DRD_A fell. SClk
 * counts only while CST is high: the temperature port, which the models lack, uses the same wire. */
#include "board/psa2/psa2.h"
#include "looks.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#define STEP_NS  100000
#define ROWS_MAX 4096u

/* Bit 7 of a conversion word: DOUT goes on to it after the 24 bits that are read, and rests there. */
#define REST_BIT 0x80u

enum { ROW_T = 3, ROW_WORDS };

static const enum psa2_line order[] = {PSA2_LINE_SCLK,  PSA2_LINE_DRD_A, PSA2_LINE_DIN,
                                       PSA2_LINE_DOUTX, PSA2_LINE_DOUTY, PSA2_LINE_DOUTZ,
                                       PSA2_LINE_DATA,  PSA2_LINE_CLK,   PSA2_LINE_INT};
enum { LINES = sizeof order / sizeof *order };

struct words {
    struct sched s;
    struct psa2 b;
    struct trace_sink sink;
    bool level[PSA2_LINES];
    bool counting;
    int64_t t_ns, t_int_fall_ns;
    uint32_t changed;     /* lines that have changed at t_ns */
    uint64_t sclk_levels; /* since DRD_A fell */
    uint64_t when[PSA2_LINES];
    uint64_t edges[PSA2_LINES];
    uint32_t row[ROWS_MAX][ROW_WORDS];
    unsigned frames, rested; /* frames sent, frames whose DOUT lines have come to rest */
    uint32_t checksum;
};

/* Each axis moves through its range, so that all bits are used. */
static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    static const double slope_vps[3] = {31.0, 17.0, 23.0};
    (void)ctx;
    const double v = slope_vps[axis] * (double)t_ns * 1e-9;
    return v - 20.0 * (double)(int64_t)(v / 20.0) - 10.0;
}

LOOKS_ROW(accel_row, accel);

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    return 25.0 + channel;
}

static void frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct words *w = ctx;
    (void)t_ns;
    if (!w->counting || w->frames == ROWS_MAX) return;
    uint32_t *row = w->row[w->frames++];
    for (unsigned i = 0; i < 3; i++) row[i] |= f->raw[i] & ~(uint32_t)0xFF;
    row[ROW_T] = f->word[ROW_T];
    for (unsigned i = 0; i < PSA2_WORDS; i++) w->checksum = w->checksum * 31 + f->word[i];
}

/* Half periods, which are no whole number of ns for every profile's clock. */
static uint64_t halves(const struct words *w, int64_t dt_ns)
{
    const int64_t hz = 2 * (int64_t)w->b.profile.line_hz / w->b.profile.line_div;
    return (uint64_t)((dt_ns * hz + NS_PER_S / 2) / NS_PER_S);
}

static void rested(struct words *w)
{
    if (w->rested == ROWS_MAX) return;
    for (unsigned i = 0; i < 3; i++) w->row[w->rested][i] |= w->level[PSA2_LINE_DOUTX + i] ? REST_BIT : 0;
    w->rested++;
}

static void edge(struct words *w, unsigned sig)
{
    const bool sclk = sig == PSA2_LINE_SCLK, out = sig >= PSA2_LINE_DATA && sig <= PSA2_LINE_INT;
    if (!w->counting || (sclk && !w->level[PSA2_LINE_CST])) return;
    if (sig == PSA2_LINE_DRD_A && !w->level[sig]) w->sclk_levels = 0;
    if (sig == PSA2_LINE_INT && !w->level[sig]) {
        w->t_int_fall_ns = w->t_ns;
        rested(w);
    }
    w->edges[sig]++;
    w->sclk_levels += sclk;
    if (out) w->when[sig] += halves(w, w->t_ns - w->t_int_fall_ns);
    if (sig >= PSA2_LINE_DOUTX && sig <= PSA2_LINE_DOUTZ) w->when[sig] += w->sclk_levels;
}

/* All that has changed at an instant, in the order of the lines. */
static void instant_over(struct words *w)
{
    for (unsigned i = 0; i < PSA2_LINES; i++)
        if (w->changed >> i & 1) edge(w, i);
    w->changed = 0;
}

static void change(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct words *w = ctx;
    if (t_ns != w->t_ns) instant_over(w);
    w->t_ns = t_ns;
    w->level[sig] = level;
    w->changed |= UINT32_C(1) << sig;
}

static void steps(void *ctx, const struct trace_step *s, unsigned n)
{
    trace_each(s, n, (UINT32_C(1) << PSA2_LINES) - 1, change, ctx);
}

static void step(struct words *w)
{
    sched_run_until(&w->s, w->s.now_ns + STEP_NS);
    trace_advance(&w->b.base.trace, w->s.now_ns - TRACE_LAG_NS);
}

/* To a place between two frames. */
static void frame_over(struct words *w)
{
    const uint32_t before = w->b.counters.frames;
    while (w->b.counters.frames == before) step(w);
    for (unsigned i = 0; i < 3; i++) step(w); /* and what the trace lags behind */
}

static void power_up(struct words *w)
{
    const struct board_io io = {.ctx = w, .accel = accel_row, .temp_degc = degc};
    struct psa2_profile p;
    fields_default(&psa2_fields, &p);
    struct board_cfg u = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 1, .serial = 1};
    for (unsigned i = 0; i < 3; i++) u.afe[i] = afe_nominal(AFE_VOLTAGE);
    sched_init(&w->s);
    psa2_init(&w->b, &p, &u, &io, &w->s);
    w->b.host = (struct psa2_host){.ctx = w, .frame = frame};
    psa2_power_up(&w->b, 0);
}

static void run(struct words *w, unsigned frames)
{
    w->sink = (struct trace_sink){.mask = (UINT32_C(1) << PSA2_LINES) - 1, .steps = steps, .ctx = w};
    trace_attach(&w->b.base.trace, &w->sink);
    do frame_over(w);
    while (w->level[PSA2_LINE_DOUTX] || w->level[PSA2_LINE_DOUTY] || w->level[PSA2_LINE_DOUTZ]);
    instant_over(w);
    w->counting = true; /* the models, too, begin with their lines low */
    while (w->frames < frames) step(w);
    trace_advance(&w->b.base.trace, w->s.now_ns);
    instant_over(w);
}

static bool write_rows(const struct words *w, const char *path)
{
    FILE *out = fopen(path, "w");
    if (!out) return false;
    for (unsigned f = 0; f < w->frames; f++) {
        const uint32_t *row = w->row[f];
        (void)fprintf(out, "%08" PRIx32 " %08" PRIx32 " %08" PRIx32 " %08" PRIx32 "\n", row[0], row[1], row[2], row[3]);
    }
    return fclose(out) == 0;
}

int main(int argc, char **argv)
{
    static struct words w;
    const unsigned long frames = argc > 2 ? strtoul(argv[2], NULL, 10) : 512;
    if (argc < 2 || frames < 1 || frames > ROWS_MAX) {
        (void)fprintf(stderr, "usage: bench_words FILE [FRAMES, up to %u]\n", ROWS_MAX);
        return 2;
    }
    power_up(&w);
    run(&w, (unsigned)frames);
    if (!write_rows(&w, argv[1])) {
        perror(argv[1]);
        return 3;
    }
    printf("frames %u checksum %08" PRIx32 "\n", w.frames, w.checksum);
    for (unsigned i = 0; i < LINES; i++)
        printf("line %u edges %" PRIu64 " when %" PRIu64 "\n", i, w.edges[order[i]], w.when[order[i]]);
    return 0;
}

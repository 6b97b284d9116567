/* How fast the emulator's core is: one PSA-2 of the article's profile, 1000 frames of simulated time a second, or one PSD-1
 * with its built-in host, 1028 cycles.
 *
 *     bench_core CASE [FRAMES]    prints: CASE frames=N edges=M ns=T hash=H
 *
 * The clock runs from the first frame after the set-up on. Under callgrind take the difference of two counts of frames:
 * the set-up is the same in both. The hash is over the words of all frames: a faster core says the same. */
#include "board/psa2/psa2.h"
#include "board/psd1/psd1.h"
#include "looks.h"
#include "trace/vcd.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define STEP_NS  1000000 /* the trace is advanced once a frame */
#define TAPE_MAX 65536u
#define FRAME_NS 1000000

struct bench {
    struct sched s;
    struct psa2 b;
    struct psd1 d;
    struct trace *trace; /* of the one that runs */
    struct trace_sink sink;
    struct vcd vcd;
    uint64_t frames, edges, hash;
    struct trace_step tape[TAPE_MAX]; /* edges of some frames, for the VCD writer alone */
    unsigned tape_len;
};

static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    static const double volts[3] = {2.4882, -7.0, 9.9};
    (void)ctx;
    (void)t_ns;
    return volts[axis];
}

LOOKS_ROW(accel_row, accel);

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)ctx;
    (void)channel;
    (void)t_ns;
    return 25.0;
}

static void frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct bench *n = ctx;
    (void)t_ns;
    n->frames++;
    for (unsigned w = 0; w < PSA2_WORDS; w++) n->hash = (n->hash ^ f->word[w]) * UINT64_C(0x100000001B3);
}

static void cycle(void *ctx, const struct psd1_cycle *c, int64_t t_ns)
{
    struct bench *n = ctx;
    (void)t_ns;
    n->frames++;
    for (unsigned i = 0; i < 3; i++) n->hash = (n->hash ^ c->word[i]) * UINT64_C(0x100000001B3);
}

static void rate(void *ctx, int64_t t_ns, double w_radps[3])
{
    (void)ctx;
    (void)t_ns;
    w_radps[0] = 0.1;
    w_radps[1] = -0.2;
    w_radps[2] = 0.3;
}

/* The instruction that counts bits, where there is one: what is measured is the emulator, not its listener. */
#if defined __x86_64__
#define COUNTS_BITS __attribute__((target("popcnt")))
#else
#define COUNTS_BITS
#endif

COUNTS_BITS static void count(void *ctx, const struct trace_step *s, unsigned n)
{
    uint64_t edges = 0;
#pragma GCC unroll 8
    for (unsigned i = 0; i < n; i++) edges += (unsigned)__builtin_popcountll(s[i].lines);
    ((struct bench *)ctx)->edges += edges;
}

static void to_tape(void *ctx, const struct trace_step *s, unsigned n)
{
    struct bench *b = ctx;
    for (; n > 0 && b->tape_len < TAPE_MAX; n--) b->tape[b->tape_len++] = *s++;
}

static int64_t clock_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* whatever else the machine is busy with */
    return (int64_t)t.tv_sec * NS_PER_S + t.tv_nsec;
}

static void watch(struct bench *n)
{
    n->sink = (struct trace_sink){.mask = TRACE_FIRST(n->trace->count), .steps = count, .ctx = n};
    trace_attach(n->trace, &n->sink);
}

/* What happens in a cycle, without the clock that runs all the time. */
static void watch_but_clock(struct bench *n)
{
    const uint64_t clock = TRACE_BIT((unsigned)trace_find(n->trace, "CLK_1M25"));
    n->sink = (struct trace_sink){.mask = TRACE_FIRST(n->trace->count) & ~clock, .steps = count, .ctx = n};
    trace_attach(n->trace, &n->sink);
}

/* The whole board with a recording of all its lines. */
static void record(struct bench *n)
{
    FILE *out = fopen("/dev/null", "w");
    if (!out) abort();
    const struct vcd_cfg cfg = {
        .out = out, .scope = "psa2", .unit_ns = VCD_UNIT_NS, .mask = (UINT32_C(1) << PSA2_LINES) - 1};
    (void)vcd_open(&n->vcd, &cfg, &n->b.base.trace);
}

static void run_frames(struct bench *n, uint64_t frames)
{
    const uint64_t end = n->frames + frames;
    while (n->frames < end) {
        sched_run_until(&n->s, n->s.now_ns + STEP_NS);
        trace_advance(n->trace, n->s.now_ns - TRACE_LAG_NS);
    }
}

/* 100 frames on tape, then the writer. */
static void tape_then_record(struct bench *n)
{
    struct trace_sink sink = {.mask = (UINT32_C(1) << PSA2_LINES) - 1, .steps = to_tape, .ctx = n};
    trace_attach(&n->b.base.trace, &sink);
    run_frames(n, 100);
    trace_detach(&n->b.base.trace, &sink);
    record(n);
}

static void replay(struct bench *n, uint64_t frames)
{
    for (uint64_t f = 0; f < frames; f += 100, n->frames += 100) {
        n->vcd.sink.steps(n->vcd.sink.ctx, n->tape, n->tape_len);
        for (unsigned i = 0; i < n->tape_len; i++) n->tape[i].t_ns += INT64_C(100) * FRAME_NS;
    }
}

static void power_up(struct bench *n, enum ads1282_chain chain);
static void power_up_psd1(struct bench *n, enum ads1282_chain chain);

static const struct bench_case {
    const char *name;
    void (*power_up)(struct bench *n, enum ads1282_chain chain);
    enum ads1282_chain chain;
    void (*before)(struct bench *n);
    void (*run)(struct bench *n, uint64_t frames);
} cases[] = {
    {"frames", power_up, ADS1282_CHAIN_EXACT, NULL, run_frames}, /* without observers, bit-exact decimation chain */
    {"frames-direct", power_up, ADS1282_CHAIN_DIRECT, NULL, run_frames},       /* without the chain */
    {"frames-modulator", power_up, ADS1282_CHAIN_MODULATOR, NULL, run_frames}, /* with a bit-true modulator, too */
    {"frames-watched", power_up, ADS1282_CHAIN_EXACT, watch, run_frames},      /* all lines, a watcher that counts */
    {"frames-watched-direct", power_up, ADS1282_CHAIN_DIRECT, watch, run_frames},
    {"frames-vcd", power_up, ADS1282_CHAIN_DIRECT, record, run_frames}, /* all lines into a VCD */
    {"vcd", power_up, ADS1282_CHAIN_DIRECT, tape_then_record,
     replay}, /* the VCD writer alone, fed with the edges of frames */
    {"psd1-unwatched", power_up_psd1, ADS1282_CHAIN_EXACT, NULL, run_frames},
    {"psd1-cycle", power_up_psd1, ADS1282_CHAIN_EXACT, watch_but_clock, run_frames}, /* all lines but 1M25 */
    {"psd1-watched", power_up_psd1, ADS1282_CHAIN_EXACT, watch, run_frames},         /* all lines, 1M25 among them */
};

static void power_up(struct bench *n, enum ads1282_chain chain)
{
    const struct board_io io = {.ctx = n, .accel = accel_row, .temp_degc = degc};
    struct psa2_profile p;
    fields_default(&psa2_fields, &p);
    struct board_cfg u = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .adc_chain = chain, .seed = 1, .serial = 1};
    for (unsigned i = 0; i < 3; i++) u.afe[i] = afe_nominal(AFE_VOLTAGE);
    memset(n, 0, sizeof *n);
    sched_init(&n->s);
    psa2_init(&n->b, &p, &u, &io, &n->s);
    n->b.host = (struct psa2_host){.ctx = n, .frame = frame};
    n->trace = &n->b.base.trace;
    psa2_power_up(&n->b, 0);
    run_frames(n, 1);
}

static void power_up_psd1(struct bench *n, enum ads1282_chain chain)
{
    const struct board_io io = {.ctx = n, .accel = accel_row, .temp_degc = degc, .rate_radps = rate};
    struct board_cfg u = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .adc_chain = chain, .seed = 1, .serial = 1};
    struct psd1_profile p;
    fields_default(&psd1_fields, &p);
    for (unsigned i = 0; i < 3; i++) {
        u.afe[i] = afe_nominal(AFE_VOLTAGE);
        u.afe[i].divider_ratio = 1.0;
    }
    memset(n, 0, sizeof *n);
    sched_init(&n->s);
    psd1_init(&n->d, &p, &u, &io, &n->s);
    n->d.host = (struct psd1_host){.ctx = n, .cycle = cycle};
    n->trace = &n->d.base.trace;
    psd1_power_up(&n->d, 0);
    run_frames(n, 1);
}

static void run_case(const struct bench_case *c, uint64_t frames)
{
    static struct bench n;
    c->power_up(&n, c->chain);
    if (c->before) c->before(&n);
    n.edges = 0;
    const uint64_t first = n.frames;
    const int64_t t0_ns = clock_ns();
    c->run(&n, frames);
    const int64_t t_ns = clock_ns() - t0_ns;
    if (n.vcd.out) n.edges = n.vcd.changes;
    printf("%s frames=%" PRIu64 " edges=%" PRIu64 " ns=%" PRId64 " hash=%016" PRIx64 "\n", c->name, n.frames - first,
           n.edges, t_ns, n.hash);
}

int main(int argc, char **argv)
{
    const uint64_t frames = argc > 2 ? strtoull(argv[2], NULL, 10) : 10000;
    for (size_t i = 0; argc > 1 && i < sizeof cases / sizeof *cases; i++) {
        if (strcmp(argv[1], cases[i].name) != 0) continue;
        run_case(&cases[i], frames);
        return 0;
    }
    (void)fprintf(stderr, "usage: bench_core CASE [FRAMES]; cases:");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) (void)fprintf(stderr, " %s", cases[i].name);
    (void)fprintf(stderr, "\n");
    return 2;
}

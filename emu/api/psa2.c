#include "api/internal.h"

#include "board/psa2/psa2.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

enum { TEMPS = 4, TEMP_INPUT = 3 /* inputs 3..6: temperatures */ };

struct part_psa2 {
    struct psabench_part part;
    unsigned profile, chain, input;
    double noise_scale, temp_noise_scale, temp_degc;
    struct psa2 board;
    struct trace_sink sink[2]; /* one is attached, the other takes over when the observed lines change */
    unsigned attached;         /* sink that is */
    bool attaching;
    struct psa2_request request;
    bool pending; /* the board has the request */
    enum psa2_result result;
};

static struct part_psa2 *part_of(struct psabench_part *p)
{
    return (struct part_psa2 *)p;
}

static const struct part_psa2 *const_part_of(const struct psabench_part *p)
{
    return (const struct part_psa2 *)p;
}

/* ---- options and profiles ---- */

#define PROFILES "article|intent|lab32|psa1|ungated|w16|w24"

#define OPTIONS(X)                                                                                                     \
    X("profile", API_CHOICE, part_psa2, profile, "article", 0, 6, PROFILES, "board profile, proto/profiles")           \
    X("chain", API_CHOICE, part_psa2, chain, "exact", 0, 2, "exact|modulator|direct",                                  \
      "of the accelerometer converters, as that of an ads1282")                                                        \
    X("noise_scale", API_REAL, part_psa2, noise_scale, "1", 0, 1000, NULL,                                             \
      "noise of the accelerometer converters, 1: published, 0: none")                                                  \
    X("temp_noise_scale", API_REAL, part_psa2, temp_noise_scale, "1", 0, 1000, NULL,                                   \
      "noise of the temperature converter, 1: published, 0: none")                                                     \
    X("input", API_CHOICE, part_psa2, input, "volts", 0, 1, "volts|amps",                                              \
      "what the sensors X Y Z give: volts, or amperes into 1 kohm")                                                    \
    X("temp_degc", API_REAL, part_psa2, temp_degc, "25", -273, 1000, NULL,                                             \
      "temperature of sensors and board until psabench_set_volts(), degC")

static const struct api_option options[] = {OPTIONS(API_OPTION_ROW)};

/* What each profile has other than "article", in the words of its file; a test holds them against proto/profiles. */
static const struct {
    const char *profile, *key, *text;
    unsigned index;
} differences[] = {
    {"intent", "setup", "DRD_A write_A 41 00 56", 0},
    {"intent", "setup", "DRD_T write_T 50 00 06", 1},
    {"intent", "setup", "DRD_T write_T 53 00 82", 2},
    {"intent", "setup", "DRD_T sync_T", 3},
    {"intent", "setup", "DRD_A sync_A", 4},
    {"lab32", "code_bits", "32", 0},
    {"lab32", "read_bits", "32", 0},
    {"psa1", "adc_is_1281", "true", 0},
    {"psa1", "adc_vref_v", "2.5", 0},
    {"psa1", "adc_pga", "1", 0},
    {"ungated", "temp_clkin_hz", "8000000", 0},
    {"ungated", "gate_sclk", "false", 0},
    {"w16", "line_hz", "4096000", 0},
    {"w16", "line_div", "4", 0},
    {"w16", "word_bits", "16", 0},
    {"w16", "lead_in_clk", "0", 0},
    {"w16", "code_bits", "16", 0},
    {"w24", "line_hz", "4096000", 0},
    {"w24", "line_div", "3", 0},
    {"w24", "word_bits", "24", 0},
    {"w24", "lead_in_clk", "0", 0},
};

bool api_psa2_profile(unsigned number, struct psa2_profile *p, char *why, size_t cap)
{
    const char *name = PROFILES;
    while (number-- > 0) name = strchr(name, '|') + 1;
    const size_t len = strcspn(name, "|");
    fields_default(&psa2_fields, p);
    memcpy(p->name, name, len);
    p->name[len] = '\0';
    for (size_t i = 0; i < sizeof differences / sizeof *differences; i++) {
        if (strcmp(differences[i].profile, p->name) != 0) continue;
        if (!fields_set(&psa2_fields, p, differences[i].key, differences[i].index, differences[i].text, why, cap))
            return false;
    }
    return psa2_profile_check(p, why, cap);
}

/* ---- lines ---- */

static int64_t now_ns(const struct psabench_part *p)
{
    return p->bench->sched.now_ns;
}

/* What a line's level is made of: an expression of the board b. */
#define GET_LINE(name, expression)                                                                                     \
    static bool get_##name(const struct psabench_part *p, unsigned arg)                                                \
    {                                                                                                                  \
        const struct psa2 *b = &const_part_of(p)->board;                                                               \
        (void)arg;                                                                                                     \
        return expression;                                                                                             \
    }                                                                                                                  \
    struct part_psa2 /* so that a semicolon has to follow */

GET_LINE(drd_a, ads1282_drdy(&b->adc[0]));
GET_LINE(drd_t, ads1256_drdy(&b->tadc));
GET_LINE(sync_a, b->pulse.active && b->pulse.group == PSA2_ACCEL);
GET_LINE(sync_t, !(b->pulse.active && b->pulse.group == PSA2_TEMP));
GET_LINE(cst, b->spi.phase == PSA2_SPI_IDLE || b->spi.x.group != PSA2_TEMP);
GET_LINE(int, !(b->out.busy && now_ns(p) >= b->out.f.t_int_fall_ns));
GET_LINE(res, b->mode != PSA2_IN_RESET);

/* INT falls on the grid of CLK, which is no event without observers. */
static int64_t next_ns(const struct psabench_part *p)
{
    const struct psa2_out *out = &const_part_of(p)->board.out;
    return out->busy && now_ns(p) < out->f.t_int_fall_ns ? out->f.t_int_fall_ns : INT64_MAX;
}

/* The board makes a pulse of its own length of a fall. */
static void set_res(struct psabench_part *p, unsigned arg, bool level, int64_t t_ns)
{
    (void)arg;
    if (!level && get_res(p, 0)) psa2_reset(&part_of(p)->board, t_ns);
}

static const struct api_pin pins[PSA2_LINES] = {
    [PSA2_LINE_SYNC_A] = {.name = "SYNC_A", .dir = API_OUT, .get = get_sync_a},
    [PSA2_LINE_SCLK] = {.name = "SClk", .dir = API_OUT},
    [PSA2_LINE_DRD_A] = {.name = "DRD_A", .dir = API_OUT, .get = get_drd_a},
    [PSA2_LINE_DIN] = {.name = "DIn", .dir = API_OUT},
    [PSA2_LINE_DOUTX] = {.name = "DOutX", .dir = API_OUT},
    [PSA2_LINE_DOUTY] = {.name = "DOutY", .dir = API_OUT},
    [PSA2_LINE_DOUTZ] = {.name = "DOutZ", .dir = API_OUT},
    [PSA2_LINE_SYNC_T] = {.name = "SYNC_T", .dir = API_OUT, .get = get_sync_t},
    [PSA2_LINE_CST] = {.name = "CST", .dir = API_OUT, .get = get_cst},
    [PSA2_LINE_DRD_T] = {.name = "DRD_T", .dir = API_OUT, .get = get_drd_t},
    [PSA2_LINE_DINT] = {.name = "DInT", .dir = API_OUT},
    [PSA2_LINE_DOUTT] = {.name = "DOutT", .dir = API_OUT},
    [PSA2_LINE_RES] = {.name = "Res", .dir = API_BOTH, .set = set_res, .get = get_res},
    [PSA2_LINE_DATA] = {.name = "Data", .dir = API_OUT},
    [PSA2_LINE_CLK] = {.name = "CLK", .dir = API_OUT},
    [PSA2_LINE_INT] = {.name = "Int", .dir = API_OUT, .get = get_int},
};

static void on_edge(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct part_psa2 *s = ctx;
    const uint32_t bit = UINT32_C(1) << sig;
    if (s->attaching) s->part.level = level ? s->part.level | bit : s->part.level & ~bit;
    else api_edge(&s->part, sig, level, t_ns);
}

static void on_steps(void *ctx, const struct trace_step *step, unsigned n)
{
    const struct part_psa2 *s = ctx;
    trace_each(step, n, s->sink[s->attached].mask, on_edge, ctx);
}

/* The observed lines go to one sink. Another set of lines: a new sink is attached before the old one goes, for a trace
 * without sinks throws away what it still holds back. */
static void attach_sink(struct part_psa2 *s)
{
    const uint32_t want = s->part.watched | s->part.recorded;
    struct trace_sink *old = &s->sink[s->attached];
    if (want == old->mask) return;
    s->attached ^= 1u;
    struct trace_sink *new = &s->sink[s->attached];
    *new = (struct trace_sink){.mask = want, .steps = on_steps, .ctx = s};
    s->attaching = true;
    if (want) trace_attach(&s->board.base.trace, new);
    s->attaching = false;
    trace_detach(&s->board.base.trace, old);
    old->mask = 0;
}

static void advance_trace(struct psabench_part *p, int64_t t_ns)
{
    struct part_psa2 *s = part_of(p);
    if (p->inside) return;
    attach_sink(s);
    p->inside++;
    trace_advance(&s->board.base.trace, t_ns);
    p->inside--;
}

static void follow_trace(struct psabench_part *p, int64_t t_ns)
{
    advance_trace(p, t_ns - TRACE_LAG_NS);
}

/* ---- the board ---- */

static void accel_input(void *ctx, unsigned axis, const struct looks *at, double *out)
{
    for (unsigned i = 0; i < at->n; i++) out[i] = api_input(ctx, axis, at->t_ns[i]);
}

static double temp_degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)t_ns;
    const struct psabench_part *p = ctx;
    return channel < TEMPS ? p->volts[TEMP_INPUT + channel] : 0.0;
}

static void on_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    (void)t_ns;
    struct psabench_part *p = ctx;
    if (!p->frame) return;
    struct psabench_frame out = {.size = sizeof out,
                                 .seq = f->seq,
                                 .t_sample_ns = f->t_sample_ns,
                                 .t_int_fall_ns = f->t_int_fall_ns,
                                 .t_int_rise_ns = f->t_int_rise_ns,
                                 .temp_code = f->temp_code,
                                 .temp_channel = f->temp_channel,
                                 .status = f->status};
    memcpy(out.code, f->code, sizeof out.code);
    memcpy(out.word, f->word, sizeof out.word);
    p->inside++;
    p->frame(p->frame_ctx, p, &out);
    p->inside--;
}

static void open_psa2(struct psabench_part *p)
{
    struct part_psa2 *s = part_of(p);
    struct psa2_profile profile;
    char why[API_WHY];
    const bool runs = api_psa2_profile(s->profile, &profile, why, sizeof why);
    assert(runs); /* a test holds all of them against the check */
    (void)runs;
    const uint64_t serial = api_serial(p);
    struct board_cfg unit = {.adc_noise_scale = s->noise_scale,
                             .temp_noise_scale = s->temp_noise_scale,
                             .seed = p->bench->seed,
                             .adc_chain = (enum ads1282_chain)s->chain,
                             .serial = (uint32_t)(serial ^ serial >> 32)};
    for (unsigned i = 0; i < 3; i++) unit.afe[i] = afe_nominal(s->input == 0 ? AFE_VOLTAGE : AFE_CURRENT);
    for (unsigned i = 0; i < TEMPS; i++) p->volts[TEMP_INPUT + i] = s->temp_degc;
    const struct board_io io = {.ctx = p, .accel = accel_input, .temp_degc = temp_degc};
    psa2_init(&s->board, &profile, &unit, &io, &p->bench->sched);
    s->board.host = (struct psa2_host){.ctx = p, .frame = on_frame};
    psa2_power_up(&s->board, now_ns(p));
}

static void before_input(struct psabench_part *p, int64_t t_ns)
{
    psa2_sample_until(&part_of(p)->board, t_ns);
}

/* Group 0..2 X, Y, Z, 3 temperature, above the eight bits of the register's address. */
static int peek_register(const struct psabench_part *p, unsigned address)
{
    const struct psa2 *b = &const_part_of(p)->board;
    const unsigned group = address >> 8;
    const struct reg_file *f = group < 3 ? &b->adc[group].regs : &b->tadc.regs;
    return group < 4 && (address & 0xFF) < f->count ? reg_peek(f, address & 0xFF) : -1;
}

/* ---- registers through the controller ---- */

static void on_request_done(void *ctx, struct psa2_request *r, enum psa2_result result, int64_t t_ns)
{
    (void)r;
    (void)t_ns;
    struct part_psa2 *s = ctx;
    s->pending = false;
    s->result = result;
}

/* Hands the request over, once the board has finished its set-up and whatever was asked before. */
static enum psa2_result submit_request(struct part_psa2 *s, const struct psa2_request *r, int64_t end_ns)
{
    psabench *b = s->part.bench;
    for (;;) {
        enum psa2_result result = PSA2_BUSY;
        if (!s->pending) {
            s->request = *r;
            result = psa2_submit(&s->board, &s->request, b->sched.now_ns);
        }
        const int64_t event_ns = sched_next_ns(&b->sched);
        if (result != PSA2_BUSY || event_ns > end_ns) return result;
        api_move(b, event_ns);
    }
}

static enum psa2_result carry_out(struct part_psa2 *s, const struct psa2_request *r, int64_t timeout_ns)
{
    psabench *b = s->part.bench;
    const int64_t end_ns = b->sched.now_ns + timeout_ns;
    b->inside++;
    enum psa2_result result = submit_request(s, r, end_ns);
    if (result == PSA2_OK) {
        s->pending = true;
        while (s->pending && sched_next_ns(&b->sched) <= end_ns) api_move(b, sched_next_ns(&b->sched));
        result = s->pending ? PSA2_BUSY : s->result;
    }
    if (result == PSA2_BUSY) api_move(b, end_ns);
    b->inside--;
    return result;
}

static int no_access(psabench_part *p, unsigned group, unsigned address, int64_t timeout_ns, const char *function)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    if (!p->kind->board)
        return api_fail(p->bench, PSABENCH_NOT_HERE, "%s: %s: expected a board, got %s", p->name, function,
                        p->kind->name);
    if (group > 3 || address > 0xFF || timeout_ns < 0 || timeout_ns > API_TIME_MAX_NS - now_ns(p))
        return api_fail(p->bench, PSABENCH_BAD_ARGUMENT,
                        "%s: %s: expected a group of 0 to 3, a register of 0 to 255 and a time, got %u, %u, %lld ns",
                        p->name, function, group, address, (long long)timeout_ns);
    const int may = api_may_move(p->bench, function);
    return may ? may : api_late(p->bench);
}

static int fail_request(const struct part_psa2 *s, enum psa2_result result, unsigned group, unsigned address)
{
    static const struct {
        int code;
        const char *text;
    } row[] = {
        [PSA2_NO_SUCH_REG] = {PSABENCH_BAD_ARGUMENT, "no such register in the converter"},
        [PSA2_READ_ONLY] = {PSABENCH_REFUSED, "read-only"},
        [PSA2_BAD_VALUE] = {PSABENCH_REFUSED, "value rejected by the converter"},
        [PSA2_BUSY] = {PSABENCH_TIMEOUT, "not within the time given"},
        [PSA2_TIMEOUT] = {PSABENCH_TIMEOUT, "no data-ready of the converter"},
    };
    return api_fail(s->part.bench, row[result].code, "%s: group %u, register %02Xh: %s", s->part.name, group, address,
                    row[result].text);
}

/* r: what to do, and the value; the answer is in the part's request afterwards. */
static int access_register(psabench_part *p, unsigned group, unsigned address, struct psa2_request r,
                           int64_t timeout_ns, const char *function)
{
    const int bad = no_access(p, group, address, timeout_ns, function);
    if (bad) return bad;
    struct part_psa2 *s = part_of(p);
    r.group = group < 3 ? PSA2_ACCEL : PSA2_TEMP;
    r.addr = (uint8_t)address;
    r.done = on_request_done;
    r.ctx = s;
    const enum psa2_result result = carry_out(s, &r, timeout_ns);
    const int answer = s->request.answer[group % 3];
    api_serve(p->bench); /* whose handlers may ask the board, too */
    return result == PSA2_OK ? answer : fail_request(s, result, group, address);
}

int psabench_board_read(psabench_part *p, unsigned group, unsigned address, int64_t timeout_ns)
{
    const struct psa2_request r = {.op = PSA2_READ_REG};
    return access_register(p, group, address, r, timeout_ns, "psabench_board_read()");
}

int psabench_board_write(psabench_part *p, unsigned group, unsigned address, uint8_t value, int64_t timeout_ns)
{
    const struct psa2_request r = {.op = PSA2_WRITE_REG, .value = value};
    const int code = access_register(p, group, address, r, timeout_ns, "psabench_board_write()");
    return code < 0 ? code : PSABENCH_OK;
}

int psabench_on_frame(psabench_part *p, psabench_frame_fn *fn, void *ctx)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    if (!p->kind->board)
        return api_fail(p->bench, PSABENCH_NOT_HERE, "%s: expected a board with frames, got %s", p->name,
                        p->kind->name);
    p->frame = fn;
    p->frame_ctx = ctx;
    return PSABENCH_OK;
}

static const struct api_counter counters[] = {
    API_COUNTER("frames", part_psa2, board.counters.frames),
    API_COUNTER("resets", part_psa2, board.counters.resets),
    API_COUNTER("requests", part_psa2, board.counters.requests),
    API_COUNTER("timeouts", part_psa2, board.counters.timeouts),
    API_COUNTER("overruns", part_psa2, board.counters.overruns),
    API_COUNTER("int_late", part_psa2, board.counters.int_late),
    API_VIOLATION("edges_dropped", part_psa2, board.base.trace.dropped),
    API_VIOLATION("edges_late", part_psa2, board.base.trace.late),
};

const struct api_kind api_psa2 = {
    .name = "psa2",
    .size = sizeof(struct part_psa2),
    .options = API_ROWS(options),
    .options_text = OPTIONS(API_OPTION_TEXT),
    .pins = pins,
    .pin_count = PSA2_LINES,
    .counters = API_ROWS(counters),
    .inputs = 0x7F,
    .fn_inputs = 0x07,
    .spi = API_NO_SPI,
    .open = open_psa2,
    .before_input = before_input,
    .follow = follow_trace,
    .finish = advance_trace,
    .peek = peek_register,
    .next_ns = next_ns,
    .lag_ns = TRACE_LAG_NS,
    .board = true,
};

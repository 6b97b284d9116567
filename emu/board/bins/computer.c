/* The unit's computer: sums the words of the PSA-2, latches the gyros where a sum ends, and hands out the increments. */
#include "board/bins/bins.h"

#include <math.h>
#include <string.h>

#define NS_A_SECOND  INT64_C(1000000000)
#define CODE_FULL    8388608.0
#define LATE_PART    8 /* of a word: later than that it is late */
#define TEMPERATURES 4u

const struct board_line bins_lines[BINS_LINES] = {PSA2_LINE_ROWS, [BINS_LINE_TICK] = {"TICK", false}};
const char *const bins_events[BINS_EVENTS] = {
    PSA2_EVENT_LIST(BOARD_EVENT_NAME)[BINS_EV_LATCH] = "LATCH", [BINS_EV_READING] = "READING"};

/* ---- what the unit knows of its converters */

int64_t bins_word_ns(const struct bins *b)
{
    return NS_A_SECOND / b->profile.accel_sps;
}

/* A word is of the instant one delay ago, and covers half a word before and after it. */
static int64_t delay_ns(const struct bins *b)
{
    return ads1282_delay_ns(&b->psa2.adc[0]) - bins_word_ns(b) / 2;
}

int64_t bins_accel_age_ns(const struct bins *b)
{
    return b->profile.aligned ? 0 : delay_ns(b);
}

/* Of the whole chain: accelerometer, divider, gain, reference, and the filter's own gain at DC. */
double bins_accel_mps_per_code(const struct bins *b)
{
    const struct psa2_profile *p = &b->psa2.profile;
    const double full_v = p->adc_vref_v / (2.0 * p->adc_pga) * b->psa2.base.cfg.afe[0].divider_ratio;
    const double code_mps2 = full_v / CODE_FULL / b->profile.accel_v_per_g * BINS_STANDARD_G_MPS2;
    return code_mps2 / ads1282_dc_gain(&b->psa2.adc[0]) * 1e-9 * (double)bins_word_ns(b);
}

/* ---- readings */

static uint32_t last_word_of(const struct bins *b, uint32_t interval)
{
    return (interval + 1) * b->profile.words_per_reading - 1;
}

static uint8_t flags_of(const struct bins *b, const struct bins_latch *at)
{
    const struct bins_sums *s = &b->sums;
    uint8_t flags = s->incomplete ? BINS_INCOMPLETE : 0;
    if (s->status & PSA2_ST_SETTLED) flags |= BINS_SETTLED;
    if (s->status & PSA2_ST_CLIP) flags |= BINS_CLIP;
    if (s->temp_new) flags |= BINS_TEMP_NEW;
    if (at->last_word - s->from.last_word != b->profile.words_per_reading) flags |= BINS_STRETCHED;
    return flags;
}

static void take_increments(struct bins *b, const struct bins_latch *at)
{
    struct bins_reading *r = &b->latest;
    for (unsigned i = 0; i < 3; i++) {
        r->gyro[i] = (int32_t)(at->count[i] - b->sums.from.count[i]);
        r->accel[i] = (int32_t)b->sums.sum[i];
    }
    r->words = (uint8_t)b->sums.words;
    r->flags = flags_of(b, at);
}

static int32_t baro_mm(const struct bins *b)
{
    const struct board_io *io = &b->psa2.base.io;
    if (!io->baro_m) return 0;
    return (int32_t)floor(fmin(fmax(io->baro_m(io->ctx, b->latest.t_ns) * 1e3, INT32_MIN), INT32_MAX - 1.0) + 0.5);
}

static void send_reading(struct bins *b, const struct bins_latch *at, int64_t t_ns)
{
    if (!(b->psa2.base.faults & BINS_FAULT_FROZEN_WORDS)) take_increments(b, at);
    b->latest.seq++;
    b->latest.t_ns = at->t_ns;
    b->latest.baro_mm = baro_mm(b);
    b->counters.readings++;
    b->counters.saturated += (b->latest.flags & BINS_CLIP) != 0;
    board_notify(&b->psa2.base, BINS_EV_READING, t_ns);
    if (b->host.reading) b->host.reading(b->host.ctx, &b->latest, t_ns);
    if (!bins_nav_take(&b->nav, &b->latest)) return;
    if (b->host.navigated) b->host.navigated(b->host.ctx, t_ns);
    bins_nav_shown(&b->nav);
}

/* The first latch is where the first reading begins. */
static void begin_sums(struct bins_sums *s, const struct bins_latch *from)
{
    s->based = true;
    s->from = *from;
    s->words = 0;
    s->incomplete = s->temp_new = false;
    s->status = PSA2_ST_SETTLED;
    memset(s->sum, 0, sizeof s->sum);
}

/* Those whose last word is not after this one. */
static void complete_until(struct bins *b, uint32_t word, int64_t t_ns)
{
    struct bins_sums *s = &b->sums;
    while (s->count > 0 && s->latch[s->first].last_word <= word) {
        const struct bins_latch at = s->latch[s->first];
        s->first = (s->first + 1) % BINS_LATCHES;
        s->count--;
        if (s->based) send_reading(b, &at, t_ns);
        begin_sums(s, &at);
    }
}

/* ---- latches */

static void put_tick(struct bins *b, int64_t t_ns)
{
    trace_set(&b->psa2.base.trace, BINS_LINE_TICK, true, t_ns);
    trace_set(&b->psa2.base.trace, BINS_LINE_TICK, false, t_ns + BINS_TICK_PULSE_NS);
}

static void latch_gyros(void *ctx, int64_t t_ns)
{
    struct bins *b = ctx;
    struct bins_sums *s = &b->sums;
    if (s->count == BINS_LATCHES) { /* words have long stopped */
        s->first = (s->first + 1) % BINS_LATCHES;
        s->count--;
        b->counters.missed_latches++;
    }
    struct bins_latch *l = &s->latch[(s->first + s->count++) % BINS_LATCHES];
    l->last_word = last_word_of(b, s->next++);
    l->t_ns = t_ns;
    bins_gyro_counts(b, t_ns, l->count);
    put_tick(b, t_ns);
    board_notify(&b->psa2.base, BINS_EV_LATCH, t_ns);
}

static int64_t latch_ns(const struct bins *b)
{
    const int64_t words = (int64_t)last_word_of(b, b->sums.next) - (int64_t)b->sums.word;
    return b->sums.word_ns + words * bins_word_ns(b) - (b->profile.aligned ? b->sums.delay_ns : 0);
}

/* Of the first interval whose end is still to come; each frame tells it better, and one that is lost leaves it. */
static void arm_latch(struct bins *b, int64_t t_ns)
{
    struct bins_sums *s = &b->sums;
    while (latch_ns(b) <= t_ns) {
        b->counters.missed_latches += s->based;
        s->next++;
    }
    sched_at(b->psa2.base.sched, &s->ev, latch_ns(b));
}

/* ---- frames of the PSA-2 */

/* Its number, by the time since the word before: a lost data-ready counts, a lost frame too. The same number again: the one
 * before came so late that it was taken for this one. */
static uint32_t number_of(const struct bins *b, const struct psa2_frame *f)
{
    const struct bins_sums *s = &b->sums;
    const int64_t word_ns = bins_word_ns(b), words = (f->t_sample_ns - s->word_ns + word_ns / LATE_PART) / word_ns;
    if (s->word_ns < 0) return 0;
    return s->word + (uint32_t)words;
}

/* When it was due: a data-ready is late where its pin was stuck, and does not move what follows. */
static int64_t due_ns(const struct bins *b, const struct psa2_frame *f, uint32_t number)
{
    const struct bins_sums *s = &b->sums;
    const int64_t word_ns = bins_word_ns(b), at_ns = s->word_ns + (int64_t)(number - s->word) * word_ns;
    return s->word_ns >= 0 && f->t_sample_ns - at_ns > word_ns / LATE_PART ? at_ns : f->t_sample_ns;
}

static void add_word(struct bins *b, const struct psa2_frame *f, uint32_t number)
{
    struct bins_sums *s = &b->sums;
    const uint32_t missing = s->word_ns < 0 ? 0 : number - s->word - 1; /* wraps: one less than was thought */
    b->counters.missed_words += missing;
    s->incomplete |= missing != 0;
    s->word_ns = due_ns(b, f, number);
    s->word = number;
    s->words++;
    for (unsigned i = 0; i < 3; i++) s->sum[i] += f->code[i];
    s->status = (uint8_t)((s->status & f->status & PSA2_ST_SETTLED) | ((s->status | f->status) & PSA2_ST_CLIP));
    if (f->status & PSA2_ST_TEMP_NEW) {
        b->temp_code[f->temp_channel % TEMPERATURES] = f->temp_code;
        s->temp_new = true;
    }
}

static void on_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct bins *b = ctx;
    const uint32_t number = number_of(b, f);
    if (b->sums.word_ns < 0) b->sums.delay_ns = delay_ns(b);
    else if (number > 0) complete_until(b, number - 1, t_ns);
    add_word(b, f, number);
    complete_until(b, number, t_ns);
    arm_latch(b, t_ns);
}

static void on_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    struct bins *b = ctx;
    if (b->host.fault) b->host.fault(b->host.ctx, code, t_ns);
}

/* ---- life */

static void clear_sums(struct bins *b)
{
    struct sched *s = b->psa2.base.sched;
    sched_cancel(s, &b->sums.ev);
    b->sums = (struct bins_sums){.word_ns = -1};
    sched_ev_inner(&b->sums.ev, latch_gyros, b);
    b->latest = (struct bins_reading){.seq = 0};
    bins_nav_stop(&b->nav);
    memset(b->temp_code, 0, sizeof b->temp_code);
}

void bins_init(struct bins *b, const struct bins_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s)
{
    struct psa2_profile inside;
    board_clear(&b->psa2.base, sizeof *b);
    bins_profile_psa2(p, &inside);
    psa2_init_inside(&b->psa2, &inside, bins_lines, BINS_LINES, cfg, io, s);
    b->profile = *p;
    b->errors = bins_profile_errors(p, cfg->seed, cfg->serial);
    b->psa2.host = (struct psa2_host){.ctx = b, .frame = on_frame, .fault = on_fault};
    b->sums.word_ns = -1;
    b->nav.set.alignment_s = BINS_ALIGNMENT_S;
    sched_ev_inner(&b->sums.ev, latch_gyros, b);
    bins_gyro_init(b);
}

void bins_power_up(struct bins *b, int64_t t_ns)
{
    clear_sums(b);
    bins_gyro_power(b, true, t_ns);
    psa2_power_up(&b->psa2, t_ns);
}

void bins_power_down(struct bins *b, int64_t t_ns)
{
    clear_sums(b);
    bins_gyro_power(b, false, t_ns);
    psa2_power_down(&b->psa2, t_ns);
}

/* The gyros' counters count on. */
void bins_reset(struct bins *b, int64_t t_ns)
{
    if (b->psa2.mode == PSA2_OFF) return;
    clear_sums(b);
    b->counters.resets++;
    psa2_reset(&b->psa2, t_ns);
}

void bins_sample_until(struct bins *b, int64_t t_ns)
{
    bins_gyro_until(b, t_ns);
    psa2_sample_until(&b->psa2, t_ns);
}

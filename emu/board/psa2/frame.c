#include "board/psa2/internal.h"

#include "base/bits.h"

static const uint32_t out_lines = 1u << PSA2_LINE_INT | 1u << PSA2_LINE_DATA | 1u << PSA2_LINE_CLK;

static uint32_t low_bits(uint32_t v, unsigned bits)
{
    return bits == 32 ? v : v & ((UINT32_C(1) << bits) - 1);
}

/* The upper code_bits of the conversion word, sign-extended to the word's width. */
static uint32_t code_word(const struct psa2_profile *p, uint32_t raw)
{
    const uint32_t code = (uint32_t)bits_sign_extend(raw >> (32 - p->code_bits), p->code_bits);
    return low_bits(code, p->word_bits);
}

/* 16-bit code, above it 4 bits of channel and 4 of status: 24 bits, of which a 16-bit word keeps the code. */
static uint32_t temp_word(const struct psa2_profile *p, const struct psa2_frame *f)
{
    const uint32_t w = f->temp_code | (uint32_t)(f->temp_channel & 0xF) << 16 | (uint32_t)(f->status & 0xF) << 20;
    return low_bits(w, p->word_bits);
}

static void pack_words(const struct psa2_profile *p, struct psa2_frame *f)
{
    for (unsigned i = 0; i < PSA2_WORDS; i++)
        f->word[i] = p->word[i] == PSA2_WORD_T ? temp_word(p, f) : code_word(p, f->raw[p->word[i]]);
}

#define CLK  (UINT32_C(1) << PSA2_LINE_CLK)
#define DATA (UINT32_C(1) << PSA2_LINE_DATA)

/* Edges of the next word up to an instant: DATA changes where CLK falls, CLK runs only while bits are sent. */
static void report_word(struct psa2 *b, int64_t until_ns)
{
    struct psa2_out *o = &b->out;
    const uint32_t word = o->f.word[o->watched_words++];
    const struct clk_step one = o->one;
    struct clk_pos at = o->at;
    o->at = clk_on(o->at, &o->word_gap);
    struct trace_step *const step = trace_room(&b->base.trace, 3 * 32 + 1), *p = step;
    if (!step) return;
    uint64_t level = (uint64_t)word << PSA2_LINE_DATA; /* beside DATA it means nothing */
    uint64_t changes = word ^ (uint64_t)word << 1;     /* DATA rests low before the first bit and after the last */
    for (unsigned bit = 0; bit < b->profile.word_bits; bit++, level >>= 1, changes >>= 1) {
        *p = (struct trace_step){at.t_ns, DATA, level};
        p += changes & 1; /* no branch: data cannot be predicted */
        at = clk_on(at, &one);
        *p++ = (struct trace_step){at.t_ns, CLK, CLK};
        at = clk_on(at, &one);
        *p++ = (struct trace_step){at.t_ns, CLK, 0};
    }
    *p++ = (struct trace_step){at.t_ns, changes & 1 ? DATA : 0, 0};
    if (at.t_ns <= until_ns) {
        trace_commit_run(&b->base.trace, (unsigned)(p - step), CLK | DATA);
        return;
    }
    while (p > step && p[-1].t_ns > until_ns) p--;
    trace_commit(&b->base.trace, (unsigned)(p - step));
}

static void skip_word(struct psa2_out *o)
{
    o->watched_words++;
    o->at = clk_on(o->at, &o->word_gap);
}

static void report_int(struct psa2 *b, int64_t t_ns)
{
    struct psa2_out *o = &b->out;
    trace_set(&b->base.trace, PSA2_LINE_INT, false, t_ns);
    o->watched_words = 0;
    o->at = clk_on(o->start, &o->lead);
}

/* Runs only while the line is watched: at INT fall, then at the end of each word but the last. */
static void word_event(void *ctx, int64_t t_ns)
{
    struct psa2 *b = ctx;
    struct psa2_out *o = &b->out;
    do {
        if (o->watched_words < 0) report_int(b, t_ns);
        else report_word(b, t_ns);
        if ((unsigned)o->watched_words + 1 >= PSA2_WORDS) return;
        t_ns = clk_on(o->at, &o->bits).t_ns;
    } while (sched_go_on(b->base.sched, t_ns));
    sched_at(b->base.sched, &o->word, t_ns);
}

/* The frame under way, unwatched so far: its edges up to now as far as the trace still takes them, then as if it had been
 * watched from the beginning. */
void psa2_out_wake(struct psa2 *b, int64_t t_ns)
{
    struct psa2_out *o = &b->out;
    if (!o->busy || o->watched_words >= 0 || o->word.queued) return;
    int64_t next_ns = o->f.t_int_fall_ns;
    if (next_ns <= t_ns) {
        const int64_t known_ns = b->base.trace.done_ns;
        if (next_ns < known_ns) trace_set(&b->base.trace, PSA2_LINE_INT, false, known_ns); /* a level, no edge */
        else trace_steps(&b->base.trace, &(struct trace_step){next_ns, UINT32_C(1) << PSA2_LINE_INT, 0}, 1);
        o->watched_words = 0;
        o->at = clk_on(o->start, &o->lead);
        while ((unsigned)o->watched_words < PSA2_WORDS && o->at.t_ns < known_ns) skip_word(o);
        while ((unsigned)o->watched_words + 1 < PSA2_WORDS && (next_ns = clk_on(o->at, &o->bits).t_ns) <= t_ns)
            report_word(b, t_ns);
        if ((unsigned)o->watched_words + 1 >= PSA2_WORDS) return; /* the last word is int_rise()'s */
    }
    sched_at(b->base.sched, &o->word, next_ns);
}

/* The rest of a watched frame, up to now, and idle lines. */
static void finish_watched(struct psa2 *b, int64_t t_ns)
{
    struct psa2_out *o = &b->out;
    sched_cancel(b->base.sched, &o->word);
    if (o->watched_words < 0) return;
    while ((unsigned)o->watched_words < PSA2_WORDS && o->at.t_ns <= t_ns) report_word(b, t_ns);
    const uint32_t idle = b->mode == PSA2_OFF ? 0 : UINT32_C(1) << PSA2_LINE_INT;
    trace_steps(&b->base.trace, &(struct trace_step){t_ns, out_lines, idle}, 1);
    o->watched_words = -1;
}

static void int_rise(void *ctx, int64_t t_ns)
{
    struct psa2 *b = ctx;
    finish_watched(b, t_ns);
    b->out.busy = false;
    b->counters.frames++;
    board_notify(&b->base, PSA2_EV_INT_RISE, t_ns);
    if (b->host.frame) b->host.frame(b->host.ctx, &b->out.f, t_ns);
    psa2_lazy_frame(b, t_ns);
}

static void int_fall(void *ctx, int64_t t_ns)
{
    board_notify(ctx, PSA2_EV_INT_FALL, t_ns);
}

void psa2_out_init(struct psa2 *b)
{
    struct psa2_out *o = &b->out;
    o->half = (struct clk){.hz = 2 * (int64_t)b->profile.line_hz, .div = b->profile.line_div};
    o->one = clk_step(&o->half, 1);
    o->lead = clk_step(&o->half, 2 * (int64_t)b->profile.lead_in_clk);
    o->bits = clk_step(&o->half, 2 * (int64_t)b->profile.word_bits);
    o->word_gap = clk_step(&o->half, 2 * (int64_t)(b->profile.word_bits + PSA2_GAP_CLK));
    o->frame = clk_step(&o->half, 2 * (int64_t)psa2_frame_clks(&b->profile));
    o->watched_words = -1;
    sched_ev_inner(&o->rise, int_rise, b);
    sched_ev_inner(&o->word, word_event, b);
    sched_ev_inner(&o->fall, int_fall, b);
}

void psa2_out_start(struct psa2 *b, int64_t t_ns)
{
    struct psa2_out *o = &b->out;
    struct psa2_frame *f = &b->latest;
    if (o->busy) {
        b->counters.int_late++;
        return;
    }
    o->busy = true;
    o->start = clk_pos_at(&o->half, t_ns);
    if (o->start.k & 1) o->start = clk_on(o->start, &o->one);
    f->t_int_fall_ns = o->start.t_ns;
    f->t_int_rise_ns = clk_on(o->start, &o->frame).t_ns;
    pack_words(&b->profile, f);
    sched_at(b->base.sched, &o->rise, f->t_int_rise_ns);
    if (trace_watched(&b->base.trace, out_lines)) sched_at(b->base.sched, &o->word, f->t_int_fall_ns);
    if (b->base.observed) sched_at(b->base.sched, &o->fall, f->t_int_fall_ns);
    o->f = *f;
}

void psa2_out_stop(struct psa2 *b, int64_t t_ns)
{
    finish_watched(b, t_ns);
    sched_cancel(b->base.sched, &b->out.rise);
    sched_cancel(b->base.sched, &b->out.fall);
    b->out.busy = false;
}

/* What moves all the time or in long rows: 1M25, and SCLK and SDAT of a frame. Reported while watched, from forms that
 * are laid out once: a copy with the word's bits in it, a few instructions an edge. */
#include "board/psd1/wave.h"

#include "board/psd1/internal.h"

#define CLK    PSD1_BIT(CLK)
#define SCLK   PSD1_BIT(SCLK)
#define SDAT   PSD1_BIT(SDAT)
#define NO_BIT 31 /* a bit of the left-justified word that is always 0 */

enum { CLOCK_CHUNK = 2048 }; /* edges of 1M25 reported at once: far below TRACE_PENDING_MAX */

static const struct {
    unsigned bits;
    bool write;
    int64_t len_ns;
} forms[PSD1_FORMS] = {
    [PSD1_FORM_READ16] = {16, false, PSD1_READ16_NS},
    [PSD1_FORM_READ24] = {24, false, PSD1_FRAME24_NS},
    [PSD1_FORM_WRITE24] = {24, true, PSD1_FRAME24_NS},
};

/* ---- forms ---- */

static void add_edges(struct psd1_wave_form *f, int64_t t_ns, uint64_t lines, uint64_t level, int8_t bit)
{
    struct psd1_wave_step *at = f->step + f->count++;
    for (; at > f->step && at[-1].s.t_ns > t_ns; at--) at[0] = at[-1];
    *at = (struct psd1_wave_step){{t_ns, lines, level}, bit};
}

/* SDAT: a converter shows its bits after their access times, the controller at the fall of TFS and at those of SCLK; after
 * the last bit it stays until the frame ends (E0). */
static void lay_out(struct psd1_wave_form *f, const struct psd1_profile *p, enum psd1_form form, bool clock)
{
    const unsigned bits = forms[form].bits;
    const int64_t first_ns = forms[form].write ? 0 : p->rfs_access_ns;
    const int64_t later_ns = forms[form].write ? 0 : p->bit_access_ns;
    f->count = 0;
    for (unsigned i = 0; i < bits; i++) {
        const int64_t rise_ns = PSD1_SCLK_NS + (int64_t)i * PSD1_PERIOD_NS, fall_ns = rise_ns + PSD1_HALF_NS;
        add_edges(f, i ? fall_ns - PSD1_PERIOD_NS + later_ns : first_ns, SDAT, 0, (int8_t)i);
        add_edges(f, rise_ns, SCLK, SCLK, NO_BIT);
        add_edges(f, fall_ns, SCLK, 0, NO_BIT);
    }
    for (int64_t t_ns = PSD1_HALF_NS; clock && t_ns <= forms[form].len_ns; t_ns += PSD1_HALF_NS)
        add_edges(f, t_ns, CLK, t_ns % PSD1_PERIOD_NS ? CLK : 0, NO_BIT);
    add_edges(f, forms[form].len_ns, SDAT, 0, (int8_t)bits);
}

/* ---- reporting ---- */

static uint32_t left_justified(const struct psd1_frame *f)
{
    return f->word << (32 - forms[f->form].bits);
}

static const struct psd1_wave_form *form_of(const struct psd1 *b)
{
    return &b->wave.form[b->frame.form][b->wave.clock_on];
}

/* Steps of the frame up to t_ns; true when it was the last. */
static bool report_frame(struct psd1 *b, int64_t t_ns)
{
    struct psd1_wave *w = &b->wave;
    const struct psd1_wave_form *f = form_of(b);
    const int64_t t0_ns = b->frame.t_ns;
    const bool whole = w->next == 0 && t_ns >= t0_ns + forms[b->frame.form].len_ns;
    struct trace_step *const room = trace_room(&b->base.trace, f->count - w->next), *p = room;
    const uint32_t word = left_justified(&b->frame);
    unsigned i = w->next, sdat = w->sdat;
    for (; i < f->count && t0_ns + f->step[i].s.t_ns <= t_ns && room; i++) {
        const struct psd1_wave_step *s = &f->step[i];
        const unsigned bit = word << s->bit >> 31, other = s->bit == NO_BIT;
        *p = (struct trace_step){t0_ns + s->s.t_ns, s->s.lines, s->s.level | (uint64_t)bit << PSD1_LINE_SDAT};
        p += other | (bit ^ sdat); /* no branch: data cannot be predicted */
        sdat = other ? sdat : bit;
    }
    w->next = room ? i : f->count;
    w->sdat = sdat;
    if (room && whole)
        trace_commit_run(&b->base.trace, (unsigned)(p - room), w->clock_on ? SCLK | SDAT | CLK : SCLK | SDAT);
    else if (room) trace_commit(&b->base.trace, (unsigned)(p - room));
    return w->next == f->count;
}

/* Up to CLOCK_CHUNK edges of 1M25, none after t_ns: pulses, or the one edge that is left of a pulse. */
static void report_clock(struct psd1 *b, int64_t t_ns)
{
    struct psd1_wave *w = &b->wave;
    const int64_t due = (t_ns - w->clock_ns) / PSD1_HALF_NS + 1;
    const bool rises = (w->clock_ns - b->t0_ns) % PSD1_PERIOD_NS == 0;
    const unsigned n = !rises || due == 1 ? 1 : (due < CLOCK_CHUNK ? (unsigned)due : CLOCK_CHUNK) & ~1u;
    struct trace_step *const room = trace_room(&b->base.trace, n), *const end = room + n;
    int64_t at_ns = w->clock_ns;
    w->clock_ns += (int64_t)n * PSD1_HALF_NS;
    if (!room) return;
    if (n == 1) {
        *room = (struct trace_step){at_ns, CLK, rises ? CLK : 0};
        trace_commit(&b->base.trace, 1);
        return;
    }
    for (struct trace_step *p = room; p < end; p += 2, at_ns += PSD1_PERIOD_NS) {
        p[0] = (struct trace_step){at_ns, CLK, CLK};
        p[1] = (struct trace_step){at_ns + PSD1_HALF_NS, CLK, 0};
    }
    trace_commit_run(&b->base.trace, n, CLK);
}

static void report_until(struct psd1 *b, int64_t t_ns)
{
    struct psd1_wave *w = &b->wave;
    if (w->frame_on) {
        if (!report_frame(b, t_ns)) return;
        w->frame_on = false;
        w->clock_ns = b->frame.t_ns + forms[b->frame.form].len_ns + PSD1_HALF_NS;
    }
    while (w->clock_on && w->clock_ns <= t_ns) report_clock(b, t_ns);
    w->on = w->clock_on;
}

/* A long way without trace_advance(): room is made in time. */
void psd1_wave_catch_up(struct psd1 *b, int64_t t_ns)
{
    const struct psd1_wave *w = &b->wave;
    const int64_t piece_ns = CLOCK_CHUNK * (int64_t)PSD1_HALF_NS;
    while (w->clock_on && t_ns - w->clock_ns > piece_ns) {
        const int64_t to_ns = w->clock_ns + piece_ns;
        report_until(b, to_ns);
        trace_advance(&b->base.trace, to_ns - TRACE_LAG_NS);
    }
    if (b->base.trace.pending_count > TRACE_PENDING_MAX / 2) trace_advance(&b->base.trace, t_ns - TRACE_LAG_NS);
    report_until(b, t_ns);
}

void psd1_frame_begin(struct psd1 *b, enum psd1_form form, uint32_t word, int64_t t_ns)
{
    struct psd1_wave *w = &b->wave;
    if (w->on) psd1_wave_catch_up(b, t_ns);
    b->frame = (struct psd1_frame){true, form, word, t_ns};
    if (!trace_watched(&b->base.trace, SCLK | SDAT)) return;
    w->on = w->frame_on = true;
    w->next = 0;
    w->sdat = false;
}

void psd1_frame_end(struct psd1 *b, int64_t t_ns)
{
    struct psd1_wave *w = &b->wave;
    if (w->on) psd1_wave_catch_up(b, t_ns);
    b->frame.active = false;
    if (!w->frame_on) return;
    w->frame_on = false; /* cut */
    w->on = w->clock_on;
    w->clock_ns = t_ns + PSD1_HALF_NS - (t_ns - b->t0_ns) % PSD1_HALF_NS;
    trace_put(&b->base.trace, SCLK | SDAT, 0, t_ns);
}

/* ---- observers ---- */

/* SCLK and SDAT of the frame under way as they are at t_ns, and where its report goes on. */
static void join_frame(struct psd1 *b, int64_t t_ns)
{
    struct psd1_wave *w = &b->wave;
    const struct psd1_wave_form *f = form_of(b);
    const uint32_t word = left_justified(&b->frame);
    bool sclk = false;
    w->sdat = false;
    for (w->next = 0; w->next < f->count && b->frame.t_ns + f->step[w->next].s.t_ns <= t_ns; w->next++) {
        const struct psd1_wave_step *s = &f->step[w->next];
        if (s->bit != NO_BIT) w->sdat = word << s->bit >> 31;
        else if (s->s.lines == SCLK) sclk = s->s.level != 0;
    }
    w->on = w->frame_on = true;
    trace_put(&b->base.trace, SCLK | SDAT, (sclk ? SCLK : 0) | (w->sdat ? SDAT : 0), t_ns);
}

static void join_clock(struct psd1 *b, int64_t t_ns)
{
    struct psd1_wave *w = &b->wave;
    const int64_t since_ns = t_ns - b->t0_ns;
    w->on = w->clock_on = true;
    w->clock_ns = t_ns + PSD1_HALF_NS - since_ns % PSD1_HALF_NS;
    trace_put(&b->base.trace, CLK, since_ns % PSD1_PERIOD_NS < PSD1_HALF_NS ? CLK : 0, t_ns);
}

static void wake_lines(void *ctx, uint64_t mask)
{
    struct psd1 *b = ctx;
    const int64_t t_ns = b->base.sched->now_ns;
    if (b->phase == PSD1_OFF) return;
    const bool clock = mask & CLK && !b->wave.clock_on;
    const bool frame = mask & (SCLK | SDAT) && b->frame.active;
    if (b->wave.on) psd1_wave_catch_up(b, t_ns);
    if (clock) join_clock(b, t_ns);
    if (b->frame.active && (b->wave.frame_on ? clock : frame)) join_frame(b, t_ns);
}

static int64_t report_lines(void *ctx, int64_t t_ns)
{
    struct psd1 *b = ctx;
    struct psd1_wave *w = &b->wave;
    if (w->clock_on && !w->frame_on && !trace_watched(&b->base.trace, CLK)) w->on = w->clock_on = false;
    if (!w->on) return t_ns;
    const int64_t room_ns = w->clock_on && !w->frame_on ? w->clock_ns + CLOCK_CHUNK * (int64_t)PSD1_HALF_NS : t_ns;
    const int64_t now_ns = t_ns < b->base.sched->now_ns ? t_ns : b->base.sched->now_ns;
    report_until(b, room_ns < now_ns ? room_ns : now_ns);
    return room_ns < now_ns ? room_ns : t_ns;
}

void psd1_wave_init(struct psd1 *b)
{
    for (unsigned i = 0; i < PSD1_FORMS; i++)
        for (unsigned clock = 0; clock < 2; clock++)
            lay_out(&b->wave.form[i][clock], &b->profile, (enum psd1_form)i, clock);
    b->base.trace.source = (struct trace_source){.wake = wake_lines, .report = report_lines, .ctx = b};
}

void psd1_wave_power(struct psd1 *b, bool on, int64_t t_ns)
{
    struct psd1_wave *w = &b->wave;
    if (w->on) psd1_wave_catch_up(b, t_ns);
    w->on = w->clock_on = w->frame_on = false;
    if (on && trace_watched(&b->base.trace, CLK)) join_clock(b, t_ns);
}

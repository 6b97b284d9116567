/* The read-out cycle: A0, then for X, Y, Z the word into РК, FL2, the strobe (article, section 4; sources 4.5). */
#include "board/psd1/internal.h"

uint32_t psd1_lost(struct psd1 *b)
{
    uint32_t *const lost[3] = {&b->counters.lost_x, &b->counters.lost_y, &b->counters.lost_z};
    uint32_t sum = 0;
    for (unsigned i = 0; i < 3; i++) sum += *lost[i] = b->adc[i].n.overruns + b->adc[i].n.lost_words;
    return sum;
}

static uint32_t conversion_count(const struct psd1 *b)
{
    uint32_t sum = 0;
    for (unsigned i = 0; i < 3; i++) sum += b->adc[i].n.conversions + b->adc[i].n.lost_words;
    return sum;
}

static void put_fl2(struct psd1 *b, bool active, int64_t t_ns)
{
    b->fl2 = active;
    psd1_put(b, PSD1_BIT(FL2), active == (b->profile.fl2 == PSD1_ACTIVE_HIGH) ? PSD1_BIT(FL2) : 0, t_ns);
}

/* ---- steps ---- */

int64_t psd1_cycle_start(struct psd1 *b, int64_t t_ns)
{
    b->axis = 0;
    b->now = (struct psd1_cycle){.seq = b->seq++, .t_dr_ns = b->dr_ns, .t_a0_ns = t_ns};
    b->conversions = conversion_count(b);
    psd1_a0(b, true, t_ns);
    psd1_aux_latch(b, &b->now, t_ns);
    board_notify(&b->base, PSD1_EV_A0, t_ns);
    b->phase = PSD1_RF_FALL;
    return t_ns + PSD1_HALF_NS;
}

/* While RFx is low the converter keeps the word: it is known from here on. */
int64_t psd1_rf_fall(struct psd1 *b, int64_t t_ns)
{
    const unsigned axis = b->axis;
    const struct ad7712_sclk sclk = psd1_sclk(t_ns);
    psd1_rf(b, axis, false, t_ns);
    const uint32_t word = ad7712_read_word(&b->adc[axis], 16, &sclk);
    psd1_frame_begin(b, PSD1_FORM_READ16, word, t_ns);
    board_notify(&b->base, PSD1_EV_RFX + axis, t_ns);
    b->phase = PSD1_RF_RISE;
    return t_ns + PSD1_READ16_NS;
}

static uint16_t word_of(struct psd1 *b)
{
    psd1_rk_take_word(&b->rk, b->frame.word, 16);
    if (b->base.faults & PSD1_FAULT_FROZEN_WORDS) psd1_rk_take_word(&b->rk, b->latest.word[b->axis], 16);
    return (uint16_t)b->rk.bits;
}

int64_t psd1_rf_rise(struct psd1 *b, int64_t t_ns)
{
    const unsigned axis = b->axis;
    psd1_frame_end(b, t_ns);
    psd1_rf(b, axis, true, t_ns);
    b->now.word[axis] = word_of(b);
    put_fl2(b, true, t_ns);
    b->fl2_ns = t_ns;
    b->taken = false;
    if (axis == 2 && b->profile.a0_release == PSD1_A0_RFZ) psd1_a0(b, false, t_ns);
    b->phase = PSD1_READY;
    board_notify(&b->base, PSD1_EV_FL2, t_ns);
    return b->profile.host_strobe_ns ? t_ns + b->profile.host_strobe_ns : SCHED_NEVER;
}

static uint8_t status_of(struct psd1 *b)
{
    const struct psd1_cycle *c = &b->now;
    const uint32_t lost = psd1_lost(b);
    uint8_t status = c->status;
    if (lost != b->lost) status |= PSD1_CY_OVERRUN;
    if (conversion_count(b) != b->conversions) status |= PSD1_CY_MIXED;
    for (unsigned i = 0; i < 3; i++)
        if (c->word[i] == 0 || c->word[i] == 0xFFFF) status |= PSD1_CY_CLIP;
    b->lost = lost;
    return status;
}

static int64_t cycle_end(struct psd1 *b, int64_t t_ns)
{
    struct psd1_cycle *c = &b->now;
    if (b->profile.a0_release == PSD1_A0_FL2) psd1_a0(b, false, t_ns);
    c->t_end_ns = t_ns;
    c->status = status_of(b);
    b->counters.stretched += (c->status & PSD1_CY_MIXED) != 0;
    b->counters.cycles++;
    b->latest = *c;
    b->phase = PSD1_IDLE;
    board_notify(&b->base, PSD1_EV_CYCLE, t_ns);
    if (b->host.cycle) b->host.cycle(b->host.ctx, &b->latest, t_ns);
    return b->due_ns;
}

int64_t psd1_clear(struct psd1 *b, int64_t t_ns)
{
    put_fl2(b, false, t_ns);
    b->due_ns = SCHED_NEVER;
    if (b->axis == 2) return cycle_end(b, t_ns);
    b->axis++;
    return psd1_rf_fall(b, t_ns);
}

/* ---- its end before its time ---- */

void psd1_cut(struct psd1 *b, int64_t t_ns)
{
    if (!psd1_in_cycle(b)) return;
    b->counters.cut++;
    if (b->frame.active) psd1_frame_end(b, t_ns);
    psd1_rf(b, b->axis, true, t_ns);
    put_fl2(b, false, t_ns);
    psd1_a0(b, false, t_ns);
}

#include "board/psa2/can_internal.h"
#include "gen/psabench_can.h"

#include <string.h>

enum { NS_PER_US = 1000, NS_PER_TICK = 4000, STATUS_BITS = 0x0F, CHANNEL_SHIFT = 4, CODE_DROPPED_BITS = 3 };

static const unsigned fed_by_form[PSA2_FORMS] = {
    [PSA2_FORM_PAIR] = 1u << PSA2_XY_TPDO | 1u << PSA2_ZT_TPDO,
    [PSA2_FORM_FAST] = 1u << PSA2_FAST_TPDO,
    [PSA2_FORM_FRAME] = 1u << PSA2_FRAME_TPDO,
    [PSA2_FORM_BLOCK] = 1u << PSA2_BLOCK_TPDO,
};

void psa2_can_stream_restart(struct psa2_can *c)
{
    c->block_samples = 0;
    c->sync_armed = false;
    co_pdo_select(&c->node, fed_by_form[c->set.form]);
}

static bool bit(const struct psa2_frame *f, unsigned mask)
{
    return f->status & mask;
}

static uint32_t stamp_us(const struct psa2_frame *f)
{
    return (uint32_t)((uint64_t)f->t_sample_ns / NS_PER_US);
}

/* A code without its low bits, halves towards minus infinity: what a shift of two's complement gives. */
static int32_t code_21(int32_t code)
{
    const int32_t step = 1 << CODE_DROPPED_BITS;
    return (code - ((code % step + step) % step)) / step;
}

/* ---- one sample as frames; the generated packers know the bits ---- */

static unsigned pack_pair(const struct psa2_frame *f, struct can_msg m[2])
{
    const struct psabench_psa2_xy_t xy = {.x = f->code[0], .y = f->code[1], .seq = (uint16_t)f->seq};
    const struct psabench_psa2_zt_t zt = {
        .z = f->code[2],
        .t = (int16_t)f->temp_code,
        .settled = bit(f, PSA2_ST_SETTLED),
        .clip = bit(f, PSA2_ST_CLIP),
        .overrun = bit(f, PSA2_ST_OVERRUN),
        .t_new = bit(f, PSA2_ST_TEMP_NEW),
        .channel = f->temp_channel & 0x0Fu,
        .tstamp = (uint16_t)((uint64_t)f->t_sample_ns / NS_PER_TICK),
    };
    m[0].len = (uint8_t)psabench_psa2_xy_pack(m[0].data, &xy, sizeof m[0].data);
    m[1].len = (uint8_t)psabench_psa2_zt_pack(m[1].data, &zt, sizeof m[1].data);
    return 2;
}

static unsigned pack_fast(const struct psa2_frame *f, struct can_msg *m)
{
    const struct psabench_psa2_fast_t fast = {
        .x = code_21(f->code[0]), .y = code_21(f->code[1]), .z = code_21(f->code[2]), .tog = f->seq & 1u};
    m->len = (uint8_t)psabench_psa2_fast_pack(m->data, &fast, sizeof m->data);
    return 1;
}

static unsigned pack_frame(const struct psa2_frame *f, struct can_msg *m)
{
    const struct psabench_psa2_frame_t all = {
        .x = f->code[0],
        .y = f->code[1],
        .z = f->code[2],
        .t = (int16_t)f->temp_code,
        .settled = bit(f, PSA2_ST_SETTLED),
        .clip = bit(f, PSA2_ST_CLIP),
        .overrun = bit(f, PSA2_ST_OVERRUN),
        .t_new = bit(f, PSA2_ST_TEMP_NEW),
        .channel = f->temp_channel & 0x0Fu,
        .tstamp = stamp_us(f),
    };
    m->flags = CAN_FD | CAN_BRS;
    m->len = (uint8_t)psabench_psa2_frame_pack(m->data, &all, sizeof m->data);
    return 1;
}

/* The generated struct of a block has a member for each of its 26 signals; a sample in it is a PSA2_FRAME's first twelve
 * bytes (test blocks_carry_five_samples decodes one with the generated unpacker). */
static unsigned pack_block(struct psa2_can *c, const struct psa2_frame *f, struct can_msg *m)
{
    enum { HEAD = 4, SAMPLE = 12 };
    struct can_msg one = {0};
    (void)pack_frame(f, &one);
    if (c->block_samples == 0) {
        c->block = (struct can_msg){.flags = CAN_FD | CAN_BRS, .len = PSABENCH_PSA2_BLOCK_LENGTH};
        memcpy(c->block.data, &one.data[SAMPLE], HEAD); /* both forms stamp in us */
    }
    memcpy(&c->block.data[HEAD + SAMPLE * c->block_samples], one.data, SAMPLE);
    if (++c->block_samples < PSA2_BLOCK_SAMPLES) return 0;
    c->block_samples = 0;
    *m = c->block;
    return 1;
}

/* ---- which samples, and on to the node ---- */

static bool wanted(struct psa2_can *c, const struct psa2_frame *f)
{
    if (c->set.sample_mode == PSA2_EVERY_NTH) return f->seq % c->set.nth == 0;
    if (c->set.sample_mode != PSA2_ON_SYNC) return true;
    if (!c->sync_armed || f->t_sample_ns < c->sync_ns) return false;
    c->sync_armed = false;
    return true;
}

static void lost(struct psa2_can *c, int64_t t_ns)
{
    c->dropped++;
    c->drop_ns = t_ns;
    co_node_error(&c->node, PSA2_EMCY_CAN_OVERRUN, 0x11, 3, t_ns);
}

static void emit(struct psa2_can *c, unsigned first_tpdo, struct can_msg *m, unsigned frames, int64_t t_ns)
{
    if (!co_pdo_room(&c->node, frames)) { /* a sample is sent whole or not at all */
        lost(c, t_ns);
        return;
    }
    for (unsigned i = 0; i < frames; i++) (void)co_pdo_offer(&c->node, first_tpdo + i, &m[i], t_ns);
    if (t_ns - c->drop_ns >= PSA2_CAN_CALM_NS) co_node_error_end(&c->node, PSA2_EMCY_CAN_OVERRUN, t_ns);
}

static void stream(struct psa2_can *c, const struct psa2_frame *f, int64_t t_ns)
{
    struct can_msg m[2] = {{0}, {0}};
    switch ((enum psa2_form)c->set.form) {
    case PSA2_FORM_PAIR:
        emit(c, PSA2_XY_TPDO, m, pack_pair(f, m), t_ns);
        return;
    case PSA2_FORM_FAST:
        emit(c, PSA2_FAST_TPDO, m, pack_fast(f, m), t_ns);
        return;
    case PSA2_FORM_FRAME:
        emit(c, PSA2_FRAME_TPDO, m, pack_frame(f, m), t_ns);
        return;
    case PSA2_FORM_BLOCK:
        if (pack_block(c, f, m) > 0) emit(c, PSA2_BLOCK_TPDO, m, 1, t_ns);
        return;
    }
}

void psa2_can_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct psa2_can *c = ctx;
    c->latest = *f;
    co_node_error_end(&c->node, PSA2_EMCY_ACCEL_PORT, t_ns);
    if (bit(f, PSA2_ST_TEMP_NEW)) co_node_error_end(&c->node, PSA2_EMCY_TEMP_PORT, t_ns);
    /* A rate that rose by a way of its own, say a RESET opcode, is judged by what it is. */
    if (psa2_can_info(c).period_ns != c->checked_period_ns) psa2_can_rejudge(c, t_ns);
    if (c->node.state != CO_OPERATIONAL || !wanted(c, f)) return;
    if (c->fits) stream(c, f, t_ns);
    else c->dropped++;
}

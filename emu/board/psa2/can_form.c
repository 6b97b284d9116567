#include "board/psa2/board.h"

#include "base/can/bits.h"
#include "gen/psabench_can.h"

#include <stdio.h>
#include <string.h>

enum { NS_PER_US = 1000, NS_PER_TICK = 4000, CODE_DROPPED_BITS = 3 };

static bool has_status(const struct psa2_frame *f, unsigned mask)
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

static unsigned pack_pair(struct psa2_block *block, const struct psa2_frame *f, struct can_msg *m)
{
    (void)block;
    const struct psabench_psa2_xy_t xy = {.x = f->code[0], .y = f->code[1], .seq = (uint16_t)f->seq};
    const struct psabench_psa2_zt_t zt = {
        .z = f->code[2],
        .t = (int16_t)f->temp_code,
        .settled = has_status(f, PSA2_ST_SETTLED),
        .clip = has_status(f, PSA2_ST_CLIP),
        .overrun = has_status(f, PSA2_ST_OVERRUN),
        .t_new = has_status(f, PSA2_ST_TEMP_NEW),
        .channel = f->temp_channel & 0x0Fu,
        .tstamp = (uint16_t)((uint64_t)f->t_sample_ns / NS_PER_TICK),
    };
    m[0].len = (uint8_t)psabench_psa2_xy_pack(m[0].data, &xy, sizeof m[0].data);
    m[1].len = (uint8_t)psabench_psa2_zt_pack(m[1].data, &zt, sizeof m[1].data);
    return 2;
}

static unsigned pack_fast(struct psa2_block *block, const struct psa2_frame *f, struct can_msg *m)
{
    (void)block;
    const struct psabench_psa2_fast_t fast = {
        .x = code_21(f->code[0]), .y = code_21(f->code[1]), .z = code_21(f->code[2]), .tog = f->seq & 1u};
    m->len = (uint8_t)psabench_psa2_fast_pack(m->data, &fast, sizeof m->data);
    return 1;
}

static unsigned pack_frame(struct psa2_block *block, const struct psa2_frame *f, struct can_msg *m)
{
    (void)block;
    const struct psabench_psa2_frame_t all = {
        .x = f->code[0],
        .y = f->code[1],
        .z = f->code[2],
        .t = (int16_t)f->temp_code,
        .settled = has_status(f, PSA2_ST_SETTLED),
        .clip = has_status(f, PSA2_ST_CLIP),
        .overrun = has_status(f, PSA2_ST_OVERRUN),
        .t_new = has_status(f, PSA2_ST_TEMP_NEW),
        .channel = f->temp_channel & 0x0Fu,
        .tstamp = stamp_us(f),
    };
    m->flags = CAN_FD | CAN_BRS;
    m->len = (uint8_t)psabench_psa2_frame_pack(m->data, &all, sizeof m->data);
    return 1;
}

/* The generated struct of a block has a member for each of its 26 signals; a sample in it is a PSA2_FRAME's first twelve
 * bytes (test blocks_carry_five_samples decodes one with the generated unpacker). */
static unsigned pack_block(struct psa2_block *block, const struct psa2_frame *f, struct can_msg *m)
{
    enum { HEAD = 4, SAMPLE = 12 };
    struct can_msg one = {0};
    (void)pack_frame(NULL, f, &one);
    if (block->samples == 0) {
        block->m = (struct can_msg){.flags = CAN_FD | CAN_BRS, .len = PSABENCH_PSA2_BLOCK_LENGTH};
        memcpy(block->m.data, &one.data[SAMPLE], HEAD); /* both forms stamp in us */
    }
    memcpy(&block->m.data[HEAD + SAMPLE * block->samples], one.data, SAMPLE);
    if (++block->samples < PSA2_BLOCK_SAMPLES) return 0;
    block->samples = 0;
    *m = block->m;
    return 1;
}

/* ---- frames of each form: lengths, flags, samples ---- */

static const struct form {
    const char *name;
    uint8_t flags, first_tpdo, frames, len[PSA2_FORM_FRAMES_MAX], samples;
    unsigned (*pack)(struct psa2_block *block, const struct psa2_frame *f, struct can_msg *m);
} forms[PSA2_FORMS] = {
    [PSA2_FORM_PAIR] = {"pair", 0, PSA2_XY_TPDO, 2, {PSABENCH_PSA2_XY_LENGTH, PSABENCH_PSA2_ZT_LENGTH}, 1, pack_pair},
    [PSA2_FORM_FAST] = {"fast", 0, PSA2_FAST_TPDO, 1, {PSABENCH_PSA2_FAST_LENGTH}, 1, pack_fast},
    [PSA2_FORM_FRAME] = {"frame", CAN_FD | CAN_BRS, PSA2_FRAME_TPDO, 1, {PSABENCH_PSA2_FRAME_LENGTH}, 1, pack_frame},
    [PSA2_FORM_BLOCK] =
        {"block", CAN_FD | CAN_BRS, PSA2_BLOCK_TPDO, 1, {PSABENCH_PSA2_BLOCK_LENGTH}, PSA2_BLOCK_SAMPLES, pack_block},
};

unsigned psa2_form_first_tpdo(unsigned form)
{
    return forms[form].first_tpdo;
}

unsigned psa2_form_tpdos(unsigned form)
{
    return ((1u << forms[form].frames) - 1u) << forms[form].first_tpdo;
}

unsigned psa2_form_pack(unsigned form, struct psa2_block *block, const struct psa2_frame *f,
                        struct can_msg m[PSA2_FORM_FRAMES_MAX])
{
    return forms[form].pack(block, f, m);
}

/* ---- load of the bus ---- */

static int64_t worst_ns(const struct form *f, const struct can_bus_cfg *bus)
{
    int64_t sum_ns = 0;
    for (unsigned i = 0; i < f->frames; i++) sum_ns += can_bits_ns(can_bits_worst(f->flags, f->len[i]), bus);
    return sum_ns;
}

/* How often a form is due; with samples on SYNC the host sets the pace, and an overrun is reported when it happens. */
static int64_t due_ns(const struct psa2_can_settings *set, int64_t period_ns)
{
    if (set->sample_mode == PSA2_ON_SYNC) return 0;
    return period_ns * forms[set->form].samples * (set->sample_mode == PSA2_EVERY_NTH ? set->nth : 1);
}

bool psa2_form_fits(const struct can_bus_cfg *bus, const struct psa2_can_settings *set, int64_t period_ns,
                    char why[BOARD_NODE_TEXT])
{
    const struct form *f = &forms[set->form];
    if (f->flags & CAN_FD && bus->data_bitrate_hz == 0) {
        (void)snprintf(why, BOARD_NODE_TEXT, "refused: form %u (%s) needs FD frames, this bus has no data bit rate",
                       set->form, f->name);
        return false;
    }
    char what[32];
    (void)snprintf(what, sizeof what, "form %u (%s)", set->form, f->name);
    return board_node_load_fits(bus, what, f->frames, worst_ns(f, bus), due_ns(set, period_ns), why);
}

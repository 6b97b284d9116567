#include "base/canbits.h"
#include "board/can_load.h"
#include "board/psa2/can_internal.h"
#include "gen/psabench_can.h"

#include <stdio.h>
#include <string.h>

enum { FRAMES_MAX = 2 };

/* Frames of each form, object 2020h: lengths, flags, samples. */
static const struct form {
    const char *name;
    uint8_t flags, frames, len[FRAMES_MAX], samples;
} forms[PSA2_FORMS] = {
    [PSA2_FORM_PAIR] = {"pair", 0, 2, {PSABENCH_PSA2_XY_LENGTH, PSABENCH_PSA2_ZT_LENGTH}, 1},
    [PSA2_FORM_FAST] = {"fast", 0, 1, {PSABENCH_PSA2_FAST_LENGTH}, 1},
    [PSA2_FORM_FRAME] = {"frame", CAN_FD | CAN_BRS, 1, {PSABENCH_PSA2_FRAME_LENGTH}, 1},
    [PSA2_FORM_BLOCK] = {"block", CAN_FD | CAN_BRS, 1, {PSABENCH_PSA2_BLOCK_LENGTH}, PSA2_BLOCK_SAMPLES},
};

static int64_t worst_ns(const struct form *f, const struct can_bus_cfg *bus)
{
    int64_t sum_ns = 0;
    for (unsigned i = 0; i < f->frames; i++) sum_ns += can_bits_ns(can_bits_worst(f->flags, f->len[i]), bus);
    return sum_ns;
}

static void say_needs_fd(unsigned form, char why[PSA2_CAN_TEXT])
{
    (void)snprintf(why, PSA2_CAN_TEXT, "refused: form %u (%s) needs FD frames, this bus has no data bit rate", form,
                   forms[form].name);
}

/* How often a form is due; with samples on SYNC the host sets the pace, and an overrun is reported when it happens. */
static int64_t due_ns(const struct psa2_can_settings *set, int64_t period_ns)
{
    if (set->sample_mode == PSA2_ON_SYNC) return 0;
    return period_ns * forms[set->form].samples * (set->sample_mode == PSA2_EVERY_NTH ? set->nth : 1);
}

bool psa2_can_fit(const struct can_bus_cfg *bus, const struct psa2_can_settings *set, int64_t period_ns,
                  char why[PSA2_CAN_TEXT])
{
    const struct form *f = &forms[set->form];
    if (f->flags & CAN_FD && bus->data_bitrate_hz == 0) {
        say_needs_fd(set->form, why);
        return false;
    }
    char what[32];
    (void)snprintf(what, sizeof what, "form %u (%s)", set->form, f->name);
    return can_load_fits(bus, what, f->frames, worst_ns(f, bus), due_ns(set, period_ns), why, PSA2_CAN_TEXT);
}

/* fDATA = fCLK / (16384 >> DR) in the FIR modes (sources 1.8); other modes and DR 5..7 the board refuses. */
int64_t psa2_can_config0_period_ns(uint32_t fclk_hz, uint8_t config0)
{
    const unsigned dr = config0 >> 3 & 7u;
    if (dr > 4 || (config0 & 3u) < 2 || fclk_hz == 0) return 0;
    return (INT64_C(16384) >> dr) * NS_PER_S / fclk_hz;
}

/* A host that asks for the same again and again is reported by its aborts; the listener hears each text once. */
static void refuse(struct psa2_can *c, const char why[PSA2_CAN_TEXT])
{
    if (strcmp(c->refusal, why) == 0) return;
    (void)snprintf(c->refusal, sizeof c->refusal, "%s", why);
    if (c->cfg.refused) c->cfg.refused(c->cfg.ctx, c->cfg.name, c->refusal);
}

bool psa2_can_judge(struct psa2_can *c, const struct psa2_can_settings *set, int64_t period_ns, int64_t t_ns)
{
    char why[PSA2_CAN_TEXT];
    if (!psa2_can_fit(&c->bus->cfg, set, period_ns, why)) {
        refuse(c, why);
        co_node_error(&c->node, PSA2_EMCY_STREAM_REFUSED, 0x81, 3, t_ns);
        return false;
    }
    c->refusal[0] = '\0';
    co_node_error_end(&c->node, PSA2_EMCY_STREAM_REFUSED, t_ns);
    return true;
}

/* While nothing changes, the last refusal of a wish stays readable. */
void psa2_can_rejudge(struct psa2_can *c, int64_t t_ns)
{
    char why[PSA2_CAN_TEXT];
    const int64_t period_ns = psa2_can_info(c).period_ns;
    const bool fitted = c->fits;
    c->checked_period_ns = period_ns;
    c->fits = psa2_can_fit(&c->bus->cfg, &c->set, period_ns, why);
    if (!c->fits || !fitted) (void)psa2_can_judge(c, &c->set, period_ns, t_ns);
}

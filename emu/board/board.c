#include "board/board.h"

#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

void board_clear(struct board *b, size_t size)
{
    const size_t from = offsetof(struct board, trace.pending), to = from + sizeof b->trace.pending;
    memset(b, 0, from);
    memset((char *)b + to, 0, size - to);
}

void board_init(struct board *b, const struct board_line *lines, unsigned count, const struct board_cfg *cfg,
                const struct board_io *io, struct sched *s)
{
    static const char *const afe_noise[BOARD_AXES] = {"afe.x", "afe.y", "afe.z"};
    board_clear(b, sizeof *b);
    b->cfg = *cfg;
    b->io = *io;
    b->sched = s;
    line_faults_init(&b->line, &b->trace);
    for (unsigned i = 0; i < count; i++) (void)trace_add(&b->trace, lines[i].name, lines[i].level);
    for (unsigned i = 0; i < BOARD_AXES; i++) afe_init(&b->afe[i], &cfg->afe[i], board_draws(b, afe_noise[i]));
}

void board_put_truth(board_truth_fn *put, void *ctx, double value, const char *name, ...)
{
    char text[40];
    va_list ap;
    va_start(ap, name);
    (void)vsnprintf(text, sizeof text, name, ap);
    va_end(ap);
    put(ctx, text, value);
}

void board_reseed(struct board *b, uint64_t seed)
{
    struct draws *at[BOARD_NOISES_MAX];
    const unsigned n = b->type->noises ? b->type->noises(b, at) : 0;
    for (unsigned i = 0; i < n; i++) draws_reseed(at[i], seed);
    for (unsigned i = 0; i < BOARD_AXES; i++) draws_reseed(&b->afe[i].noise, seed);
}

bool board_has(const struct board_type *t, const char *capability)
{
    for (const char *const *c = t->capabilities; c && *c; c++)
        if (strcmp(*c, capability) == 0) return true;
    return false;
}

uint32_t board_fault_bit(const struct board_type *t, const char *kind)
{
    for (const struct board_controller_fault *f = t->controller_faults; f && f->kind; f++)
        if (strcmp(f->kind, kind) == 0) return f->bit;
    return 0;
}

void board_set_faults(struct board *b, uint32_t faults)
{
    if (b->type->set_faults) b->type->set_faults(b, faults);
    else b->faults = faults;
}

void board_observe(struct board *b, bool on)
{
    if (b->type->observe) b->type->observe(b, on);
    b->observed = on;
}

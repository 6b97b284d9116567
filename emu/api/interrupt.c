/* Interrupts: edges of pins that call the program between two instants, where it may do everything. */
#include "api/internal.h"

int psabench_on_interrupt(psabench_part *p, int pin, int edge, psabench_interrupt_fn *fn, void *ctx)
{
    const int bad = api_edge_pin(p, pin, edge, "psabench_on_interrupt()");
    if (bad) return bad;
    const uint32_t bit = UINT32_C(1) << pin;
    api_observe(p, (unsigned)pin);
    p->interrupt[pin] = (struct api_interrupt){fn, ctx, (enum psabench_edge)edge};
    p->armed = fn ? p->armed | bit : p->armed & ~bit;
    p->pending &= ~bit;
    return PSABENCH_OK;
}

int psabench_mask(psabench *b, int masked)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    if (masked != 0 && masked != 1)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "psabench_mask(): expected 0 or 1, got %d", masked);
    const int was = b->masked;
    b->masked = masked;
    return was;
}

bool api_pending(const psabench *b)
{
    for (const struct psabench_part *p = b->parts; p; p = p->next)
        if (p->pending) return true;
    return false;
}

static void serve_pin(psabench_part *p, unsigned pin)
{
    psabench *b = p->bench;
    p->pending &= ~(UINT32_C(1) << pin);
    b->serving = true;
    p->interrupt[pin].fn(p->interrupt[pin].ctx, p, (int)pin);
    b->serving = false;
    b->served++;
}

/* Each pin once: the program goes on between two handlers of a pin, even if a handler takes longer than its period. */
void api_serve(psabench *b)
{
    if (b->serving || b->inside) return;
    for (struct psabench_part *p = b->parts; p; p = p->next)
        for (unsigned i = 0; p->pending && i < p->kind->pin_count; i++)
            if (p->pending >> i & 1 && !b->masked) serve_pin(p, i);
}

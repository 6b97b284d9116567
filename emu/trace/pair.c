#include "trace/pair.h"

static int64_t *edge_at(struct pair *p, unsigned i)
{
    return &p->due_ns[(p->first + i) % PAIR_EDGES];
}

void pair_settle(struct pair *p, bool level)
{
    p->in = p->out = level;
    p->first = p->count = 0;
}

/* Edges alternate: one that would overtake the edge before it takes that one away, and the pulse between them is lost; so does
 * one that finds no room, in a row of pulses that is too fast for a receiver. */
void pair_input(struct pair *p, bool level, int64_t t_ns)
{
    const int64_t due_ns = t_ns + (level ? p->cfg.rise_ns : p->cfg.fall_ns);
    if (level == p->in) return;
    p->in = level;
    if (p->count == 0 && due_ns == t_ns) p->out = level;
    else if (p->count == PAIR_EDGES || (p->count > 0 && *edge_at(p, p->count - 1) >= due_ns)) p->count--;
    else *edge_at(p, p->count++) = due_ns;
}

int64_t pair_due_ns(const struct pair *p)
{
    return p->count > 0 ? p->due_ns[p->first] : INT64_MAX;
}

void pair_run(struct pair *p, int64_t t_ns)
{
    for (; pair_due_ns(p) <= t_ns; p->count--) {
        p->out = !p->out;
        p->first = (p->first + 1) % PAIR_EDGES;
    }
}

#include "link/link.h"

#include <unistd.h>

void links_add_first(struct links *ls, struct link *l)
{
    l->next = ls->first;
    ls->first = l;
}

void links_add_last(struct links *ls, struct link *l)
{
    struct link **p = &ls->first;
    while (*p) p = &(*p)->next;
    l->next = NULL;
    *p = l;
}

void link_close(struct link *l)
{
    if (l->fd >= 0) close(l->fd);
    l->fd = -1;
    l->gone = true;
}

void links_reap(struct links *ls)
{
    struct link **p = &ls->first;
    while (*p) {
        struct link *l = *p;
        if (!l->gone) {
            p = &l->next;
            continue;
        }
        *p = l->next;
        if (l->release) l->release(l);
    }
}

bool links_full(const struct links *ls)
{
    for (const struct link *l = ls->first; l; l = l->next) {
        if (l->full && !l->gone) return true;
    }
    return false;
}

size_t links_pending(const struct links *ls)
{
    size_t n = 0;
    for (const struct link *l = ls->first; l; l = l->next) n += l->gone ? 0 : l->pending;
    return n;
}

bool links_linger(const struct links *ls)
{
    for (const struct link *l = ls->first; l; l = l->next)
        if (l->linger && !l->gone) return true;
    return false;
}

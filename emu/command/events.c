#include "command/events.h"

#include "command/error.h"
#include "unit/boards.h"

#include <string.h>

/* Whether a type before this one in the list has an event of that name. */
static bool met_before(const struct board_type *const *type, const char *name)
{
    for (const struct board_type *const *t = board_types; t < type; t++)
        for (unsigned i = 0; i < (*t)->event_count; i++)
            if (strcmp((*t)->events[i], name) == 0) return true;
    return false;
}

const char *control_event(unsigned i)
{
    for (const struct board_type *const *t = board_types; *t; t++) {
        for (unsigned e = 0; e < (*t)->event_count; e++) {
            if (!met_before(t, (*t)->events[e]) && i-- == 0) return (*t)->events[e];
        }
    }
    return NULL;
}

bool control_event_find(const struct control_bench *b, unsigned unit, const char *arg, const char *name,
                        unsigned *event, struct control_error *why)
{
    char known[160] = "";
    if (unit >= b->units) return control_expected(why, "state", arg, "no unit", "an event of a unit");
    const struct board_type *t = b->unit[unit]->type;
    for (*event = 0; *event < t->event_count; ++*event) {
        const char *other = t->events[*event];
        if (strcmp(other, name) == 0) return true;
        why_list_add(known, sizeof known, other);
    }
    return control_expected(why, "range", arg, WHY_TEXT(name), "an event of %s, a %s: %s", b->unit_name[unit], t->title,
                            known);
}

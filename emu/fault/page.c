/* The page of faults: kinds with what they take, the matrix of kinds and places, and what each type of board has. */
#include "fault/internal.h"

#include "unit/boards.h"

#include <stdarg.h>
#include <stdio.h>

struct text {
    char *out;
    size_t cap, at;
};

__attribute__((format(printf, 2, 3))) static void add_text(struct text *t, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    if (t->at < t->cap) t->at += (size_t)vsnprintf(t->out + t->at, t->cap - t->at, format, ap);
    va_end(ap);
}

static void add_args(struct text *t, const struct fault_kind *k)
{
    bool any = false;
    for (unsigned i = FAULT_FOR_S; i < FAULT_ARGS; i++) {
        if (!((k->need | k->may) & FAULT_BIT(i))) continue;
        const char *name = fault_args[i].name;
        add_text(t, "%s`%s`%s", any ? ", " : "", name, k->need & FAULT_BIT(i) ? "" : " (optional)");
        any = true;
    }
    if (!any) add_text(t, "nothing");
}

bool fault_markdown(unsigned line, char *out, size_t cap)
{
    struct text t = {.out = out, .cap = cap};
    if (line == 0) add_text(&t, "| kind | what it does | takes | how a host sees it | rejected if |");
    if (line == 1) add_text(&t, "|---|---|---|---|---|");
    if (line < 2) return true;
    const struct fault_kind *k = fault_kind(line - 2);
    if (!k) return false;
    add_text(&t, "| `%s` | %s%s | ", k->name, k->what, k->once ? " Over at once." : "");
    add_args(&t, k);
    add_text(&t, " | %s | %s |", k->seen, k->unless ? k->unless : "");
    return true;
}

/* In a table a bar has to be escaped. */
static void add_place(struct text *t, enum fault_place place)
{
    add_text(t, " `");
    for (const char *s = fault_place_any(place); *s; s++) add_text(t, *s == '|' ? "\\|" : "%c", *s);
    add_text(t, "` |");
}

bool fault_markdown_matrix(unsigned line, char *out, size_t cap)
{
    struct text t = {.out = out, .cap = cap};
    const struct fault_kind *k = line < 2 ? NULL : fault_kind(line - 2);
    if (line >= 2 && !k) return false;
    if (line == 1) add_text(&t, "|---|");
    else if (k) add_text(&t, "| `%s` |", k->name);
    else add_text(&t, "| |");
    for (unsigned i = 0; i < FAULT_PLACES; i++) {
        if (line == 0) add_place(&t, (enum fault_place)i);
        else if (line == 1) add_text(&t, "---|");
        else if (!(k->places & FAULT_BIT(i))) add_text(&t, " rejected |");
        else add_text(&t, k->fits ? " seen, or rejected (above) |" : " seen |");
    }
    return true;
}

/* The n-th part with a fault point of any type of board. */
static const struct board_part *part_at(unsigned n, const struct board_type **type)
{
    for (const struct board_type *const *t = board_types; *t; t++) {
        for (unsigned i = 0; i < (*t)->part_count; i++) {
            *type = *t;
            if ((*t)->parts[i].name && n-- == 0) return &(*t)->parts[i];
        }
    }
    return NULL;
}

static bool part_has(const struct board_type *t, const struct board_part *p, const struct fault_kind *k)
{
    if (p == t->parts) return k->places & FAULT_BIT(FAULT_AT_CONTROLLER) && board_fault_bit(t, k->name);
    if (!(k->places & FAULT_BIT(FAULT_AT_CHIP))) return false;
    return k->once ? p->registers > 0 : (p->faults & k->variant) != 0;
}

bool fault_markdown_boards(unsigned line, char *out, size_t cap)
{
    struct text t = {.out = out, .cap = cap};
    const struct board_type *type;
    const struct fault_kind *k;
    if (line == 0) add_text(&t, "| board | point | kinds it has | why not the others |");
    if (line == 1) add_text(&t, "|---|---|---|---|");
    if (line < 2) return true;
    const struct board_part *p = part_at(line - 2, &type);
    if (!p) return false;
    add_text(&t, "| %s | `UNIT.%s` |", type->title, p->name);
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) {
        if (part_has(type, p, k)) add_text(&t, " `%s`", k->name);
    }
    if (p->registers) add_text(&t, " (registers 0 to %u)", p->registers - 1);
    add_text(&t, " | %s |", p->unless ? p->unless : "");
    return true;
}

bool fault_markdown_events(unsigned line, char *out, size_t cap)
{
    struct text t = {.out = out, .cap = cap};
    if (line == 0) add_text(&t, "| board | events |");
    if (line == 1) add_text(&t, "|---|---|");
    if (line < 2) return true;
    const struct board_type *const *type = board_types;
    for (unsigned left = line - 2; *type && left > 0; left--) type++;
    if (!*type) return false;
    add_text(&t, "| %s |", (*type)->title);
    for (unsigned i = 0; i < (*type)->event_count; i++) add_text(&t, "%s `%s`", i ? "," : "", (*type)->events[i]);
    add_text(&t, " |");
    return true;
}

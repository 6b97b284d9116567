/* The page of faults: kinds with what they take, the matrix of kinds and places, and what each type of board has. */
#include "app/list/list.h"

#include "fault/fault.h"
#include "unit/boards.h"

static void print_args(FILE *out, const struct fault_kind *k)
{
    bool any = false;
    for (unsigned i = FAULT_FOR_S; i < FAULT_ARGS; i++) {
        if (!((k->need | k->may) & FAULT_BIT(i))) continue;
        const char *name = fault_args[i].name;
        fprintf(out, "%s`%s`%s", any ? ", " : "", name, k->need & FAULT_BIT(i) ? "" : " (optional)");
        any = true;
    }
    if (!any) fprintf(out, "nothing");
}

static void print_kinds(FILE *out)
{
    const struct fault_kind *k;
    fprintf(out, "| kind | what it does | takes | how a host sees it | rejected if |\n|---|---|---|---|---|\n");
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) {
        fprintf(out, "| `%s` | %s%s | ", k->name, k->what, k->once ? " Over at once." : "");
        print_args(out, k);
        fprintf(out, " | %s | %s |\n", k->seen, k->unless ? k->unless : "");
    }
}

/* In a table a bar has to be escaped. */
static void print_place(FILE *out, enum fault_place place)
{
    fprintf(out, " `");
    for (const char *s = fault_place_any(place); *s; s++) fprintf(out, *s == '|' ? "\\|" : "%c", *s);
    fprintf(out, "` |");
}

static void print_matrix(FILE *out)
{
    const struct fault_kind *k;
    fprintf(out, "| |");
    for (unsigned p = 0; p < FAULT_PLACES; p++) print_place(out, (enum fault_place)p);
    fprintf(out, "\n|---|");
    for (unsigned p = 0; p < FAULT_PLACES; p++) fprintf(out, "---|");
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) {
        fprintf(out, "\n| `%s` |", k->name);
        for (unsigned p = 0; p < FAULT_PLACES; p++) {
            const bool here = k->places & FAULT_BIT(p);
            fprintf(out, !here ? " rejected |" : k->fits ? " seen, or rejected (above) |" : " seen |");
        }
    }
    fprintf(out, "\n");
}

bool list_part_has(const struct board_type *t, const struct board_part *p, const struct fault_kind *k)
{
    if (p == t->parts) return k->places & FAULT_BIT(FAULT_AT_CONTROLLER) && board_fault_bit(t, k->name);
    if (!(k->places & FAULT_BIT(FAULT_AT_CHIP))) return false;
    return k->once ? p->registers > 0 : (p->faults & k->variant) != 0;
}

static void print_part(FILE *out, const struct board_type *type, const struct board_part *p)
{
    const struct fault_kind *k;
    fprintf(out, "| %s | `UNIT.%s` |", type->title, p->name);
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) {
        if (list_part_has(type, p, k)) fprintf(out, " `%s`", k->name);
    }
    if (p->registers) fprintf(out, " (registers 0 to %u)", p->registers - 1);
    fprintf(out, " | %s |\n", p->unless ? p->unless : "");
}

static void print_boards(FILE *out)
{
    fprintf(out, "| board | point | kinds it has | why not the others |\n|---|---|---|---|\n");
    for (const struct board_type *const *t = board_types; *t; t++) {
        for (unsigned i = 0; i < (*t)->part_count; i++) {
            if ((*t)->parts[i].name) print_part(out, *t, &(*t)->parts[i]);
        }
    }
}

static void print_events(FILE *out)
{
    fprintf(out, "| board | events |\n|---|---|\n");
    for (const struct board_type *const *t = board_types; *t; t++) {
        fprintf(out, "| %s |", (*t)->title);
        for (unsigned i = 0; i < (*t)->event_count; i++) fprintf(out, "%s `%s`", i ? "," : "", (*t)->events[i]);
        fprintf(out, " |\n");
    }
}

void list_faults(FILE *out)
{
    static void (*const tables[])(FILE * out) = {print_kinds, print_matrix, print_boards, print_events};
    for (unsigned i = 0; i < sizeof tables / sizeof *tables; i++) {
        if (i) fprintf(out, "\n");
        tables[i](out);
    }
}

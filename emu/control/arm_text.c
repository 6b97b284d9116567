#include "control/arm_text.h"

#include <string.h>

static const char *const kinds[] = {"fault", "event", "line"};                         /* arm_kind */
static const char *const edges[] = {NULL, "rising", "falling", "edge", "high", "low"}; /* capture_when */

static bool reject_text(const char *text, struct control_error *why)
{
    return control_expected(why, "argument", "on", WHY_TEXT(text),
                            "fault[:KIND], event:NAME or line:NAME:rising|falling|edge|high|low");
}

/* The word up to a colon or the end is in the list, from first on. */
static bool find_word(const char *text, size_t len, const char *const *list, unsigned first, unsigned count,
                      unsigned *found)
{
    for (unsigned i = first; i < count; i++) {
        if (strlen(list[i]) != len || memcmp(list[i], text, len) != 0) continue;
        *found = i;
        return true;
    }
    return false;
}

bool arm_text_parse(const char *text, struct arm_text *out, struct control_error *why)
{
    struct arm_text a = {.when = CAPTURE_OUTSIDE};
    unsigned kind, when;
    const size_t first = strcspn(text, ":");
    if (!find_word(text, first, kinds, 0, sizeof kinds / sizeof *kinds, &kind)) return reject_text(text, why);
    a.kind = (enum arm_kind)kind;
    const char *const name = text[first] ? text + first + 1 : "";
    const size_t len = strcspn(name, ":");
    const char *const edge = name[len] ? name + len + 1 : NULL;
    if (len >= sizeof a.name || (len == 0 && (a.kind != ARM_FAULT || text[first]))) return reject_text(text, why);
    memcpy(a.name, name, len);
    if ((a.kind == ARM_LINE) != (edge != NULL)) return reject_text(text, why);
    if (edge) {
        if (!find_word(edge, strlen(edge), edges, CAPTURE_RISING, sizeof edges / sizeof *edges, &when))
            return reject_text(text, why);
        a.when = (enum capture_when)when;
    }
    *out = a;
    return true;
}

#include "link/logic/beagle_text.h"

#include "base/why.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

/* A number that the client reads and sets. */
struct setting {
    const char *word;
    size_t where; /* in struct beagle_settings */
    uint32_t min, max;
};

static const struct setting settings[] = {
    {"samplerate", offsetof(struct beagle_settings, hz), BEAGLE_HZ_MIN, BEAGLE_HZ_MAX},
    {"sampleunit", offsetof(struct beagle_settings, unit), BEAGLE_16_BITS, BEAGLE_8_BITS},
    {"triggerflags", offsetof(struct beagle_settings, continuous), 0, 1},
    {"memalloc", offsetof(struct beagle_settings, memory_bytes), 1, BEAGLE_MEMORY_MAX},
    {"bufunitsize", offsetof(struct beagle_settings, buffer_bytes), BEAGLE_BUFFER_MIN, BEAGLE_BUFFER_MAX},
};
enum { SETTINGS = sizeof settings / sizeof *settings, TEXT_MAX = BEAGLE_ANSWER_MAX - 1 /* and the LF */ };

struct beagle_settings beagle_settings(void)
{
    return (struct beagle_settings){.hz = 8000000, .memory_bytes = BEAGLE_MEMORY_MAX, .buffer_bytes = 65536};
}

/* An answer, and its LF in any case. */
static size_t end_answer(char answer[BEAGLE_ANSWER_MAX])
{
    size_t n = strlen(answer);
    answer[n++] = '\n';
    answer[n] = '\0';
    return n;
}

/* Digits alone, up to 2^32 - 1. */
static bool parse_number(const char *text, uint32_t *out)
{
    uint64_t v = 0;
    size_t n = 0;
    for (; text[n] >= '0' && text[n] <= '9' && n < 11; n++) v = v * 10 + (uint64_t)(text[n] - '0');
    if (n == 0 || text[n] || v > UINT32_MAX) return false;
    *out = (uint32_t)v;
    return true;
}

static enum beagle_action carry_out(const struct setting *k, struct beagle_settings *s, const char *arg, char *answer)
{
    uint32_t *const value = (uint32_t *)((char *)s + k->where);
    uint32_t v = 0;
    if (!arg) {
        snprintf(answer, TEXT_MAX, "%" PRIu32, *value);
        return BEAGLE_ANSWERED;
    }
    if (!parse_number(arg, &v) || v < k->min || v > k->max) {
        why_expected(answer, TEXT_MAX, k->word, WHY_TEXT(arg), "an integer from %" PRIu32 " to %" PRIu32, k->min,
                     k->max);
        return BEAGLE_REJECTED;
    }
    *value = v;
    snprintf(answer, TEXT_MAX, "ok");
    return BEAGLE_ANSWERED;
}

static enum beagle_action reject_word(const char *word, char *answer)
{
    char known[128] = "version";
    for (unsigned i = 0; i < SETTINGS; i++) why_list_add(known, sizeof known, settings[i].word);
    why_expected(answer, TEXT_MAX, "line", WHY_TEXT(word), "%s, get or close", known);
    return BEAGLE_REJECTED;
}

/* The words of a line that is printable ASCII. */
static enum beagle_action parse_words(struct beagle_settings *s, char *line, char *answer)
{
    char *arg = strchr(line, ' ');
    if (arg) *arg++ = '\0';
    for (unsigned i = 0; i < SETTINGS; i++)
        if (strcmp(line, settings[i].word) == 0) return carry_out(&settings[i], s, arg, answer);
    if (arg) return reject_word(line, answer);
    if (strcmp(line, "get") == 0) return BEAGLE_GET;
    if (strcmp(line, "close") == 0) return BEAGLE_CLOSE;
    if (strcmp(line, "version") != 0) return reject_word(line, answer);
    snprintf(answer, TEXT_MAX, "BeagleLogic 1.0");
    return BEAGLE_ANSWERED;
}

enum beagle_action beagle_text_line(struct beagle_settings *s, const char *line, size_t len,
                                    char answer[BEAGLE_ANSWER_MAX], size_t *n)
{
    char text[BEAGLE_LINE_MAX + 1];
    enum beagle_action action = BEAGLE_REJECTED;
    size_t from = 0;
    answer[0] = '\0';
    while (line && from < len && line[from] == '\0') from++; /* libsigrok's own NULs may stand behind a LF */
    while (line && len > from && (line[len - 1] == '\r' || line[len - 1] == '\0')) len--;
    bool plain = line && len - from <= BEAGLE_LINE_MAX;
    for (size_t i = from; plain && i < len; i++) plain = line[i] >= ' ' && line[i] <= '~';
    if (plain) {
        memcpy(text, line + from, len - from);
        text[len - from] = '\0';
        action = parse_words(s, text, answer);
    } else {
        why_expected(answer, TEXT_MAX, "line", NULL, "up to %u printable characters", BEAGLE_LINE_MAX);
    }
    *n = answer[0] ? end_answer(answer) : 0;
    return action;
}

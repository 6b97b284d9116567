/* Lines of the logic analyser and triggers of a capture: any bytes are carried out or rejected, in one line; settings stay
 * within their ranges, and a rejected line changes none. */
#include "fuzz.h"

#include "control/arm_text.h"
#include "link/logic/beagle_text.h"

#include <string.h>

static void look_at_settings(const struct beagle_settings *s)
{
    assert(s->hz >= BEAGLE_HZ_MIN && s->hz <= BEAGLE_HZ_MAX && s->unit <= BEAGLE_8_BITS && s->continuous <= 1);
    assert(s->memory_bytes >= 1 && s->memory_bytes <= BEAGLE_MEMORY_MAX);
    assert(s->buffer_bytes >= BEAGLE_BUFFER_MIN && s->buffer_bytes <= BEAGLE_BUFFER_MAX);
}

static void say_line(struct beagle_settings *s, const char *line, size_t len)
{
    char answer[BEAGLE_ANSWER_MAX];
    size_t n = 99;
    const struct beagle_settings was = *s;
    const enum beagle_action action = beagle_text_line(s, line, len, answer, &n);
    const bool silent = action == BEAGLE_GET || action == BEAGLE_CLOSE;
    assert(silent ? n == 0 : n == strlen(answer) && n < sizeof answer && strchr(answer, '\n') == answer + n - 1);
    assert(action == BEAGLE_ANSWERED || memcmp(&was, s, sizeof was) == 0);
    look_at_settings(s);
}

static void arm(const uint8_t *data, size_t size)
{
    char text[64];
    struct arm_text a;
    struct control_error why = {0};
    const size_t n = size < sizeof text - 1 ? size : sizeof text - 1;
    memcpy(text, data, n);
    text[n] = '\0';
    const bool ok = arm_text_parse(text, &a, &why);
    assert(ok ? strlen(a.name) < sizeof a.name && (a.kind == ARM_LINE) == (a.when != CAPTURE_OUTSIDE)
              : why.why[0] && !strchr(why.why, '\n'));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct beagle_settings s = beagle_settings();
    const char *at = (const char *)data, *const end = at + size;
    for (const char *lf; at < end; at = lf + 1) {
        lf = memchr(at, '\n', (size_t)(end - at));
        if (!lf) lf = end;
        say_line(&s, at, (size_t)(lf - at));
        if (lf == end) break;
    }
    arm(data, size);
    return 0;
}

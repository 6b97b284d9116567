/* Fuzz target: files of --restore. The first byte says whether the rest is the whole file, or the text between the head
 * and the sum, which are put around it so that more than damage is found. */
#include "fuzz.h"

#include "base/text.h"
#include "bench/snapshot.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char head[] = "{\"psabench\":\"snapshot\",\"format\":1,\"version\":\"" TEXT_OF(PSABENCH_VERSION) "\"}\n";

/* The file in memory, with a NUL behind it, as snapshot_parse() wants it. */
static char *build(const uint8_t *data, size_t size, bool sealed, size_t *len)
{
    char sum[SHA256_HEX];
    char *text = malloc(size + 1024);
    struct sha256 s;
    size_t n = 0;
    if (sealed) n = (size_t)sprintf(text, "%s", head);
    if (size) memcpy(text + n, data, size);
    n += size;
    if (sealed) {
        sha256_init(&s);
        sha256_add(&s, text, n);
        sha256_hex(&s, sum);
        n += (size_t)sprintf(text + n, "{\"sha256\":\"%s\"}\n", sum);
    }
    text[n] = '\0';
    *len = n;
    return text;
}

/* What was accepted holds together, and every entry reads again. */
static void check(const struct snapshot *s)
{
    int64_t last_ns = 0;
    uint64_t entries = 0;
    char why[256];
    assert(strlen(s->scenario) <= s->scenario_len && s->end_ns >= 0);
    for (const char *line = s->journal; line < s->journal + s->journal_len; entries++) {
        const char *lf = memchr(line, '\n', (size_t)(s->journal + s->journal_len - line));
        struct journal_entry e;
        assert(lf && journal_read(line, (size_t)(lf - line), &e, why, sizeof why));
        assert(e.t_ns >= last_ns && e.t_ns <= s->end_ns);
        assert(e.kind != JOURNAL_FRAME || can_valid(&e.m));
        assert(e.bus < CONTROL_BUSES_MAX && e.unit < CONTROL_UNITS_MAX);
        last_ns = e.t_ns;
        journal_release(&e);
        line = lf + 1;
    }
    assert(entries == s->entries);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct snapshot s;
    char why[512] = "";
    size_t len;
    if (size == 0) return 0;
    char *text = build(data + 1, size - 1, data[0] != 'r', &len);
    if (snapshot_parse(text, len, &s, why, sizeof why)) {
        check(&s);
        snapshot_free(&s);
    } else {
        assert(why[0] && !strpbrk(why, "\r\n"));
    }
    return 0;
}

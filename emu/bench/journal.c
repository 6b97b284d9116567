#include "bench/journal.h"

#include "base/can/text.h"
#include "base/why.h"
#include "command/exact.h"

#include <assert.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINES_MAX 9007199254740991.0 /* as a mask: what a number of JSON holds exactly, 53 lines */

enum { FIRST_CAP = 1 << 16 };

void journal_init(struct journal *j, const struct bench *b)
{
    *j = (struct journal){.bench = b};
}

void journal_free(struct journal *j)
{
    free(j->text);
    *j = (struct journal){0};
}

/* ---- writing */

static bool make_room(struct journal *j, size_t n)
{
    size_t cap = j->cap ? j->cap : FIRST_CAP;
    if (j->lost) return false;
    if (j->len + n > JOURNAL_MAX) {
        j->lost = "more has come into this bench than the journal holds (64 MiB)";
        return false;
    }
    while (cap < j->len + n) cap *= 2;
    if (cap == j->cap) return true;
    char *text = realloc(j->text, cap);
    if (!text) {
        j->lost = "out of memory for the input log";
        return false;
    }
    j->text = text;
    j->cap = cap;
    return true;
}

static void put_text(struct journal *j, const char *text, size_t n)
{
    if (!make_room(j, n)) return;
    memcpy(j->text + j->len, text, n);
    j->len += n;
}

/* {"t":...,"ran":true and what follows, up to the closing brace and LF. */
__attribute__((format(printf, 3, 4))) static void add_line(struct journal *j, int64_t t_ns, const char *format, ...)
{
    char line[512];
    va_list ap;
    const bool ran = j->ran && t_ns == j->last_ns;
    const int at = snprintf(line, sizeof line, "{\"t\":%" PRId64 ",%s", t_ns, ran ? "\"ran\":true," : "");
    va_start(ap, format);
    const int n = vsnprintf(line + at, sizeof line - (size_t)at, format, ap);
    va_end(ap);
    put_text(j, line, (size_t)at + (size_t)n);
    j->last_ns = t_ns;
    j->ran = false;
}

static int64_t now_ns(const struct journal *j)
{
    return j->bench->sched.now_ns;
}

/* A name that can be in quotes as it is. */
static void copy_plain(const char *name, char *out, size_t cap)
{
    size_t n = 0;
    for (; *name && n + 1 < cap; name++) {
        if (*name > ' ' && *name < 0x7F && *name != '"' && *name != '\\') out[n++] = *name;
    }
    out[n] = '\0';
}

static void on_bus_event(void *ctx, const struct can_hub *h, const struct can_client *c, enum can_hub_event event,
                         const struct can_msg *m)
{
    const struct journal_tap *tap = ctx;
    struct journal *j = tap->journal;
    char text[160];
    (void)h;
    if (event == CAN_HUB_JOINED) {
        copy_plain(c->name, text, sizeof c->name);
        add_line(j, now_ns(j), "\"bus\":%u,\"came\":%" PRIu32 ",\"heir_of\":%" PRIu32 ",\"name\":\"%s\",\"fd\":%s}\n",
                 tap->bus, c->number, c->adopts, text, c->node.fd ? "true" : "false");
    } else if (event == CAN_HUB_LEFT) {
        add_line(j, now_ns(j), "\"bus\":%u,\"went\":%" PRIu32 "}\n", tap->bus, c->number);
    } else {
        can_text_put(m, text);
        add_line(j, now_ns(j), "\"bus\":%u,\"from\":%" PRIu32 ",\"frame\":\"%s\"}\n", tap->bus, c->number, text);
    }
}

/* Multiplication by an odd number and a rotation lose nothing, so a difference stays one. */
static uint64_t mix_hash(uint64_t sum, uint64_t x)
{
    sum = (sum ^ x) * UINT64_C(0x9E3779B97F4A7C15);
    return sum << 29 | sum >> 35;
}

static void on_rx_other(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct journal_tap *tap = ctx;
    uint64_t sum =
        mix_hash(mix_hash(tap->traffic, (uint64_t)t_ns), (uint64_t)m->id << 16 | (uint64_t)m->flags << 8 | m->len);
    for (unsigned i = 0; i < m->len; i += 8) {
        uint64_t bytes = 0;
        for (unsigned k = 0; k < 8 && i + k < m->len; k++) bytes = bytes << 8 | m->data[i + k];
        sum = mix_hash(sum, bytes);
    }
    tap->traffic = sum;
}

void journal_follow(struct journal *j, struct can_hub *h, unsigned bus)
{
    struct journal_tap *tap = &j->tap[bus];
    *tap = (struct journal_tap){.journal = j, .bus = bus};
    tap->observer = (struct can_node){.name = "journal", .fd = true, .rx = on_rx_other, .ctx = tap};
    h->tap = (struct can_hub_tap){.event = on_bus_event, .ctx = tap};
    can_attach(h->bus, &tap->observer);
}

void journal_command(struct journal *j, const struct control_command *row, const cJSON *args, bool done)
{
    if (j->bench->sched.until_ns >= 0) return; /* inside a run: timeline and faults of the scenario */
    cJSON *copy = cJSON_Duplicate(args, true);
    char *text = copy ? exact_line(copy) : NULL;
    const size_t n = text ? strlen(text) : 0;
    cJSON_Delete(copy);
    if (!text) j->lost = "out of memory for the input log";
    else if (n + 128 > JOURNAL_LINE_MAX) j->lost = "a command was longer than a line of the journal (8 KiB)";
    else {
        add_line(j, now_ns(j), "%s\"cmd\":\"%s\",\"args\":", done ? "" : "\"refused\":true,", row->name);
        put_text(j, text, n);
        put_text(j, "}\n", 2);
    }
    free(text);
}

void journal_cycle(struct journal *j, unsigned unit, const struct board_cycle *c)
{
    if (j->bench->sched.until_ns >= 0) return; /* inside a run: done again by itself */
    add_line(j, now_ns(j), "\"unit\":%u,\"cycle\":%u,\"write\":%s,\"data\":%u,\"strobe_ns\":%" PRId64 "}\n", unit,
             c->address, c->write ? "true" : "false", c->data, c->strobe_ns);
}

void journal_watchers(struct journal *j)
{
    if (j->changes == j->bench->traces.changes) return;
    j->changes = j->bench->traces.changes;
    for (unsigned i = 0; i < j->bench->scenario.unit_count; i++) {
        const uint64_t watched = unit_trace(&j->bench->unit[i])->watched;
        if (watched == j->watched[i]) continue;
        assert((double)watched <= LINES_MAX);
        j->watched[i] = watched;
        add_line(j, j->moved_ns, "\"unit\":%u,\"watch\":%" PRIu64 "}\n", i, watched);
    }
}

void journal_moved(struct journal *j)
{
    journal_watchers(j); /* they came while time stood still where it was before */
    j->moved_ns = now_ns(j);
    j->ran = true;
}

/* ---- how full it is */

bool journal_news(struct journal *j, int64_t now_ns, char news[JOURNAL_NEWS_MAX])
{
    static const unsigned steps[] = {50, 90};
    enum { STEPS = sizeof steps / sizeof *steps };
    const double now_s = (double)now_ns * 1e-9;
    if (j->lost && j->said <= STEPS) {
        j->said = STEPS + 1;
        snprintf(news, JOURNAL_NEWS_MAX, "input log: %s; snapshots are not possible from now on", j->lost);
        return true;
    }
    if (j->said >= STEPS || j->len <= JOURNAL_MAX / 100 * steps[j->said]) return false;
    snprintf(
        news, JOURNAL_NEWS_MAX,
        "input log: %u %% of %u MiB are used after %.0f s of simulated time; at this rate it is full at %.0f s, and "
        "snapshots are not possible from then on",
        steps[j->said++], JOURNAL_MAX >> 20, now_s, now_s * (double)JOURNAL_MAX / (double)j->len);
    return true;
}

/* ---- reading */

static bool get_count(const cJSON *json, const char *name, double max, double *out)
{
    const cJSON *j = cJSON_GetObjectItemCaseSensitive(json, name);
    if (!cJSON_IsNumber(j) || !(j->valuedouble >= 0 && j->valuedouble <= max)) return false;
    *out = j->valuedouble;
    return *out == (double)(int64_t)*out;
}

static bool read_came(const cJSON *json, struct journal_entry *e)
{
    double adopts;
    const cJSON *name = cJSON_GetObjectItemCaseSensitive(json, "name");
    const cJSON *fd = cJSON_GetObjectItemCaseSensitive(json, "fd");
    if (!cJSON_IsString(name) || !cJSON_IsBool(fd)) return false;
    if (!get_count(json, "heir_of", UINT32_MAX, &adopts)) return false;
    e->adopts = (uint32_t)adopts;
    snprintf(e->name, sizeof e->name, "%.31s", name->valuestring);
    e->fd = cJSON_IsTrue(fd);
    return true;
}

static bool read_sent(const cJSON *json, struct journal_entry *e)
{
    const cJSON *frame = cJSON_GetObjectItemCaseSensitive(json, "frame");
    return cJSON_IsString(frame) && can_text_get(frame->valuestring, &e->m);
}

static bool read_command(const cJSON *json, struct journal_entry *e)
{
    const cJSON *cmd = cJSON_GetObjectItemCaseSensitive(json, "cmd");
    e->args = cJSON_GetObjectItemCaseSensitive(json, "args");
    if (!cJSON_IsString(cmd) || !cJSON_IsObject(e->args)) return false;
    e->cmd = cmd->valuestring;
    e->refused = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(json, "refused"));
    return true;
}

static bool read_cycle(const cJSON *json, struct journal_entry *e)
{
    double data, strobe_ns;
    const cJSON *write = cJSON_GetObjectItemCaseSensitive(json, "write");
    if (!cJSON_IsBool(write)) return false;
    if (!get_count(json, "data", UINT16_MAX, &data) || !get_count(json, "strobe_ns", 1e15, &strobe_ns)) return false;
    e->cycle.write = cJSON_IsTrue(write);
    e->cycle.data = (uint16_t)data;
    e->cycle.strobe_ns = (int64_t)strobe_ns;
    return true;
}

/* What kind a line is of, by the member that only it has; where its number goes. */
static bool read_kind(const cJSON *json, struct journal_entry *e)
{
    static const char *const member[] = {"came", "went", "from", "cmd", "watch", "cycle"};
    double n = 0, place = 0;
    for (e->kind = JOURNAL_CAME; e->kind < JOURNAL_CYCLE; e->kind++) {
        if (cJSON_HasObjectItem(json, member[e->kind])) break;
    }
    if (e->kind == JOURNAL_COMMAND) return read_command(json, e);
    static const double most[] = {UINT32_MAX, UINT32_MAX, UINT32_MAX, 0, LINES_MAX, UINT8_MAX};
    const bool unit = e->kind == JOURNAL_WATCH || e->kind == JOURNAL_CYCLE;
    if (!get_count(json, member[e->kind], most[e->kind], &n)) return false;
    if (!get_count(json, unit ? "unit" : "bus", unit ? CONTROL_UNITS_MAX - 1 : CONTROL_BUSES_MAX - 1, &place))
        return false;
    *(unit ? &e->unit : &e->bus) = (unsigned)place;
    if (e->kind == JOURNAL_WATCH) e->watch = (uint64_t)n;
    else if (e->kind == JOURNAL_CYCLE) e->cycle.address = (uint8_t)n;
    else e->client = (uint32_t)n;
    if (e->kind == JOURNAL_CYCLE) return read_cycle(json, e);
    if (!unit && n == 0) return false;
    return e->kind == JOURNAL_CAME ? read_came(json, e) : e->kind != JOURNAL_FRAME || read_sent(json, e);
}

bool journal_read(const char *line, size_t len, struct journal_entry *e, char *why, size_t cap)
{
    double t_ns = 0;
    *e = (struct journal_entry){.json = len <= JOURNAL_LINE_MAX ? cJSON_ParseWithLength(line, len) : NULL};
    if (!cJSON_IsObject(e->json)) {
        journal_release(e);
        return why_fail(why, cap, "expected a JSON object of up to %u bytes", JOURNAL_LINE_MAX);
    }
    e->ran = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(e->json, "ran"));
    if (get_count(e->json, "t", 1e15 * 9, &t_ns) && read_kind(e->json, e)) {
        e->t_ns = (int64_t)t_ns;
        return true;
    }
    journal_release(e);
    return why_fail(why, cap, "expected an entry of an input log");
}

void journal_release(struct journal_entry *e)
{
    cJSON_Delete(e->json);
    e->json = NULL;
}

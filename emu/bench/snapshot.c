#define _GNU_SOURCE /* fileno */
#include "bench/snapshot.h"

#include "base/text.h"
#include "base/why.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define VERSION TEXT_OF(PSABENCH_VERSION)

enum { WHY_MAX = 512 };

/* ---- writing */

struct writer {
    FILE *out;
    struct sha256 sum;
    bool failed;
};

static void put_bytes(struct writer *w, const char *text, size_t n)
{
    sha256_add(&w->sum, text, n);
    w->failed |= fwrite(text, 1, n, w->out) != n;
}

static void put_text(struct writer *w, const char *text)
{
    put_bytes(w, text, strlen(text));
}

static uint64_t count_lines(const char *text, size_t n)
{
    uint64_t lines = 0;
    for (const char *p = text; n && (p = memchr(p, '\n', n - (size_t)(p - text))); p++) lines++;
    return lines;
}

static void put_end(struct writer *w, const struct journal *j)
{
    char state[SHA256_HEX], line[256];
    digest_bench(j->bench, j, state);
    const int64_t now_ns = j->bench->sched.now_ns;
    const bool ran = j->ran && now_ns == j->last_ns;
    snprintf(line, sizeof line, "{\"end\":%" PRId64 ",\"ran\":%s,\"entries\":%" PRIu64 ",\"state\":\"%s\"}\n", now_ns,
             ran ? "true" : "false", count_lines(j->text, j->len), state);
    put_text(w, line);
}

static void put_all(struct writer *w, const struct journal *j, const char *scenario)
{
    char head[128], sum[SHA256_HEX];
    sha256_init(&w->sum);
    snprintf(head, sizeof head, "{\"psabench\":\"snapshot\",\"format\":%d,\"version\":\"%s\"}\n", SNAPSHOT_FORMAT,
             VERSION);
    put_text(w, head);
    put_text(w, scenario);
    put_text(w, "\n");
    if (j->len) put_bytes(w, j->text, j->len);
    put_end(w, j);
    sha256_hex(&w->sum, sum);
    w->failed |= fprintf(w->out, "{\"sha256\":\"%s\"}\n", sum) < 0;
}

bool snapshot_write(const char *path, struct journal *j, const char *scenario, char *why, size_t cap)
{
    char part[1100];
    journal_watchers(j);
    if (j->lost) return why_fail(why, cap, "%s: %s", path, j->lost);
    if (strchr(scenario, '\n') || strlen(scenario) > SNAPSHOT_SCENARIO_MAX)
        return why_fail(why, cap, "%s: expected a scenario of one line and up to 8 MiB", path);
    if ((size_t)snprintf(part, sizeof part, "%s.%ld.part", path, (long)getpid()) >= sizeof part)
        return why_fail(why, cap, "%.80s...: expected a shorter path", path);
    struct stat there; /* a device or a pipe would be replaced, too */
    if (lstat(path, &there) == 0 && !S_ISREG(there.st_mode) && !S_ISDIR(there.st_mode))
        return why_fail(why, cap, "%s: expected a file or a new name, got another kind of file", path);
    struct writer w = {.out = fopen(part, "wbe")};
    if (!w.out) return why_unwritable(why, cap, path, errno);
    put_all(&w, j, scenario);
    w.failed |= fflush(w.out) != 0 || fsync(fileno(w.out)) < 0;
    const int err = errno;
    w.failed |= fclose(w.out) != 0;
    if (!w.failed && rename(part, path) == 0) return true;
    unlink(part);
    return why_unwritable(why, cap, path, w.failed ? err : errno);
}

/* ---- reading */

struct reader {
    const char *at, *end;
    unsigned line; /* number of the next one */
};

/* The next line without its LF; false when there is none. */
static bool next_line(struct reader *r, const char **line, size_t *n)
{
    const char *lf = r->at < r->end ? memchr(r->at, '\n', (size_t)(r->end - r->at)) : NULL;
    if (!lf) return false;
    *line = r->at;
    *n = (size_t)(lf - r->at);
    r->at = lf + 1;
    r->line++;
    return true;
}

static bool check_head(const char *line, size_t n, char *why, size_t cap)
{
    cJSON *j = n < 512 ? cJSON_ParseWithLength(line, n) : NULL;
    const cJSON *what = cJSON_GetObjectItemCaseSensitive(j, "psabench");
    const cJSON *format = cJSON_GetObjectItemCaseSensitive(j, "format");
    const cJSON *version = cJSON_GetObjectItemCaseSensitive(j, "version");
    bool good = true;
    if (!cJSON_IsString(what) || strcmp(what->valuestring, "snapshot") != 0 || !cJSON_IsNumber(format) ||
        !cJSON_IsString(version)) {
        good = why_fail(why, cap, "expected a snapshot of psa-emu, got another file");
    } else if (format->valuedouble != SNAPSHOT_FORMAT || strcmp(version->valuestring, VERSION) != 0) {
        good = why_fail(why, cap, "expected a snapshot of version %s and format %d, got version %.40s and format %g",
                        VERSION, SNAPSHOT_FORMAT, version->valuestring, format->valuedouble);
    }
    cJSON_Delete(j);
    return good;
}

/* The last line has the sum of all before it. Returns where that line begins; NULL: none, or another sum. */
static const char *check_sum(const char *text, size_t len)
{
    char sum[SHA256_HEX], line[96];
    struct sha256 s;
    const size_t n = (size_t)snprintf(line, sizeof line, "{\"sha256\":\"%064d\"}\n", 0);
    if (len < n) return NULL;
    sha256_init(&s);
    sha256_add(&s, text, len - n);
    sha256_hex(&s, sum);
    snprintf(line, sizeof line, "{\"sha256\":\"%s\"}\n", sum);
    return memcmp(text + len - n, line, n) == 0 ? text + len - n : NULL;
}

static bool read_end(const char *line, size_t n, struct snapshot *s)
{
    cJSON *j = n < 512 ? cJSON_ParseWithLength(line, n) : NULL;
    const cJSON *end = cJSON_GetObjectItemCaseSensitive(j, "end");
    const cJSON *entries = cJSON_GetObjectItemCaseSensitive(j, "entries");
    const cJSON *state = cJSON_GetObjectItemCaseSensitive(j, "state");
    const bool good = cJSON_IsNumber(end) && end->valuedouble >= 0 && end->valuedouble <= 9e15 &&
                      cJSON_IsNumber(entries) && entries->valuedouble >= 0 && entries->valuedouble <= 9e15 &&
                      cJSON_IsString(state) && strlen(state->valuestring) == SHA256_HEX - 1;
    if (good) {
        s->end_ns = (int64_t)end->valuedouble;
        s->entries = (uint64_t)entries->valuedouble;
        s->ran = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(j, "ran"));
        memcpy(s->state, state->valuestring, SHA256_HEX);
    }
    cJSON_Delete(j);
    return good;
}

/* Every entry can be read, time does not go back, and the end is where the last one is or later. */
static bool check_journal(struct snapshot *s, struct reader *r, char *why, size_t cap)
{
    char what[128];
    const char *line;
    size_t n;
    int64_t last_ns = 0;
    for (uint64_t i = 0; i < s->entries; i++) {
        struct journal_entry e;
        if (!next_line(r, &line, &n)) return why_fail(why, cap, "expected as many entries as its head says, got fewer");
        if (!journal_read(line, n, &e, what, sizeof what)) return why_fail(why, cap, "line %u: %s", r->line - 1, what);
        const int64_t t_ns = e.t_ns;
        journal_release(&e);
        if (t_ns < last_ns || t_ns > s->end_ns)
            return why_fail(why, cap, "line %u: expected a time after that of the line before", r->line - 1);
        last_ns = t_ns;
    }
    return r->at == r->end || why_fail(why, cap, "expected as many entries as its head says, got more");
}

static bool parse_snapshot(struct snapshot *s, size_t len, char *why, size_t cap)
{
    const char *line;
    size_t n;
    struct reader r = {.at = s->text, .end = s->text + len, .line = 1};
    if (!next_line(&r, &line, &n)) return why_fail(why, cap, "expected a snapshot of psa-emu, got another file");
    if (!check_head(line, n, why, cap)) return false;
    const char *end = check_sum(s->text, len);
    if (!end) return why_fail(why, cap, "expected the SHA-256 that it ends with, got another: the file is damaged");
    r.end = end;
    if (!next_line(&r, &s->scenario, &s->scenario_len) || s->scenario_len > SNAPSHOT_SCENARIO_MAX)
        return why_fail(why, cap, "expected a scenario, got none");
    s->text[s->scenario + s->scenario_len - s->text] = '\0';
    s->journal = r.at;
    const char *last = end - 1; /* the LF before the sum */
    while (last > r.at && last[-1] != '\n') last--;
    if (last < r.at || !read_end(last, (size_t)(end - last), s)) return why_fail(why, cap, "expected an end, got none");
    r.end = last;
    s->journal_len = (size_t)(last - s->journal);
    return check_journal(s, &r, why, cap);
}

bool snapshot_parse(char *text, size_t len, struct snapshot *s, char *why, size_t cap)
{
    *s = (struct snapshot){.text = text};
    if (parse_snapshot(s, len, why, cap)) return true;
    snapshot_free(s);
    return false;
}

/* The whole file with a NUL behind it; NULL with the reason. */
static char *read_file(const char *path, size_t *len, char *why, size_t cap)
{
    FILE *in = fopen(path, "rbe");
    if (!in) {
        why_expected(why, cap, path, why_found(errno), "a snapshot");
        return NULL;
    }
    size_t room = 1 << 16;
    char *text = malloc(room + 1);
    *len = 0;
    for (size_t n; text && (n = fread(text + *len, 1, room - *len, in)) > 0;) {
        *len += n;
        if (*len < room) continue;
        char *more = room < SNAPSHOT_MAX ? realloc(text, 2 * room + 1) : NULL;
        if (!more) free(text);
        text = more;
        room *= 2;
    }
    const int err = errno;
    const bool bad = ferror(in);
    fclose(in);
    if (text && !bad) {
        text[*len] = '\0';
        return text;
    }
    free(text);
    why_expected(why, cap, path, bad ? why_found(err) : "a larger file", "a snapshot");
    return NULL;
}

bool snapshot_load(const char *path, struct snapshot *s, char *why, size_t cap)
{
    size_t len;
    char what[WHY_MAX];
    *s = (struct snapshot){0};
    char *text = read_file(path, &len, why, cap);
    if (!text) return false;
    if (snapshot_parse(text, len, s, what, sizeof what)) return true;
    return why_fail(why, cap, "%s: %s", path, what);
}

void snapshot_free(struct snapshot *s)
{
    free(s->text);
    *s = (struct snapshot){0};
}

/* ---- doing it again */

struct replay {
    const struct snapshot_world *w;
    char why[WHY_MAX];
};

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    (void)ctx;
    (void)s;
    (void)n;
}

static void attach_observer(struct snapshot_observers *e, struct bench *b, unsigned unit, uint64_t mask)
{
    struct trace *t = unit_trace(&b->unit[unit]);
    struct trace_sink *observer = &e->observer[unit];
    trace_detach(t, observer);
    *observer = (struct trace_sink){.mask = mask, .steps = on_steps};
    if (mask) trace_attach(t, observer);
    e->on = true;
}

void snapshot_observe_lines(struct snapshot_observers *e, struct bench *b)
{
    for (unsigned i = 0; i < b->scenario.unit_count; i++) {
        const uint64_t watched = unit_trace(&b->unit[i])->watched;
        if (watched) attach_observer(e, b, i, watched);
    }
}

void snapshot_release_lines(struct snapshot_observers *e, struct bench *b)
{
    for (unsigned i = 0; i < b->scenario.unit_count && e->on; i++)
        trace_detach(unit_trace(&b->unit[i]), &e->observer[i]);
    e->on = false;
}

static void run_to(const struct snapshot_world *w, int64_t t_ns)
{
    struct sched *s = &w->bench->sched;
    do {
        const int64_t next_ns = sched_next_ns(s);
        const int64_t from_ns = next_ns > s->now_ns ? next_ns : s->now_ns;
        sched_run_towards(s, from_ns >= t_ns - BENCH_SLICE_NS ? t_ns : from_ns + BENCH_SLICE_NS, t_ns);
        bench_follow(w->bench);
        journal_moved(w->journal);
    } while (s->now_ns < t_ns);
}

static struct can_client *find_client(const struct can_hub *h, uint32_t number)
{
    struct can_client *c = h->clients;
    while (c && c->number != number) c = c->next;
    return c;
}

static bool do_came(struct replay *r, struct can_hub *h, const struct journal_entry *e)
{
    struct can_client *before = e->adopts ? find_client(h, e->adopts) : NULL;
    if (e->adopts && !before)
        return why_fail(r->why, WHY_MAX, "expected client %" PRIu32 " on the bus, got none", e->adopts);
    if (before) before->slot_free = true;
    return can_hub_add_detached(h, e->client, e->name, e->fd) || why_fail(r->why, WHY_MAX, "out of memory");
}

static bool do_client(struct replay *r, const struct journal_entry *e)
{
    if (e->bus >= r->w->buses) return why_fail(r->why, WHY_MAX, "expected a bus of the scenario, got %u", e->bus);
    struct can_hub *h = r->w->hub[e->bus];
    struct can_client *c = find_client(h, e->client);
    if (!c != (e->kind == JOURNAL_CAME)) {
        return why_fail(r->why, WHY_MAX, "client %" PRIu32 " %s on the bus", e->client, c ? "is already" : "is not");
    }
    if (e->kind == JOURNAL_CAME) return do_came(r, h, e);
    if (e->kind == JOURNAL_WENT) can_hub_remove_detached(h, c);
    else if (!can_hub_send(h, c, &e->m, e->t_ns)) return why_fail(r->why, WHY_MAX, "frame rejected by the bus");
    return true;
}

static bool do_command(struct replay *r, const struct journal_entry *e)
{
    struct control *c = r->w->control;
    const struct control_command *row = control_find(c->tables, e->cmd);
    if (!row || !row->changes)
        return why_fail(r->why, WHY_MAX, "expected a command that changes the bench, got \"%.40s\"", e->cmd);
    cJSON *result = cJSON_CreateObject();
    const enum control_outcome outcome = control_call(c, e->cmd, e->args, result, e->t_ns);
    cJSON_Delete(result);
    if ((outcome == CONTROL_REJECTED) == e->refused) return true; /* a bus cycle is answered later */
    return why_fail(r->why, WHY_MAX, "%s: %s", e->cmd, e->refused ? "expected an error, got success" : c->error.why);
}

/* Lines that are observed, or a cycle on its bus. */
static bool do_unit(struct replay *r, const struct journal_entry *e)
{
    struct bench *b = r->w->bench;
    if (e->unit >= b->scenario.unit_count)
        return why_fail(r->why, WHY_MAX, "expected a unit of the scenario, got %u", e->unit);
    if (e->kind == JOURNAL_WATCH) {
        attach_observer(r->w->observers, b, e->unit, e->watch);
        return true;
    }
    if (!b->unit[e->unit].type->bus) return why_fail(r->why, WHY_MAX, "expected a unit with a bus, got %u", e->unit);
    (void)bench_cycle(b, e->unit, &(struct bench_cycle){.cycle = e->cycle}, e->t_ns); /* rejected again, if it was */
    return true;
}

static bool do_entry(struct replay *r, const struct journal_entry *e)
{
    struct sched *s = &r->w->bench->sched;
    if (e->t_ns > s->now_ns || e->ran) run_to(r->w, e->t_ns);
    if (e->kind == JOURNAL_COMMAND) return do_command(r, e);
    return e->kind == JOURNAL_WATCH || e->kind == JOURNAL_CYCLE ? do_unit(r, e) : do_client(r, e);
}

static bool do_all(struct replay *r, const struct snapshot *s)
{
    struct reader lines = {.at = s->journal, .end = s->journal + s->journal_len};
    const char *line;
    size_t n;
    while (next_line(&lines, &line, &n)) {
        struct journal_entry e;
        if (!journal_read(line, n, &e, r->why, WHY_MAX)) return false;
        const bool good = do_entry(r, &e);
        journal_release(&e);
        if (!good) return false;
    }
    if (s->end_ns > r->w->bench->sched.now_ns || s->ran) run_to(r->w, s->end_ns);
    return true;
}

bool snapshot_replay(const struct snapshot *s, const struct snapshot_world *w, char *why, size_t cap)
{
    struct replay r = {.w = w};
    char state[SHA256_HEX];
    bool good = do_all(&r, s) || why_fail(why, cap, "replay failed: %s", r.why);
    journal_watchers(w->journal);
    digest_bench(w->bench, w->journal, state);
    if (good && strcmp(state, s->state) != 0) {
        good = why_fail(why, cap, "the replay ends in another state: another build or machine wrote it");
    }
    for (unsigned i = 0; i < w->buses && good; i++) can_hub_free_slots(w->hub[i]);
    return good;
}

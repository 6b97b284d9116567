#include "scenario/yaml_file.h"

#include "base/text.h"
#include "base/why.h"

#include <ctype.h>
#include <errno.h>
#include <libfyaml.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* "path:12:11: units.a.node: " */
static size_t put_where(struct yaml_file *f, const struct yaml_node *node, const char *key)
{
    const int n = snprintf(f->why, f->cap, "%s:%u:%u: %s%s%s", f->path, node ? node->line : 1, node ? node->column : 1,
                           f->where, key ? key : "", key ? ": " : "");
    return n >= 0 && (size_t)n < f->cap ? (size_t)n : f->cap;
}

bool yaml_file_fail(struct yaml_file *f, const struct yaml_node *node, const char *key, const char *format, ...)
{
    va_list ap;
    const size_t n = put_where(f, node, key);
    va_start(ap, format);
    vsnprintf(f->why + n, f->cap - n, format, ap);
    va_end(ap);
    text_one_line(f->why);
    return false;
}

/* Numbers as they are written, other words in quotes. */
static const char *describe_node(const struct yaml_node *node, char out[WHY_TEXT_MAX])
{
    if (node->kind != YAML_SCALAR) return node->kind == YAML_MAPPING ? "a mapping" : "a list";
    if (node->len > YAML_FILE_TEXT || strlen(node->text) != node->len) return "a text too long or with a NUL";
    if (!node->plain || !strchr("+-.0123456789", node->text[0]) || node->len > 20) return why_text(out, node->text);
    return node->text;
}

bool yaml_file_expected(struct yaml_file *f, const struct yaml_node *node, const char *key, const char *expected, ...)
{
    char where[640], got[WHY_TEXT_MAX];
    va_list ap;
    (void)put_where(f, node, key);
    snprintf(where, sizeof where, "%.630s", f->why);
    const size_t len = strlen(where);
    if (len >= 2 && strcmp(where + len - 2, ": ") == 0) where[len - 2] = '\0';
    va_start(ap, expected);
    why_vexpected(f->why, f->cap, where, node ? describe_node(node, got) : NULL, expected, ap);
    va_end(ap);
    return false;
}

/* ---- from events to a tree */

struct anchor {
    char name[40];
    struct yaml_node *node;
};

enum { ANCHORS_MAX = 64 };

struct builder {
    struct yaml_file *f;
    struct yaml_node *open[YAML_DEPTH_MAX]; /* sequences and mappings under way, outermost first */
    struct yaml_item *last[YAML_DEPTH_MAX];
    struct yaml_node *key[YAML_DEPTH_MAX]; /* of a mapping: waits for its value */
    int anchor_of[YAML_DEPTH_MAX];         /* an anchor counts from the end of its node on: -1 none */
    unsigned depth;
    struct anchor anchor[ANCHORS_MAX];
    unsigned anchors;
};

static struct yaml_node *new_node(struct builder *b, enum yaml_kind kind, const struct fy_mark *m, const char *text,
                                  size_t len)
{
    struct yaml_node *n = calloc(1, sizeof *n + len + 1);
    if (!n) return NULL;
    const struct yaml_node *near = b->depth ? b->key[b->depth - 1] : NULL; /* an empty value is nowhere */
    n->kind = kind;
    n->line = m ? (unsigned)m->line + 1 : near ? near->line : 1;
    n->column = m ? (unsigned)m->column + 1 : near ? near->column : 1;
    n->len = len;
    if (len) memcpy(n->text, text, len);
    n->older = b->f->newest;
    b->f->newest = n;
    return n;
}

static bool append_item(struct builder *b, struct yaml_node *value)
{
    const unsigned d = b->depth - 1;
    struct yaml_item *item = calloc(1, sizeof *item);
    if (!item) return yaml_file_fail(b->f, value, NULL, "out of memory");
    *item = (struct yaml_item){.key = b->key[d], .value = value};
    b->key[d] = NULL;
    if (b->last[d]) b->last[d]->next = item;
    else b->open[d]->first = item;
    b->last[d] = item;
    return true;
}

/* A node is whole as far as its place goes: root, key, or value. */
static bool place_node(struct builder *b, struct yaml_node *n)
{
    if (b->depth == 0) {
        if (b->f->root) return yaml_file_fail(b->f, n, NULL, "expected one document, got a second");
        b->f->root = n;
        return true;
    }
    const unsigned d = b->depth - 1;
    if (b->open[d]->kind != YAML_MAPPING || b->key[d]) return append_item(b, n);
    b->key[d] = n;
    return true;
}

/* Number of a new anchor, -1 for none; its node is set when it has ended, so that no node contains itself. */
static int new_anchor(struct builder *b, struct fy_token *t)
{
    size_t len = 0;
    const char *name = t ? fy_token_get_text(t, &len) : NULL;
    if (!name || b->anchors == ANCHORS_MAX || len >= sizeof b->anchor->name) return -1;
    struct anchor *a = &b->anchor[b->anchors];
    *a = (struct anchor){.node = NULL};
    memcpy(a->name, name, len);
    return (int)b->anchors++;
}

static void set_anchor(struct builder *b, int anchor, struct yaml_node *n)
{
    if (anchor >= 0) b->anchor[anchor].node = n;
}

static bool add_scalar(struct builder *b, const struct fy_event *e, const struct fy_mark *m)
{
    size_t len = 0;
    const char *text = e->scalar.value ? fy_token_get_text(e->scalar.value, &len) : NULL;
    struct yaml_node *n = new_node(b, YAML_SCALAR, m, text, text ? len : 0);
    if (!n) return yaml_file_fail(b->f, NULL, NULL, "out of memory");
    const enum fy_scalar_style style = e->scalar.value ? fy_token_scalar_style(e->scalar.value) : FYSS_ANY;
    n->plain = style == FYSS_PLAIN;
    const bool quoted = style == FYSS_SINGLE_QUOTED || style == FYSS_DOUBLE_QUOTED;
    n->column -= quoted && n->column > 1; /* the mark is behind the quote */
    set_anchor(b, new_anchor(b, e->scalar.anchor), n);
    return place_node(b, n);
}

static bool add_alias(struct builder *b, const struct fy_event *e, const struct fy_mark *m)
{
    size_t len = 0;
    const char *name = fy_token_get_text(e->alias.anchor, &len);
    const struct yaml_node at = {.line = m ? (unsigned)m->line + 1 : 1,
                                 .column = m && m->column ? (unsigned)m->column : 1}; /* the mark is behind the star */
    for (unsigned i = b->anchors; name && i-- > 0;) {                                 /* the latest of that name */
        const struct anchor *a = &b->anchor[i];
        if (strlen(a->name) == len && memcmp(a->name, name, len) == 0 && a->node) return place_node(b, a->node);
    }
    return yaml_file_fail(b->f, &at, NULL,
                          "*%.*s: expected an anchor before this (up to %d, of up to %zu characters), got none",
                          (int)(len < 40 ? len : 40), name ? name : "", ANCHORS_MAX, sizeof b->anchor->name - 1);
}

static bool begin_collection(struct builder *b, enum yaml_kind kind, struct fy_token *anchor, const struct fy_mark *m)
{
    struct yaml_node *n = new_node(b, kind, m, NULL, 0);
    if (!n) return yaml_file_fail(b->f, NULL, NULL, "out of memory");
    if (b->depth == YAML_DEPTH_MAX)
        return yaml_file_fail(b->f, n, NULL, "expected up to %u levels, got more", YAML_DEPTH_MAX);
    if (!place_node(b, n)) return false;
    b->open[b->depth] = n;
    b->last[b->depth] = NULL;
    b->key[b->depth] = NULL;
    b->anchor_of[b->depth++] = new_anchor(b, anchor);
    return true;
}

static bool end_collection(struct builder *b)
{
    b->depth--;
    set_anchor(b, b->anchor_of[b->depth], b->open[b->depth]);
    return true;
}

static bool add_event(struct builder *b, struct fy_event *e)
{
    const struct fy_mark *m = fy_event_start_mark(e);
    switch (e->type) {
    case FYET_SCALAR:
        return add_scalar(b, e, m);
    case FYET_ALIAS:
        return add_alias(b, e, m);
    case FYET_SEQUENCE_START:
        return begin_collection(b, YAML_SEQUENCE, e->sequence_start.anchor, m);
    case FYET_MAPPING_START:
        return begin_collection(b, YAML_MAPPING, e->mapping_start.anchor, m);
    case FYET_SEQUENCE_END:
    case FYET_MAPPING_END:
        return end_collection(b);
    default:
        return true;
    }
}

static bool tell_parser(struct yaml_file *f, struct fy_diag *diag)
{
    void *prev = NULL;
    const struct fy_diag_error *e = fy_diag_errors_iterate(diag, &prev);
    const int line = e && e->line > 0 ? e->line : 1, column = e && e->column > 0 ? e->column : 1;
    snprintf(f->why, f->cap, "%s:%d:%d: not YAML: %s", f->path, line, column, e && e->msg ? e->msg : "no such text");
    text_one_line(f->why);
    return false;
}

static bool build_tree(struct yaml_file *f, struct fy_parser *p, struct fy_diag *diag)
{
    struct builder b = {.f = f};
    bool ok = true;
    for (struct fy_event *e; ok && (e = fy_parser_parse(p));) {
        ok = add_event(&b, e);
        fy_parser_event_free(p, e);
    }
    if (ok && fy_parser_get_stream_error(p)) return tell_parser(f, diag);
    if (ok && !f->root) return yaml_file_fail(f, NULL, NULL, "expected a mapping `key: value`, got an empty file");
    return ok;
}

/* Whether text[i] begins a byte order mark. */
static bool order_mark(const char *text, size_t len, size_t i)
{
    return len - i >= 3 && memcmp(text + i, "\xEF\xBB\xBF", 3) == 0;
}

/* Whether a word ends before text[i]. */
static bool word_before(const char *text, size_t i)
{
    const unsigned char c = i > 0 ? (unsigned char)text[i - 1] : ' ';
    return c >= 0x80 || isalnum(c) || strchr("_.)?", c);
}

/* `? ` where a key may begin, or might: quotes and comments are not looked for. */
static bool explicit_key(const char *text, size_t len, size_t i)
{
    return text[i] == '?' && (i + 1 == len || strchr(" \t\r\n", text[i + 1])) && !word_before(text, i);
}

/* What libfyaml 0.7.12 must not see: a NUL is the end to it, what follows would go unread; some directives, lines that
 * begin with %, be it behind a byte order mark, keep it busy without end; a tab behind an explicit key, `? KD:\t`, makes it
 * free the same memory twice. No one needs any of them. */
static bool check_bytes(struct yaml_file *f, const char *text, size_t len)
{
    struct yaml_node at = {.line = 1, .column = 1};
    for (size_t i = 0; i < len; i++) {
        if (text[i] == '\0') return yaml_file_fail(f, &at, NULL, "expected YAML, got a NUL byte");
        if (order_mark(text, len, i))
            return yaml_file_fail(f, &at, NULL, "expected no byte order mark within the text");
        if (text[i] == '%' && at.column == 1) return yaml_file_fail(f, &at, NULL, "expected no directive");
        if (explicit_key(text, len, i))
            return yaml_file_fail(f, &at, NULL, "expected `key: value`, got an explicit key (?)");
        const bool ends = text[i] == '\n' || text[i] == '\r';
        at.column = ends ? 1 : at.column + 1;
        at.line += text[i] == '\n';
    }
    return true;
}

bool yaml_file_parse(struct yaml_file *f, const char *path, const char *text, size_t len, char *why, size_t cap)
{
    struct fy_diag_cfg diag_cfg;
    *f = (struct yaml_file){.path = path, .why = why, .cap = cap};
    if (order_mark(text, len, 0)) { /* some editors put it there */
        text += 3;
        len -= 3;
    }
    if (!check_bytes(f, text, len)) return false;
    fy_diag_cfg_default(&diag_cfg);
    diag_cfg.fp = NULL;
    struct fy_diag *diag = fy_diag_create(&diag_cfg);
    if (diag) fy_diag_set_collect_errors(diag, true);
    const struct fy_parse_cfg cfg = {
        .search_path = "", .flags = FYPCF_QUIET | FYPCF_DEFAULT_VERSION_1_2 | FYPCF_JSON_NONE, .diag = diag};
    struct fy_parser *p = diag ? fy_parser_create(&cfg) : NULL;
    bool ok = p && fy_parser_set_string(p, text, len) == 0;
    if (!ok) yaml_file_fail(f, NULL, NULL, "out of memory");
    ok = ok && build_tree(f, p, diag);
    if (p) fy_parser_destroy(p);
    if (diag) fy_diag_destroy(diag);
    if (!ok) yaml_file_close(f);
    return ok;
}

bool yaml_file_open(struct yaml_file *f, const char *path, char *why, size_t cap)
{
    FILE *in = fopen(path, "rbe");
    if (!in) return why_expected(why, cap, path, why_found(errno), "a YAML file");
    char *text = malloc(YAML_FILE_MAX);
    const size_t len = text ? fread(text, 1, YAML_FILE_MAX, in) : 0;
    const int err = !text ? ENOMEM : ferror(in) ? errno : 0;
    fclose(in);
    if (err) why_expected(why, cap, path, why_found(err), "a YAML file");
    else if (len == YAML_FILE_MAX) why_fail(why, cap, "%s: expected up to %d bytes, got more", path, YAML_FILE_MAX);
    const bool ok = !err && len < YAML_FILE_MAX && yaml_file_parse(f, path, text, len, why, cap);
    free(text);
    return ok;
}

void yaml_file_close(struct yaml_file *f)
{
    for (struct yaml_node *n = f->newest, *older; n; n = older) {
        older = n->older;
        for (struct yaml_item *i = n->first, *next; i; i = next) {
            next = i->next;
            free(i);
        }
        free(n);
    }
    f->root = f->newest = NULL;
}

/* ---- looking at it */

const char *yaml_scalar(const struct yaml_node *node)
{
    if (!node || node->kind != YAML_SCALAR) return NULL;
    return node->len <= YAML_FILE_TEXT && strlen(node->text) == node->len ? node->text : NULL;
}

struct yaml_node *yaml_get(const struct yaml_node *node, const char *key)
{
    for (const struct yaml_item *i = node && node->kind == YAML_MAPPING ? node->first : NULL; i; i = i->next) {
        const char *name = yaml_scalar(i->key);
        if (name && strcmp(name, key) == 0) return i->value;
    }
    return NULL;
}

const struct yaml_node *yaml_at(const struct yaml_node *mapping, const char *key)
{
    const struct yaml_node *value = yaml_get(mapping, key);
    return value ? value : mapping;
}

unsigned yaml_count(const struct yaml_node *node)
{
    unsigned n = 0;
    for (const struct yaml_item *i = node->first; i; i = i->next) n++;
    return n;
}

/* ---- the nearest right name */

enum { WORD_MAX = 40 };

/* Edits (insert, leave out, replace, swap of neighbours) that make b of a; both up to WORD_MAX long. */
static unsigned edit_distance(const char *a, size_t na, const char *b, size_t nb)
{
    unsigned before[WORD_MAX + 1] = {0}, row[WORD_MAX + 1], next[WORD_MAX + 1];
    for (size_t j = 0; j <= nb; j++) row[j] = (unsigned)j;
    for (size_t i = 1; i <= na; i++) {
        next[0] = (unsigned)i;
        for (size_t j = 1; j <= nb; j++) {
            unsigned best = row[j - 1] + (a[i - 1] != b[j - 1]);
            if (row[j] + 1 < best) best = row[j] + 1;
            if (next[j - 1] + 1 < best) best = next[j - 1] + 1;
            const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
            if (swapped && before[j - 2] + 1 < best) best = before[j - 2] + 1;
            next[j] = best;
        }
        memcpy(before, row, sizeof row);
        memcpy(row, next, sizeof row);
    }
    return row[nb];
}

const char *yaml_nearest(const char *word, const char *(*name)(const void *ctx, size_t i), const void *ctx)
{
    const size_t len = strlen(word);
    const char *best = NULL, *found;
    unsigned best_edits = len < 2   ? 1
                          : len < 4 ? 2
                                    : (unsigned)len / 2 + 1; /* as many would make any word of any other */
    if (len == 0 || len > WORD_MAX) return NULL;
    for (size_t i = 0; (found = name(ctx, i)); i++) {
        const size_t n = strlen(found);
        if (n > len && strncmp(found, word, len) == 0 && found[len] == '_') return found;
        const unsigned e = n <= WORD_MAX ? edit_distance(word, len, found, n) : best_edits;
        if (e >= best_edits) continue;
        best_edits = e;
        best = found;
    }
    return best;
}

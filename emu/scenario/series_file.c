#define _GNU_SOURCE /* fileno */
#include "scenario/series_file.h"

#include "base/why.h"
#include "scenario/series_csv.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

enum { BLOCK = 1 << 16 };

struct reading {
    const char *path;
    struct series_csv csv;
    struct sha256 sum;
    FILE *samples;
    size_t count;
    unsigned long line;
    char *why;
    size_t cap;
};

static bool take_line(struct reading *r, const char *line, size_t n)
{
    char what[200];
    struct series_sample sample;
    r->line++;
    const enum series_csv_line kind = series_csv_line(&r->csv, line, n, &sample, what, sizeof what);
    if (kind == SERIES_CSV_BAD) return why_fail(r->why, r->cap, "%s:%lu: %s", r->path, r->line, what);
    if (kind == SERIES_CSV_NONE) return true;
    r->count++;
    return fwrite(&sample, sizeof sample, 1, r->samples) == 1 ||
           why_fail(r->why, r->cap, "temporary file for %s: %s", r->path, strerror(errno));
}

/* The whole lines of a buffer; *used: how many bytes they are. */
static bool take_lines(struct reading *r, const char *text, size_t n, size_t *used)
{
    const char *at = text;
    for (const char *lf; (lf = memchr(at, '\n', n - (size_t)(at - text))); at = lf + 1)
        if (!take_line(r, at, (size_t)(lf - at))) return false;
    *used = (size_t)(at - text);
    return true;
}

static bool read_lines(struct reading *r, FILE *in)
{
    char text[BLOCK];
    size_t held = 0, used;
    for (size_t n; (n = fread(text + held, 1, sizeof text - held, in)) > 0;) {
        sha256_add(&r->sum, text + held, n);
        held += n;
        if (!take_lines(r, text, held, &used)) return false;
        held -= used;
        memmove(text, text + used, held);
        if (held > SERIES_CSV_LINE) return take_line(r, text, held); /* no line is so long: it says so */
    }
    if (ferror(in)) return why_expected(r->why, r->cap, r->path, why_found(errno), "a recorded signal in CSV");
    if (held)
        return why_fail(r->why, r->cap, "%s:%lu: expected a line feed at the end, got none", r->path, r->line + 1);
    return r->count > 0 || why_fail(r->why, r->cap, "%s:%lu: expected samples, got none", r->path, r->line + 1);
}

static bool map_samples(struct reading *r, struct series *s)
{
    if (fflush(r->samples) != 0) return why_fail(r->why, r->cap, "temporary file for %s: %s", r->path, strerror(errno));
    void *p = mmap(NULL, r->count * sizeof *s->sample, PROT_READ, MAP_SHARED, fileno(r->samples), 0);
    if (p == MAP_FAILED) return why_fail(r->why, r->cap, "%s: cannot be mapped: %s", r->path, strerror(errno));
    s->sample = p;
    s->count = r->count;
    s->place = 0;
    return true;
}

static bool is_file(FILE *in)
{
    struct stat about;
    return fstat(fileno(in), &about) == 0 && S_ISREG(about.st_mode);
}

static bool read_file(struct reading *r, FILE *in, struct series *s)
{
    if (!is_file(in)) return why_fail(r->why, r->cap, "%s: expected a file, got another kind of file", r->path);
    r->samples = tmpfile();
    if (!r->samples) return why_fail(r->why, r->cap, "temporary file for %s: %s", r->path, strerror(errno));
    const bool good = read_lines(r, in) && map_samples(r, s);
    fclose(r->samples);
    return good;
}

bool series_file_open(const char *path, const char *column, struct series *s, char hex[SHA256_HEX], char *why,
                      size_t cap)
{
    struct reading r = {.path = path, .why = why, .cap = cap};
    FILE *in = fopen(path, "rbe");
    if (!in) return why_expected(why, cap, path, why_found(errno), "a recorded signal in CSV");
    series_csv_init(&r.csv, column);
    sha256_init(&r.sum);
    const bool good = read_file(&r, in, s);
    fclose(in);
    sha256_hex(&r.sum, hex);
    return good;
}

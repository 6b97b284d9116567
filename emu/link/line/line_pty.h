/* Adapter: the line port, a pseudo-terminal that streams sampled bytes of a unit's lines.
 *
 * Sampling begins when a program opens the port and stops when the last one closes it; while it is closed nothing is computed. In
 * wall pace a reader that is too slow loses samples, which the source marks; otherwise time waits for the reader. */
#ifndef PSABENCH_LINK_LINE_LINE_PTY_H
#define PSABENCH_LINK_LINE_LINE_PTY_H

#include "link/pty.h"

/* Where the bytes come from: the sampler of a trace, in the application's hands. */
struct line_source {
    void *ctx;
    bool (*start)(void *ctx, int64_t t_ns); /* discard waiting bytes and begin; false: not possible */
    void (*stop)(void *ctx);
    size_t (*take)(void *ctx, uint8_t *buf, size_t cap);
    size_t (*waiting)(void *ctx);
    size_t high; /* waiting bytes above which time should stand still; 0: never */
};

struct line_pty {
    struct link link; /* first: the master */
    struct pty pty;
    struct line_source source;
    bool sampling;
    uint8_t buf[65536]; /* taken from the source, not yet written */
    size_t pos, len;
};

/* 0, or -errno. The struct must not move afterwards. name: symbolic link, may be NULL; kept by pointer. */
int line_pty_open(struct line_pty *p, struct links *links, const struct line_source *source, const char *name);
void line_pty_close(struct line_pty *p);

#endif

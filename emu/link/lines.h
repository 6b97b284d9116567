/* Bytes to lines, bounded: one splitter for slcan (CR), socketcand ('>'), and JSON lines (LF).
 *
 * A line longer than the buffer is skipped to the next terminator, counted, and reported once as overlong; a truncated
 * line is never completed by bytes of the line before it. Pure: the caller reads the descriptor. */
#ifndef PSABENCH_LINK_LINES_H
#define PSABENCH_LINK_LINES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum lines_result {
    LINES_MORE,    /* all input consumed, no complete line yet */
    LINES_LINE,    /* buf[0..len) is a line without its terminator, NUL after it; valid until the next call */
    LINES_OVERLONG /* the terminator of a line that did not fit has been reached */
};

struct lines {
    char *buf; /* owned by the caller */
    size_t cap;
    char end;
    size_t len; /* read-only outside lines.c from here */
    size_t fill;
    bool skipping;
    uint32_t overlong; /* lines skipped since init */
};

/* A line may have up to cap - 1 bytes. */
void lines_init(struct lines *l, char *buf, size_t cap, char end);

/* Consumes bytes of in[0..n) up to and including the first terminator; *used tells how many. */
enum lines_result lines_feed(struct lines *l, const char *in, size_t n, size_t *used);

/* Forgets a partial line: the peer has gone. */
void lines_reset(struct lines *l);

#endif

/* A descriptor that carries lines of text both ways: what socketcand clients, the slcan pty and control clients share.
 *
 * Input is split into lines and handed over one at a time while the owner takes them; what it does not take yet stays
 * here and then in the kernel, so that a peer that is too fast is slowed down and nothing is lost. Output waits in a
 * bounded buffer. */
#ifndef PSABENCH_LINK_TEXT_LINK_H
#define PSABENCH_LINK_TEXT_LINK_H

#include "link/http.h"
#include "link/lines.h"
#include "link/link.h"
#include "link/outbuf.h"
#include "link/pty.h"

struct text_link;

struct text_link_ops {
    /* One line, or the news that an overlong one was skipped. */
    void (*line)(struct text_link *t, enum lines_result r, const char *line, size_t len, int64_t t_ns);
    bool (*ready)(struct text_link *t); /* takes another line now; NULL: always */
    void (*was_read)(int fd);           /* after each read of the descriptor; may be NULL */
    /* The peer has gone and all its lines were taken; called once. Not of a pty: the next one may come. */
    void (*closed)(struct text_link *t, int64_t t_ns);
    /* Of a pty: the first program has opened it, the last has closed it; its last bytes may still be on their way. May be
     * NULL. */
    void (*opened)(struct text_link *t, bool open);
};

struct text_link_cfg {
    const char *who; /* for messages, as of struct link */
    int fd;          /* non-blocking; owned by the link from here on. Not of a pty */
    char end;        /* of a line */
    size_t line_max; /* longest line */
    size_t out_max;  /* bytes of output kept for a slow peer */
    size_t out_high; /* above this the link calls itself full */
};

struct text_link {
    struct link link; /* first: the loop's pointer is ours */
    const struct text_link_ops *ops;
    struct pty *pty; /* NULL: a socket */
    struct lines lines;
    struct outbuf out;
    size_t out_high;
    bool hold;             /* output is kept back */
    bool stall;            /* the same, and no client waits for it */
    bool taking;           /* lines are being handed over: an owner that flushes meanwhile is not handed the next one */
    bool eof;              /* the peer sends no more */
    bool ended;            /* closed() has been called */
    char first[HTTP_LOOK]; /* what a socket's peer began with */
    size_t first_len;
    char in[4096];
    size_t in_pos, in_len;
};

/* Allocates `size` bytes, zero, that begin with a text link, for one peer; link.release() frees them. NULL when there is no
 * memory; then the descriptor is still the caller's. */
void *text_link_new(size_t size, const struct text_link_cfg *cfg, const struct text_link_ops *ops);

/* The same link on a pseudo-terminal, in the loop from here on. One program after the other sits there: for each the link
 * starts again, and while there is none output is thrown away. 0, or -errno as pty_open(). Neither may move. */
int text_link_open_pty(struct text_link *t, struct pty *p, const struct text_link_cfg *cfg,
                       const struct text_link_ops *ops, struct links *links, const char *name);

void text_link_free(struct text_link *t); /* closes the descriptor or the pty; the link is gone */

/* The link's flush(), for owners that add to it. */
void text_link_flush(struct link *l, int64_t t_ns);

/* The whole message or nothing: false when the buffer is full. */
bool text_link_put(struct text_link *t, const char *text, size_t n);

void text_link_stall(struct text_link *t, bool on);

#endif

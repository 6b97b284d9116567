/* SCPI instruments over the command table: one session for each client of an instrument.
 *
 * A program message comes as a line; each unit is looked up among the common commands, the status commands and the rows of the
 * command table that belong to the instrument and have a SCPI header. Arguments go the way of JSON's, so the same checks
 * and handlers serve both. A session has status and error queue of its own. One thread; no operating system. */
#ifndef PSABENCH_SCPI_SCPI_H
#define PSABENCH_SCPI_SCPI_H

#include "base/sched.h"
#include "control/control.h"
#include "scpi/status.h"

#define SCPI_LINE_MAX 4096u
#define SCPI_OUT_MAX  8192u
#define SCPI_PATH_MAX 81u

/* A kind of instrument. */
struct scpi_kind {
    const char *name;                                  /* of the option, and of the rows: those whose name begins so */
    const char *model;                                 /* of *IDN? */
    const char *module;                                /* rows of the table that belong to it: "head." */
    int64_t (*rest_ns)(const struct control_bench *b); /* when what was commanded is over, *OPC, *WAI; NULL: at once */
    uint16_t (*operation)(const struct control_bench *b, int64_t t_ns); /* conditions; NULL: it has none */
    uint16_t (*questionable)(const struct control_bench *b, int64_t t_ns);
};

extern const struct scpi_kind scpi_kinds[]; /* up to one without a name */

const struct scpi_kind *scpi_kind(const char *name); /* NULL: none of that name */

/* One client. Read-only outside scpi*.c */
struct scpi {
    const struct scpi_kind *kind;
    struct control *control;
    struct sched *sched;
    /* A response, one line without its end. */
    void (*reply)(void *ctx, const char *text, size_t n);
    void (*idle)(void *ctx, int64_t t_ns); /* a message that had to wait is over: the next may come. May be NULL */
    void *ctx;
    struct scpi_status status;
    struct sched_ev rest;
    bool opc; /* *OPC was said and the operation is not over */
    enum { SCPI_GO, SCPI_WAI, SCPI_OPC_QUERY } wait;
    char line[SCPI_LINE_MAX]; /* under way */
    size_t pos, len;
    char path[SCPI_PATH_MAX]; /* where a header without a leading colon begins */
    size_t path_len;
    char out[SCPI_OUT_MAX];
    size_t out_len;
    struct scpi *next; /* of the same bench: scpi_look() */
};

/* kind, control, sched, reply, idle and ctx are filled in by the caller. */
void scpi_open(struct scpi *s);
void scpi_close(struct scpi *s);

/* Carries out a message without its LF; text NULL: it was too long. While scpi_busy() no further message may come. */
void scpi_line(struct scpi *s, const char *text, size_t len, int64_t t_ns);
bool scpi_busy(const struct scpi *s);

/* Looks at the conditions: call for every session after anything that may have changed the bench. */
void scpi_look(struct scpi *s, int64_t t_ns);

/* ---- rows, for the page of headers */

struct scpi_call;

/* A command of every instrument: common ones, STATus, SYSTem. */
struct scpi_command {
    const char *pattern; /* with ? if it asks */
    const char *what;
    void (*run)(const struct scpi_call *call);
    unsigned max;       /* of its one parameter, an integer from 0; 0: it takes none */
    unsigned zeros;     /* bits of it that stay 0 */
    size_t offset;      /* of the register it is about, in struct scpi_status */
    const char *answer; /* always the same */
};

const struct scpi_command *scpi_common(unsigned i); /* NULL past the last */

/* Whether a row is one of the instrument's. */
bool scpi_belongs(const struct scpi_kind *kind, const struct control_command *row);

/* Whether the bench has the instrument: its rows say what they need. */
bool scpi_present(const struct scpi_kind *kind, const struct control_bench *b);

/* How many arguments of the row are suffixes of the header. */
unsigned scpi_suffixes(const char *pattern);

#endif

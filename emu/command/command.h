/* A row of the command table: its arguments with unit and range, its handler. Included by control/control.h. */
#ifndef PSABENCH_COMMAND_COMMAND_H
#define PSABENCH_COMMAND_COMMAND_H

#include "command/view.h"

#include <cjson/cJSON.h>

#define CONTROL_ARGS_MAX  48u /* fault.add: the values of every kind of fault */
#define CONTROL_REALS_MAX 32u
#define CONTROL_SCPI_MAX  6u

enum control_type {
    CONTROL_REAL,
    CONTROL_COUNT,
    CONTROL_BOOL,
    CONTROL_NAME, /* 1 to 31 printable characters without spaces: of a fault point */
    CONTROL_TEXT, /* up to 1023 bytes: a path */
    CONTROL_CHOICE,
    CONTROL_EVENT, /* of a board: which it has, tells control_event_find() */
    CONTROL_UNIT,  /* name of a unit of the bench */
    CONTROL_REALS  /* 1 to CONTROL_REALS_MAX numbers */
};

struct control_value {
    bool given;
    double real;
    uint64_t count;
    bool on;
    const char *text; /* NAME, TEXT, CHOICE, EVENT: the word itself */
    unsigned choice;  /* index into choices */
    unsigned unit;    /* index into the bench's units */
    double reals[CONTROL_REALS_MAX];
    unsigned n; /* of reals */
};

struct control_arg {
    const char *name; /* ends in its unit, angle_deg */
    enum control_type type;
    bool optional;
    const char *unit; /* of numbers: "deg", "deg/s", "s", "degC", "K/min", "V", "Hz", ...; NULL: none */
    double min, max;  /* of numbers, both included */
    const char *what;
    const char *const *choices; /* CHOICE: up to NULL */
    double def;                 /* what SCPI's DEFault represents */
    double least;               /* magnitude of numbers other than 0 that changes anything; 0: any does */
    /* What narrows min and max to what this bench's instrument can: doubles in struct lab, 0: none; or a function, v are the
     * arguments before this one. Not asked while the row's instrument is missing. */
    size_t lab_min, lab_max;
    void (*limits)(const struct control_bench *b, const struct control_value *v, double *min, double *max);
};

/* A way to say the row in SCPI: capitals are the short form, # a numeric suffix, [] may be left out, ? asks. Suffixes are the
 * first arguments of the row, parameters the further ones. `result` names the fields of the result that a query prints. */
struct control_scpi {
    const char *header, *result;
};

/* The arguments of a row. */
#define CONTROL_ARGS(...)                                                                                              \
    (const struct control_arg[])                                                                                       \
    {                                                                                                                  \
        __VA_ARGS__,                                                                                                   \
        {                                                                                                              \
            .name = NULL                                                                                               \
        }                                                                                                              \
    }

enum control_outcome { CONTROL_DONE, CONTROL_LATER, CONTROL_REJECTED };

struct control;
struct control_error;

/* One execution of a row. */
struct control_call {
    struct control *control;
    const struct control_bench *bench;
    const struct control_value *v; /* the arguments in the order of the row */
    cJSON *result;                 /* the handler adds to it */
    int64_t t_ns;
};

struct control_command {
    const char *name;
    const char *what;              /* one sentence */
    const struct control_arg *arg; /* up to the one without a name: CONTROL_ARGS(); NULL: none */
    enum control_outcome (*run)(const struct control_call *call); /* CONTROL_REJECTED after control_reject() */
    bool changes;                                                 /* the bench's future: goes into the journal */
    struct control_scpi scpi[CONTROL_SCPI_MAX];
    /* What the arguments do not say one by one; does nothing. False with the error. NULL: nothing more. */
    bool (*check)(const struct control_bench *b, const struct control_value *v, struct control_error *why);
    /* Before run: why the bench cannot do it now, say without the instrument; NULL: it can. NULL: nothing is needed. */
    const char *(*missing)(const struct control_bench *b);
};

struct control_table {
    const struct control_command *row;
    unsigned count;
};

extern const struct control_table *const control_tables[];       /* of the control socket, up to NULL */
extern const struct control_table *const control_truth_tables[]; /* of the truth port */

struct control_error {
    const char *code; /* syntax, command, argument, type, range, state, machine */
    char why[CONTROL_WHY_MAX];
};

#endif

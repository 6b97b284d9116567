/* The SCPI instruments of a running emulator: an address for each, a session for each client. */
#ifndef PSABENCH_APP_INSTRUMENTS_H
#define PSABENCH_APP_INSTRUMENTS_H

#include "app/options.h"
#include "link/scpi_port.h"
#include "scpi/scpi.h"

#include <stdio.h>

#define INSTRUMENTS_MAX 16u

struct instrument {
    struct scpi_port port; /* first */
    struct instruments *all;
    const struct scpi_kind *kind;
    char link[128]; /* symbolic link of a pty of --scpi all */
};

struct instruments {
    struct links *links;
    struct control *control;
    struct sched *sched;
    struct instrument *port[INSTRUMENTS_MAX];
    unsigned count;
    bool refused; /* a pseudo-terminal could not be opened, and another name would do */
    struct scpi *sessions;
};

/* Whether the bench has the instruments that the options name; nothing is opened. False with one line in why. */
bool instruments_check(const struct instruments *all, const struct options *o, char *why, size_t cap);

/* Opens what the options ask for, checked; links, control and sched are filled in before. False with one line in why; what was opened
 * is closed by instruments_close() in either case. */
bool instruments_open(struct instruments *all, const struct options *o, char *why, size_t cap);

/* After anything that may have changed the bench: conditions of all sessions. */
void instruments_look(struct instruments *all, int64_t t_ns);

/* In two steps: first the ports, then, when the loop's links have been reaped, their storage. */
void instruments_close(struct instruments *all);
void instruments_free(struct instruments *all);

#endif

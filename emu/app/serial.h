/* Serial ports of units on pseudo-terminals: the bytes of a receiver, each when its stop bit has ended in simulated time.
 *
 * Bytes that leave while no program has the port open are gone, as on a wire. In wall pace a reader that is too slow loses
 * bytes; otherwise time waits for it. What a reader writes is discarded: the units take no commands there. */
#ifndef PSABENCH_APP_SERIAL_H
#define PSABENCH_APP_SERIAL_H

#include "app/options.h"
#include "bench/bench.h"
#include "link/line/line_pty.h"

#define SERIAL_RING 16384u

struct serial_port {
    struct line_pty pty;
    struct unit *unit;
    uint8_t ring[SERIAL_RING]; /* not yet taken by the pseudo-terminal */
    size_t first, count;
    bool open;
    char notice[200];
};

struct serial_ports {
    struct serial_port *port[OPTIONS_SERIAL_MAX];
    unsigned count;
};

/* Whether the options name units with a serial port, each once; nothing is opened. False with one line in why. */
bool serial_check(const struct bench *b, const struct options *o, char *why, size_t cap);

bool serial_open(struct serial_ports *all, struct links *links, struct bench *b, const struct options *o, char *why,
                 size_t cap);
void serial_close(struct serial_ports *all); /* before links_reap() */
void serial_free(struct serial_ports *all);  /* after it */

#endif

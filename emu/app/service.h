/* The emulator as a whole: bench, endpoints, pace, and the answers to the control socket. */
#ifndef PSABENCH_APP_SERVICE_H
#define PSABENCH_APP_SERVICE_H

#include "app/bench.h"
#include "app/loop.h"
#include "app/ports.h"
#include "control/control.h"
#include "control/fault.h"

struct service {
    const struct options *o;
    struct bench *bench;
    struct ports ports;
    struct pace pace;
    struct loop loop;
    struct control_bench view; /* what the commands may reach */
    struct fault_engine faults;
    struct control control, truth;
    struct ctl_client *runner; /* who waits for the answer to `run` */
    bool vcd_failed;           /* the recording is not complete, and it was told */
};

/* Opens everything. False with one line in why. The struct must not move; service_close() in either case. */
bool service_open(struct service *s, struct bench *b, const struct options *o, char *why, size_t cap);

/* Runs until the end or a signal; returns the signal's number or 0. */
int service_run(struct service *s);

/* Ends recordings, tells the counters on stderr, removes links and sockets. */
void service_close(struct service *s);

#endif

/* The emulator as a whole: bench, endpoints, pace, and the answers to the control socket. */
#ifndef PSABENCH_APP_SERVICE_H
#define PSABENCH_APP_SERVICE_H

#include "app/loop.h"
#include "app/ports.h"
#include "bench/bench.h"
#include "bench/snapshot.h"
#include "bench/timeline.h"
#include "bench/truth_log.h"
#include "control/control.h"
#include "fault/fault.h"
#include "trace/capture.h"

/* Exit statuses of the process. */
enum { SERVICE_DONE = 0, SERVICE_INPUT = 2, SERVICE_MACHINE = 3, SERVICE_INT = 130 };

/* The ring capture of a running emulator: probe.arm and its files. */

#define CAPTURE_FILES_SHOWN 16u
#define CAPTURE_PATH_MAX    4096 /* Linux takes no longer path */

struct capture_file {
    char path[CAPTURE_PATH_MAX];
    uint64_t number; /* from 1; 0: none */
    int64_t trigger_ns, from_ns, end_ns;
    uint64_t bytes, lost;
    char why[96]; /* why it has ended early; "": it has not */
};

struct capture_job {
    struct capture core;
    char path[CAPTURE_PATH_MAX]; /* as given */
    unsigned unit;
    uint32_t files, done;
    uint64_t max_bytes;
    uint64_t number;                               /* files begun since the start */
    FILE *out;                                     /* being written */
    struct capture_file file[CAPTURE_FILES_SHOWN]; /* number n is at n % CAPTURE_FILES_SHOWN */
};

struct lcm_feed;

struct service {
    const struct options *o;
    struct bench *bench;
    struct ports ports;
    struct pace pace;
    struct loop loop;
    struct control_bench view; /* what the commands may reach */
    struct fault_engine faults;
    struct ctl_client *runner;     /* who waits for the answer to `run` */
    char vcd_path[4096];           /* of the recording, --vcd or vcd.start; Linux takes no longer path */
    char vcd_why[CONTROL_WHY_MAX]; /* why it has ended early; "": it has not */
    bool incomplete;               /* a file is not complete, and this was reported */
    int64_t look_ns;               /* wall time of the next look whether the files are there */
    struct journal journal;
    const char *scenario; /* resolved, one line of JSON */
    bool powered;         /* the bench comes from a snapshot */
    bool refused;         /* bad input: a snapshot that cannot be done again, a bus or instrument that is not there */
    uint32_t connections; /* connections of CAN clients before time began: of the snapshot */
    struct truth_log truth_log;
    struct capture_job capture;
    struct lcm_feed *lcm; /* --lcm; NULL: none */
    bool lcm_reported;    /* that its file failed, or that messages were lost */
    int64_t lcm_look_ns;  /* wall time of the next look whether its file is there */
    struct snapshot_observers observers;
    struct link input; /* --until-eof */
    /* last: who begins with them clears what has to be clear, and not the megabytes of room for a reply */
    struct timeline timeline;
    struct control control, truth;
};

/* Where the bench comes from. */
struct service_origin {
    const char *scenario;            /* resolved, one line of JSON; kept by pointer */
    const struct snapshot *snapshot; /* NULL: from power-on */
};

/* Opens everything. False with one line in why. The struct must not move; service_close() in either case. */
bool service_open(struct service *s, struct bench *b, const struct options *o, const struct service_origin *from,
                  char *why, size_t cap);

/* Runs until the end or a signal; returns the signal's number or 0. */
int service_run(struct service *s);

/* Ends recordings, tells the counters on stderr, removes links and sockets. */
void service_close(struct service *s);

/* The rest of the life of a child: until its end or a signal, then closed; the exit status of the process. */
int service_live(struct service *s);

/* ---- for the files of the service */

void service_power_up(struct service *s); /* bench, faults and timeline of the scenario */

/* clients.c */
extern const struct control_clients service_clients;
bool service_taken(void *ctx, uint64_t count);            /* for loop.taken */
void service_sweep_detached(struct service *s, bool all); /* see can_hub.h */
void service_print_clients(struct service *s);

/* recording.c */
extern const struct control_recording service_recording;
void service_check_files(struct service *s); /* what has failed is said, and ends whole */
void service_end_files(struct service *s);   /* all goes into the files, and is looked at */
void service_describe_files(void *ctx, cJSON *result);
bool service_open_truth_log(struct service *s, char *why, size_t cap);

/* capture.c */
extern const struct control_captures service_captures;
void service_follow_capture(struct service *s);  /* after time has moved: triggers open files, edges go into them */
void service_end_capture(struct service *s);     /* a file under way ends */
void service_abandon_capture(struct service *s); /* without a file */
bool service_is_sliced(void *ctx);               /* for loop.sliced */

/* service_lcm.c, or service_no_lcm.c where the emulator is built without LCM */
bool service_open_lcm(struct service *s, char *why, size_t cap);
void service_end_lcm(struct service *s); /* all goes into the file, which is looked at */
void service_describe_lcm(const struct service *s, cJSON *files);
void service_print_lcm(const struct service *s);
void service_close_lcm(struct service *s);

/* report.c: one line on stderr, of a file that ends early too; an entry of counters */
void service_say(const char *text);
void service_report_file(const char *what, const char *path, const char *reason, const char *stored);
cJSON *service_add_file(cJSON *files, const char *kind, const char *path, double bytes, const char *error);

/* service_save.c */
bool service_snapshot(void *ctx, const char *path, cJSON *result, char *why);
void service_journal(void *ctx, const struct control_command *row, const cJSON *args, bool done, int64_t t_ns);
void service_follow(struct service *s);        /* the journal begins */
void service_check_journal(struct service *s); /* says before it is full, and when */
bool service_restore(struct service *s, const struct snapshot *from, char *why, size_t cap);

/* In the child of a fork, whose descriptors lead nowhere: everything of the parent's is closed but the bench. */
void service_abandon(struct service *s);
bool service_reopen(struct service *s, const struct options *o, char *why, size_t cap);

/* fork.c: fork(2) of a running emulator. The child has the whole bench in memory and continues from the same instant. It
 * gives up all that the parent has open: programs on the parent's buses stay the parent's; in the child, detached clients
 * send what they had queued. It opens the endpoints it was given, and ends with its own `quit` or SIGTERM, whatever becomes
 * of the parent. Its files are not the parent's: a recording continues in the parent alone.
 * In the parent: adds pid and endpoints to result and returns true, or false with a sentence in why[CONTROL_WHY_MAX]. The
 * child does not return. */
bool service_fork(void *ctx, const struct control_fork *f, cJSON *result, char *why);

#endif

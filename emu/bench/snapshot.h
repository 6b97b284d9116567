/* A bench in a file: the scenario and the journal, which make it again, and a digest to know that they did.
 *
 *     {"psabench":"snapshot","format":1,"version":"0.1.0"}
 *     {"seed":1,...}                          the resolved scenario
 *     {"t":0,"bus":0,"came":1,...}            the journal (bench/journal.h), as many lines as there are entries
 *     {"end":1500000,"ran":true,"entries":1,"state":"..."}
 *     {"sha256":"..."}                        of all bytes before this line
 *
 * To restore is to do it again, at the pace of the machine; nothing of the present state is stored, so a file is small and
 * can be read, and what it makes is the same bench to the last bit or is rejected. One thread. */
#ifndef PSABENCH_BENCH_SNAPSHOT_H
#define PSABENCH_BENCH_SNAPSHOT_H

#include "bench/digest.h"

#define SNAPSHOT_FORMAT       1
#define SNAPSHOT_SCENARIO_MAX (8u << 20)
#define SNAPSHOT_MAX          (JOURNAL_MAX + SNAPSHOT_SCENARIO_MAX + 4096u) /* bytes of a file */

struct snapshot {
    char *text;           /* the file; from the heap */
    const char *scenario; /* one line of JSON, inside text, ends with a NUL */
    size_t scenario_len;
    const char *journal; /* lines with their LF, inside text */
    size_t journal_len;
    uint64_t entries;
    int64_t end_ns;
    bool ran; /* what was due at end_ns had run since the last entry */
    char state[SHA256_HEX];
};

/* Writes the bench as it is now; `scenario` is the resolved one as JSON. The file appears whole or not at all. False with
 * one line in why. */
bool snapshot_write(const char *path, struct journal *j, const char *scenario, char *why, size_t cap);

/* Reads and checks a file, or the same in memory (which it takes over): version, sums, every line. False with one line in
 * why. */
bool snapshot_load(const char *path, struct snapshot *s, char *why, size_t cap);
bool snapshot_parse(char *text, size_t len, struct snapshot *s, char *why, size_t cap);
void snapshot_free(struct snapshot *s);

/* Observers of the units' lines in place of the detached clients: edges under way to them are kept for the next client. */
struct snapshot_observers {
    struct trace_sink observer[CONTROL_UNITS_MAX];
    bool on;
};

void snapshot_observe_lines(struct snapshot_observers *e, struct bench *b); /* to the lines that clients observe now */
void snapshot_release_lines(struct snapshot_observers *e, struct bench *b); /* once time has moved */

/* What a journal is done again with: a bench of the same scenario that has just been powered up. */
struct snapshot_world {
    struct bench *bench;
    struct journal *journal; /* follows the hubs: it will hold what was done again */
    struct can_hub *hub[CONTROL_BUSES_MAX];
    unsigned buses;
    struct control *control;              /* of the commands */
    struct snapshot_observers *observers; /* on afterwards */
};

/* Does it again up to the instant of the snapshot and compares the state. The programs that were on the bus are detached clients
 * afterwards, whose places are free until time moves. False with one line in why. */
bool snapshot_replay(const struct snapshot *s, const struct snapshot_world *w, char *why, size_t cap);

#endif

/* An event log of LCM, as lcm-logger writes it: lcm-logplayer, lcm-spy and the libraries of LCM read it. Written here because
 * liblcm neither locks the file nor ends it with a whole event on a full disk.
 * https://lcm-proj.github.io/lcm/content/log-file-format.html
 *
 * The same messages give the same bytes. */
#ifndef PSABENCH_LINK_LCM_LCM_LOG_H
#define PSABENCH_LINK_LCM_LCM_LOG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LCM_LOG_BUFFER  65536u
#define LCM_CHANNEL_MAX 63u   /* characters of a channel's name: LCM_MAX_CHANNEL_NAME_LENGTH */
#define LCM_MESSAGE_MAX 1024u /* bytes of a message of ours */
enum { LCM_LOG_HEADER = 28 };

struct lcm_log {
    const char *path;
    int fd;
    int error;       /* errno of the first write that failed; what follows is not written */
    uint64_t events; /* put */
    uint64_t stored; /* of them, in the file */
    int64_t size;    /* of the file so far: whole events */
    size_t len;
    uint8_t buffer[LCM_LOG_BUFFER];
};

/* An earlier file of that name is replaced. 0, or -errno: -EBUSY the process *owner writes it. The path stays the caller's. */
int lcm_log_open(struct lcm_log *l, const char *path, long *owner);

/* t_us: since the UNIX epoch. len: up to LCM_MESSAGE_MAX. */
void lcm_log_put(struct lcm_log *l, const char *channel, const void *data, size_t len, int64_t t_us);

/* ESTALE is its error when the file has been removed or replaced. */
void lcm_log_look(struct lcm_log *l);

/* What waits goes into the file, which ends with a whole event in any case. 0, or -errno of whatever failed since it was
 * opened. */
int lcm_log_flush(struct lcm_log *l);

void lcm_log_close(struct lcm_log *l);

#endif

#define _POSIX_C_SOURCE 200809L /* ftruncate */
#include "link/lcm/lcm_log.h"

#include "link/own_file.h"

#include <assert.h>
#include <errno.h>
#include <string.h>
#include <unistd.h>

#define SYNC UINT32_C(0xEDA1DA01)

static void put_u32(uint8_t *at, uint32_t v)
{
    for (unsigned i = 0; i < 4; i++) at[i] = (uint8_t)(v >> (24 - 8 * i));
}

static void put_u64(uint8_t *at, uint64_t v)
{
    put_u32(at, (uint32_t)(v >> 32));
    put_u32(at + 4, (uint32_t)v);
}

static size_t get_u32(const uint8_t *at)
{
    return (size_t)at[0] << 24 | (size_t)at[1] << 16 | (size_t)at[2] << 8 | at[3];
}

/* The events that were written before the error are stored; the file is cut behind the last of them. */
static void end_whole(struct lcm_log *l, size_t written)
{
    size_t at = 0;
    for (size_t next; at + LCM_LOG_HEADER <= written; at = next) {
        next = at + LCM_LOG_HEADER + get_u32(l->buffer + at + 20) + get_u32(l->buffer + at + 24);
        if (next > written) break;
        l->stored++;
    }
    l->size += (int64_t)at;
    (void)!ftruncate(l->fd, l->size);
}

int lcm_log_flush(struct lcm_log *l)
{
    if (l->error) return -l->error;
    for (size_t at = 0; at < l->len && !l->error;) {
        const ssize_t n = write(l->fd, l->buffer + at, l->len - at);
        if (n > 0) at += (size_t)n;
        else if (n < 0 && errno != EINTR) l->error = errno;
        if (l->error) end_whole(l, at);
    }
    if (!l->error) {
        l->stored = l->events;
        l->size += (int64_t)l->len;
    }
    l->len = 0;
    return -l->error;
}

void lcm_log_look(struct lcm_log *l)
{
    if (l->error || !own_file_gone(l->fd, l->path)) return;
    (void)lcm_log_flush(l);
    l->error = ESTALE;
    if (own_file_removed(l->fd)) l->stored = 0;
}

void lcm_log_put(struct lcm_log *l, const char *channel, const void *data, size_t len, int64_t t_us)
{
    const size_t name = strlen(channel);
    assert(name > 0 && name <= LCM_CHANNEL_MAX && len <= LCM_MESSAGE_MAX);
    if (l->error) return;
    if (l->len + LCM_LOG_HEADER + name + len > sizeof l->buffer) lcm_log_flush(l);
    uint8_t *at = l->buffer + l->len;
    put_u32(at, SYNC);
    put_u64(at + 4, l->events);
    put_u64(at + 12, (uint64_t)t_us);
    put_u32(at + 20, (uint32_t)name);
    put_u32(at + 24, (uint32_t)len);
    memcpy(at + LCM_LOG_HEADER, channel, name);
    memcpy(at + LCM_LOG_HEADER + name, data, len);
    l->len += LCM_LOG_HEADER + name + len;
    l->events++;
}

int lcm_log_open(struct lcm_log *l, const char *path, long *owner)
{
    memset(l, 0, offsetof(struct lcm_log, buffer));
    l->path = path;
    l->fd = own_file_open(path, owner);
    return l->fd < 0 ? l->fd : 0;
}

void lcm_log_close(struct lcm_log *l)
{
    if (l->fd < 0) return;
    lcm_log_flush(l);
    close(l->fd);
    l->fd = -1;
}

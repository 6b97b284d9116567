#define _GNU_SOURCE /* SOCK_CLOEXEC */
#include "link/lcm/lcm_udpm.h"

#include "base/why.h"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const char library[] = "liblcm.so.1";

/* As lcm/lcm.h declares them; lcm_t is opaque. */
typedef void *create_fn(const char *url);
typedef void destroy_fn(void *lcm);

/* A function from a data pointer, as POSIX has dlsym(). */
static bool load_symbol(void *from, const char *name, void *function)
{
    void *found = dlsym(from, name);
    memcpy(function, &found, sizeof found);
    return found != NULL;
}

/* liblcm explains a missing route in six lines on stderr: look first. 0, or errno. */
static int try_route(const struct lcm_url *url)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(url->port)};
    memcpy(&to.sin_addr, url->group, sizeof url->group);
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const bool there = fd >= 0 && connect(fd, (const struct sockaddr *)&to, sizeof to) == 0;
    const int err = there ? 0 : errno;
    if (fd >= 0) close(fd);
    return err;
}

static bool check_route(const struct lcm_url *url, const char *where, char *why, size_t cap)
{
    const int err = try_route(url);
    if (!err) return true;
    return why_expected(why, cap, where, why_found(err), "%s",
                        "a route for multicast (as root: ip route add 224.0.0.0/4 dev lo)");
}

static bool create_lcm(struct lcm_udpm *u, const struct lcm_url *url, const char *where, char *why, size_t cap)
{
    char text[64];
    create_fn *create;
    const uint8_t *g = url->group;
    snprintf(text, sizeof text, "udpm://%u.%u.%u.%u:%u?ttl=0", g[0], g[1], g[2], g[3], url->port);
    if (!load_symbol(u->library, "lcm_create", &create) || !load_symbol(u->library, "lcm_publish", &u->publish))
        return why_expected(why, cap, where, "another library", "%s with lcm_create() and lcm_publish()", library);
    u->lcm = create(text);
    return u->lcm || why_expected(why, cap, where, "an error", "%s to open %s", library, text);
}

bool lcm_udpm_open(struct lcm_udpm *u, const struct lcm_url *url, const char *where, char *why, size_t cap)
{
    *u = (struct lcm_udpm){.library = dlopen(library, RTLD_NOW | RTLD_LOCAL)};
    if (!u->library) return why_fail(why, cap, "%s: expected %s (Debian: liblcm1), got: %s", where, library, dlerror());
    if (check_route(url, where, why, cap) && create_lcm(u, url, where, why, cap)) return true;
    lcm_udpm_close(u);
    return false;
}

void lcm_udpm_send(struct lcm_udpm *u, const char *channel, const void *data, size_t len)
{
    if (u->publish(u->lcm, channel, data, (unsigned)len) == 0) u->sent++;
    else u->lost++;
}

void lcm_udpm_close(struct lcm_udpm *u)
{
    destroy_fn *destroy;
    if (!u->library) return;
    if (u->lcm && load_symbol(u->library, "lcm_destroy", &destroy)) destroy(u->lcm);
    *u = (struct lcm_udpm){.sent = u->sent,
                           .lost = u->lost}; /* it stays loaded: GLib, which it brings, cannot be unloaded */
}

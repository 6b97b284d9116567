/* The least of a CAN link: frames over socketcand's TCP protocol (docs/links.md). Needs POSIX. */
#define _POSIX_C_SOURCE 200809L
#include <netdb.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define U16(d) ((unsigned)(d)[0] | (unsigned)(d)[1] << 8)
#define S24(d) ((int32_t)(U16(d) << 8 | (uint32_t)(d)[2] << 24) / 256)

typedef void can_receive(int id, const uint8_t *data, int bytes);

static int64_t now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000LL + t.tv_nsec / 1000000;
}

static void can_say(int link, const char *text)
{
    if (write(link, text, strlen(text)) < 0) perror("socketcand");
}

static void can_send(int link, int id, const uint8_t *data, int bytes)
{
    char text[64];
    int n = snprintf(text, sizeof text, "< send %03X %d", (unsigned)id, bytes);
    for (int i = 0; i < bytes; i++) n += snprintf(text + n, sizeof text - (size_t)n, " %02X", data[i]);
    snprintf(text + n, sizeof text - (size_t)n, " >");
    can_say(link, text);
}

/* Waits for a word of the server; 0 when it does not come. */
static int can_hear(int link, const char *word)
{
    char text[32] = "";
    for (size_t n = 0; n < sizeof text - 1 && read(link, text + n, 1) == 1; n++) {
        if (text[n] == '>') return strstr(text, word) != NULL;
    }
    return 0;
}

/* ADDRESS:PORT to a link, -1 with a message when no one is there. */
static int can_open(char *place)
{
    char *port = strrchr(place, ':');
    struct addrinfo *to = NULL, hint = {.ai_socktype = SOCK_STREAM};
    if (port) *port++ = 0;
    int found = port && !getaddrinfo(place, port, &hint, &to);
    int link = found ? socket(to->ai_family, SOCK_STREAM, 0) : -1;
    int open = link >= 0 && !connect(link, to->ai_addr, to->ai_addrlen) && can_hear(link, "hi");
    if (open) can_say(link, "< open can0 >");
    open = open && can_hear(link, "ok");
    if (open) can_say(link, "< rawmode >");
    open = open && can_hear(link, "ok");
    if (!open) perror(place);
    if (to) freeaddrinfo(to);
    return open ? link : -1;
}

static void can_message(const char *m, can_receive *receive)
{
    uint8_t data[64] = {0};
    unsigned id;
    int n = 0, at = 0;
    if (sscanf(m, "< frame %x %*f %n", &id, &at) != 1 || !at) return;
    for (m += at; n < 64 && sscanf(m, " %2hhx%n", &data[n], &at) == 1; n++) m += at;
    receive((int)id, data, n);
}

/* Waits that long for frames and hands them over; 0 when the link has ended. */
static int can_wait(int link, int wait_ms, can_receive *receive)
{
    static char text[65536];
    static size_t held;
    char *end, *m = text;
    if (poll(&(struct pollfd){.fd = link, .events = POLLIN}, 1, wait_ms) <= 0) return 1;
    ssize_t got = read(link, text + held, sizeof text - 1 - held);
    if (got <= 0) return 0;
    text[held += (size_t)got] = 0;
    for (; (end = strchr(m, '>')); m = end + 1) *end = 0, can_message(m, receive);
    memmove(text, m, held -= (size_t)(m - text));
    return 1;
}

#include "link/mavlink/mav_options.h"

#include "link/mavlink/mav_wire.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { TCP_PORT = 5760, WORD_MAX = 255 };

/* A part of the argument as a string of its own; false: too long. */
static bool copy_part(char *out, size_t cap, const char *from, size_t n)
{
    if (n >= cap) return false;
    memcpy(out, from, n);
    out[n] = '\0';
    return true;
}

static bool parse_count(const char *text, unsigned min, unsigned max, unsigned *v)
{
    char *end;
    errno = 0;
    const unsigned long x = strtoul(text, &end, 10);
    if (text[0] < '0' || text[0] > '9' || *end || errno || x < min || x > max) return false;
    *v = (unsigned)x;
    return true;
}

static bool set_unit(struct mav_options *o, const char *text)
{
    return *text && copy_part(o->unit, sizeof o->unit, text, strlen(text));
}

static bool set_id(uint8_t *id, const char *text)
{
    unsigned v;
    if (!parse_count(text, 1, 255, &v)) return false;
    *id = (uint8_t)v;
    return true;
}

static bool set_sysid(struct mav_options *o, const char *text)
{
    return set_id(&o->sysid, text);
}

static bool set_compid(struct mav_options *o, const char *text)
{
    return set_id(&o->compid, text);
}

static bool set_autopilot(struct mav_options *o, const char *text)
{
    static const struct {
        const char *word;
        uint8_t number; /* of MAV_AUTOPILOT */
    } rows[] = {{"generic", MAV_AUTOPILOT_GENERIC},
                {"px4", MAV_AUTOPILOT_PX4},
                {"ardupilot", MAV_AUTOPILOT_ARDUPILOTMEGA},
                {"invalid", MAV_AUTOPILOT_INVALID}};
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        o->autopilot = rows[i].number;
        if (strcmp(text, rows[i].word) == 0) return true;
    }
    return false;
}

static bool set_hz(double *hz, const char *text)
{
    char *end;
    *hz = strtod(text, &end);
    return text[0] >= '0' && text[0] <= '9' && !*end && *hz <= 10000 && (*hz == 0 || *hz >= 0.01);
}

static bool set_imu(struct mav_options *o, const char *text)
{
    return set_hz(&o->imu_hz, text);
}

static bool set_angles(struct mav_options *o, const char *text)
{
    return set_hz(&o->angles_hz, text);
}

static bool set_hil(struct mav_options *o, const char *text)
{
    return set_hz(&o->hil_hz, text);
}

static const struct {
    const char *key;
    bool (*set)(struct mav_options *o, const char *text);
    const char *form;
} keys[] = {
    {"unit", set_unit, "unit=NAME"},
    {"sysid", set_sysid, "sysid=N, from 1 to 255"},
    {"compid", set_compid, "compid=N, from 1 to 255"},
    {"autopilot", set_autopilot, "autopilot=generic, px4, ardupilot or invalid"},
    {"imu", set_imu, "imu=HZ, 0 (off) or from 0.01 to 10000"},
    {"angles", set_angles, "angles=HZ, 0 (off) or from 0.01 to 10000"},
    {"hil", set_hil, "hil=HZ, 0 (off) or from 0.01 to 10000"},
};

static bool set_key(struct mav_options *o, const char *part, size_t n, const char **form)
{
    char word[WORD_MAX + 1];
    *form = "KEY=VALUE after a comma; KEY: unit, sysid, compid, autopilot, imu, angles or hil";
    if (!copy_part(word, sizeof word, part, n)) return false;
    char *equals = strchr(word, '=');
    if (!equals) return false;
    *equals = '\0';
    for (unsigned i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (strcmp(keys[i].key, word) != 0) continue;
        *form = keys[i].form;
        return keys[i].set(o, equals + 1);
    }
    return false;
}

static bool set_kind(struct mav_options *o, const char *part, size_t n, const char **form)
{
    static const struct {
        const char *word;
        enum mav_port_kind kind;
        uint16_t port;
    } kinds[] = {{"udp", MAV_UDP_OUT, MAV_OPTIONS_PORT},
                 {"udpin", MAV_UDP_IN, MAV_OPTIONS_PORT},
                 {"tcp", MAV_TCP, TCP_PORT},
                 {"pty", MAV_PTY, 0}};
    char word[WORD_MAX + 1];
    unsigned i = 0, port;
    *form = "udp[:PORT], udpin[:PORT], tcp[:PORT] or pty[:LINK], then ,KEY=VALUE...";
    if (!copy_part(word, sizeof word, part, n)) return false;
    char *colon = strchr(word, ':');
    if (colon) *colon = '\0';
    while (i < sizeof kinds / sizeof *kinds && strcmp(kinds[i].word, word) != 0) i++;
    if (i == sizeof kinds / sizeof *kinds) return false;
    o->kind = kinds[i].kind;
    o->port = kinds[i].port;
    if (!colon) return true;
    if (o->kind == MAV_PTY) return colon[1] && copy_part(o->link, sizeof o->link, colon + 1, strlen(colon + 1));
    *form = o->kind == MAV_UDP_OUT ? "a port from 1 to 65535" : "a port from 0 (any free port) to 65535";
    if (!parse_count(colon + 1, o->kind == MAV_UDP_OUT, 65535, &port)) return false;
    o->port = (uint16_t)port;
    return true;
}

bool mav_options_parse(const char *arg, struct mav_options *o, const char **form)
{
    *o = (struct mav_options){
        .arg = arg, .sysid = 1, .compid = 1, .autopilot = MAV_AUTOPILOT_GENERIC, .imu_hz = 50, .angles_hz = 10};
    size_t n = strcspn(arg, ",");
    if (!set_kind(o, arg, n, form)) return false;
    for (const char *at = arg + n; *at; at += n) {
        n = strcspn(++at, ",");
        if (!set_key(o, at, n, form)) return false;
    }
    return true;
}

#define _GNU_SOURCE /* getopt_long */
#include "app/options.h"

#include "base/why.h"
#include "command/utf8.h"
#include "link/can/socketcand_tcp.h"
#include "link/can/udp_can.h"
#include "link/lcm/lcm_url.h"
#include "link/logic/beagle_tcp.h"

#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool parse_u64(const char *text, uint64_t max, uint64_t *v)
{
    char *end;
    errno = 0;
    const unsigned long long x = strtoull(text, &end, 10);
    if (text[0] < '0' || text[0] > '9' || *end || errno || x > max) return false;
    *v = x;
    return true;
}

bool options_duration(const char *text, int64_t *ns)
{
    static const struct {
        const char *suffix;
        double s;
    } units[] = {{"", 1}, {"s", 1}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}, {"min", 60}, {"h", 3600}};
    char *end;
    const double v = strtod(text, &end);
    if (end == text || !isfinite(v)) return false;
    for (unsigned i = 0; i < sizeof units / sizeof *units; i++) {
        if (strcmp(end, units[i].suffix) != 0) continue;
        const double s = v * units[i].s;
        if (!(s >= 0 && s <= 1e6)) return false;
        *ns = (int64_t)nearbyint(s * 1e9);
        return true;
    }
    return false;
}

/* ---- one function for each kind of argument; o is filled in, why tells */

struct target {
    struct options *o;
    char *why;
    size_t cap;
    const struct row *row;
};

/* An option, and its entry in --help; in the order of both. */
struct row {
    const char *name; /* with its dashes */
    const char *form; /* of its argument, with what is between; NULL: it has none */
    bool (*set)(const struct target *t, const char *arg);
    size_t where; /* an offset in struct options: of set_path(), set_flag(), set_rate(); the action of set_action() */
    const char *text; /* more lines of it follow as they are; NULL: it is with another */
};

#define expected(t, got, ...) why_expected((t)->why, (t)->cap, (t)->row->name, WHY_TEXT(got), __VA_ARGS__)

/* Length of "can1=" at the beginning; 0: there is none. */
static size_t bus_prefix(const char *arg)
{
    const size_t n = strcspn(arg, "=:");
    return arg[n] == '=' && n > 0 ? n + 1 : 0;
}

static const char *check_port(struct options_can *c)
{
    uint64_t port = SOCKETCAND_PORT;
    if (c->arg && !parse_u64(c->arg, 65535, &port)) return "a port from 0 (any free port) to 65535";
    c->port = (uint16_t)port;
    return NULL;
}

static const char *check_group(struct options_can *c)
{
    struct sockaddr_storage group;
    if (!c->arg) c->arg = UDP_CAN_GROUP;
    if (udp_can_group(c->arg, &group)) return NULL;
    return "udp:GROUP, udp:GROUP:PORT or udp:[GROUP]:PORT, GROUP 239.x.y.z or ff..::..";
}

static const char *check_tunnel(struct options_can *c)
{
    if (cannelloni_can_ports(c->arg ? c->arg : "", &c->tunnel)) return NULL;
    return "cannelloni[:PORT[:PEER_PORT]], two ports from 1 to 65535, PORT 0: any free port";
}

static bool set_can(const struct target *t, const char *arg)
{
    static const struct {
        const char *word;
        bool named;                                  /* has to say which interface or file */
        const char *(*check)(struct options_can *c); /* NULL, or what is expected; may be NULL */
    } kinds[] = {[OPTIONS_SOCKETCAND] = {"socketcand", false, check_port},
                 [OPTIONS_SLCAN] = {"slcan", false, NULL},
                 [OPTIONS_SOCKETCAN] = {"socketcan", true, NULL},
                 [OPTIONS_UDP] = {"udp", false, check_group},
                 [OPTIONS_CANNELLONI] = {"cannelloni", false, check_tunnel},
                 [OPTIONS_CAN_LOG] = {"log", true, NULL}};
    enum { KINDS = sizeof kinds / sizeof *kinds };
    struct options *o = t->o;
    o->can_given = true;
    if (strcmp(arg, "none") == 0) return true;
    if (o->can_count == OPTIONS_CAN_MAX) return expected(t, arg, "up to %u adapters", OPTIONS_CAN_MAX);
    struct options_can *c = &o->can[o->can_count];
    const char *kind = arg + bus_prefix(arg);
    const size_t len = strcspn(kind, ":");
    *c = (struct options_can){.arg = kind[len] && kind[len + 1] ? kind + len + 1 : NULL};
    if (kind > arg) snprintf(c->bus, sizeof c->bus, "%.*s", (int)(kind - arg) - 1, arg);
    unsigned k = 0;
    while (k < KINDS && !(strlen(kinds[k].word) == len && memcmp(kinds[k].word, kind, len) == 0)) k++;
    if (k == KINDS || (kinds[k].named && !c->arg))
        return expected(t, arg,
                        "socketcand[:PORT], slcan[:LINK], socketcan:IFACE, udp[:GROUP[:PORT]], "
                        "cannelloni[:PORT[:PEER_PORT]], log:FILE or none");
    c->kind = (enum options_can_kind)k;
    const char *what = kinds[k].check ? kinds[k].check(c) : NULL;
    if (what) return expected(t, arg, "%s", what);
    o->can_count++;
    return true;
}

/* head:5025 or head:pty:LINK. */
static bool set_scpi(const struct target *t, const char *arg)
{
    struct options *o = t->o;
    if (o->scpi_count == OPTIONS_SCPI_MAX) return expected(t, arg, "up to %u instruments", OPTIONS_SCPI_MAX);
    struct options_scpi *i = &o->scpi[o->scpi_count++];
    const size_t len = strcspn(arg, ":");
    const char *rest = arg[len] ? arg + len + 1 : "0";
    uint64_t port = 0;
    *i = (struct options_scpi){.arg = arg, .pty = strcmp(rest, "pty") == 0 || strncmp(rest, "pty:", 4) == 0};
    snprintf(i->kind, sizeof i->kind, "%.*s", (int)len, arg);
    if (len == 0 || len >= sizeof i->kind) return expected(t, arg, "head, table, chamber, supply or all");
    if (i->pty && rest[3] && rest[4]) i->link = rest + 4;
    if (!i->pty && !parse_u64(rest, 65535, &port)) {
        return expected(t, arg, "pty[:LINK] or a port from 0 (any free port) to 65535");
    }
    i->port = (uint16_t)port;
    return true;
}

/* beaglelogic:5555:Int,Data,CLK; each part but the first may be missing. */
static bool set_logic(const struct target *t, const char *arg)
{
    static const char word[] = "beaglelogic";
    struct options *o = t->o;
    if (o->logic_count == OPTIONS_LOGIC_MAX) return expected(t, arg, "up to %u logic analysers", OPTIONS_LOGIC_MAX);
    struct options_logic *l = &o->logic[o->logic_count++];
    const size_t len = strcspn(arg, ":");
    const char *const port = arg[len] ? arg + len + 1 : "";
    const size_t digits = strcspn(port, ":");
    char number[8];
    uint64_t v = BEAGLE_PORT;
    *l = (struct options_logic){.lines = port[digits] && port[digits + 1] ? port + digits + 1 : NULL};
    snprintf(number, sizeof number, "%.*s", (int)(digits < 7 ? digits : 7), port);
    if (len != sizeof word - 1 || memcmp(arg, word, len) != 0) return expected(t, arg, "beaglelogic[:PORT[:LINE,...]]");
    if (digits && !parse_u64(number, 65535, &v)) return expected(t, arg, "a port from 0 (any free port) to 65535");
    l->port = (uint16_t)v;
    return true;
}

static bool set_truth_every(const struct target *t, const char *arg)
{
    if (options_duration(arg, &t->o->truth_every_ns) && t->o->truth_every_ns >= 1000) return true;
    return expected(t, arg, "a time of 1us or more, such as 10ms");
}

static bool set_pace(const struct target *t, const char *arg)
{
    for (int k = PACE_WALL; k <= PACE_FREE; k++) {
        t->o->pace = (enum pace_kind)k;
        if (strcmp(arg, pace_name(t->o->pace)) == 0) return true;
    }
    return expected(t, arg, "wall, step or free");
}

static bool set_for(const struct target *t, const char *arg)
{
    if (options_duration(arg, &t->o->for_ns)) return true;
    return expected(t, arg, "a time such as 300ms, 10s or 2min, up to 1e6 s");
}

static bool set_seed(const struct target *t, const char *arg)
{
    t->o->seed_given = parse_u64(arg, UINT64_MAX, &t->o->seed);
    return t->o->seed_given || expected(t, arg, "an integer from 0 to 2^64 - 1");
}

static bool set_rate(const struct target *t, const char *arg)
{
    struct options_rate *r = (struct options_rate *)((char *)t->o + t->row->where);
    uint64_t v;
    r->given = parse_u64(arg, 8000000, &v) && (v == 0 || v >= 10000);
    if (!r->given) return expected(t, arg, "0 or 10000 to 8000000 bit/s");
    r->hz = (uint32_t)v;
    return true;
}

static bool set_epoch(const struct target *t, const char *arg)
{
    char *end;
    const double s = strtod(arg, &end);
    if (end == arg || *end || !(s >= 0 && s <= 9e9)) {
        return expected(t, arg, "seconds from 0 to 9e9, as date +%%s prints them");
    }
    t->o->epoch_ns = (int64_t)nearbyint(s) * 1000000000 + (int64_t)nearbyint((s - nearbyint(s)) * 1e9);
    return true;
}

static bool set_vcd_unit(const struct target *t, const char *arg)
{
    uint64_t v;
    bool power = parse_u64(arg, 100000000, &v) && v > 0;
    for (uint64_t x = power ? v : 1; x > 1; x /= 10) power = power && x % 10 == 0;
    if (!power) return expected(t, arg, "1, 10, 100 ... 100000000 ns");
    t->o->vcd_unit_ns = (uint32_t)v;
    return true;
}

static bool set_line_hz(const struct target *t, const char *arg)
{
    uint64_t v;
    if (!parse_u64(arg, 100000000, &v) || v < 1000) {
        return expected(t, arg, "1000 to 100000000 samples per second");
    }
    t->o->line_hz = (int64_t)v;
    return true;
}

/* a:LINK or LINK: names of units are plain. */
static bool parse_unit_port(const struct target *t, const char *arg, struct options_bus *b)
{
    static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_";
    const size_t len = strspn(arg, plain);
    const bool named = len > 0 && arg[len] == ':';
    const char *link = named ? arg + len + 1 : arg;
    *b = (struct options_bus){.arg = arg, .link = strcmp(link, "-") == 0 ? NULL : link};
    if (!*link || (named && len >= sizeof b->unit)) return expected(t, arg, "[UNIT:]LINK, where LINK is a path or -");
    if (named) snprintf(b->unit, sizeof b->unit, "%.*s", (int)len, arg);
    return true;
}

static bool set_bus_port(const struct target *t, const char *arg)
{
    struct options *o = t->o;
    if (o->bus_count == OPTIONS_BUS_MAX) return expected(t, arg, "up to %u bus ports", OPTIONS_BUS_MAX);
    return parse_unit_port(t, arg, &o->bus[o->bus_count++]);
}

static bool set_serial(const struct target *t, const char *arg)
{
    struct options *o = t->o;
    if (o->serial_count == OPTIONS_SERIAL_MAX) return expected(t, arg, "up to %u serial ports", OPTIONS_SERIAL_MAX);
    return parse_unit_port(t, arg, &o->serial[o->serial_count++]);
}

static bool set_mavlink(const struct target *t, const char *arg)
{
    struct options *o = t->o;
    const char *form;
    if (o->mavlink_count == OPTIONS_MAVLINK_MAX) return expected(t, arg, "up to %u MAVLink links", OPTIONS_MAVLINK_MAX);
    return mav_options_parse(arg, &o->mavlink[o->mavlink_count++], &form) || expected(t, arg, "%s", form);
}

static bool set_path(const struct target *t, const char *arg)
{
    if (!*arg) return expected(t, arg, "a path");
    *(const char **)((char *)t->o + t->row->where) = arg;
    return true;
}

static bool set_lcm(const struct target *t, const char *arg)
{
    struct lcm_url url;
    t->o->lcm = arg;
    return lcm_url_parse(arg, t->row->name, &url, t->why, t->cap);
}

static bool set_flag(const struct target *t, const char *arg)
{
    (void)arg;
    return *(bool *)((char *)t->o + t->row->where) = true;
}

static bool set_action(const struct target *t, const char *arg)
{
    (void)arg;
    t->o->action = (enum options_action)t->row->where;
    return true;
}

static bool set_scenario(const struct target *t, const char *arg)
{
    if (t->o->scenario) return why_fail(t->why, t->cap, "SCENARIO: expected one, got %s and %s", t->o->scenario, arg);
    return set_path(t, arg);
}

#define IN(member) offsetof(struct options, member)

// clang-format off
static const struct row scenario_row = {"SCENARIO", NULL, set_scenario, IN(scenario), NULL};
static const struct row rows[] = {
    {"--can", " [BUS=]KIND", set_can, 0, "CAN adapter on bus BUS (default: the first); may be given several times. KIND:\n"
     "        socketcand[:PORT]  socketcand protocol on 127.0.0.1 (default, port 29536; 0: any free port); without\n"
     "                           BUS= it serves every bus by name\n"
     "        slcan[:LINK]       slcan on a pseudo-terminal; LINK becomes a symbolic link to it\n"
     "        socketcan:IFACE    kernel interface such as vcan0 or can0\n"
     "        udp[:GROUP[:PORT]] UDP multicast as python-can has it, on this machine only (default 239.74.163.2:43113)\n"
     "        cannelloni[:PORT[:PEER_PORT]]\n"
     "                           cannelloni's UDP tunnel on 127.0.0.1 (default 20000:20001; PORT 0: any free port);\n"
     "                           cannelloni itself is not in Debian 12 (docs/links.md)\n"
     "        log:FILE           record every frame to FILE (candump -L format)\n"
     "        none               no adapter"},
    {"--pace", " wall|step|free", set_pace, 0, "time: real (default), only by commands of the control\n"
     "                           socket, or as fast as possible"},
    {"--for", " TIME", set_for, 0, "simulated time to run: 300ms, 10s, 2min; without a unit, seconds"},
    {"--until-eof", NULL, set_flag, IN(until_eof), "exit on end-of-file on standard input"},
    {"--wait-client", NULL, set_flag, IN(wait_client), "start the time when the first CAN client connects or the first capture of\n"
     "                           a logic analyser begins"},
    {"--seed", " N", set_seed, 0, "random seed; overrides the scenario"},
    {"--start", NULL, set_flag, IN(start), "start the units without an NMT command"},
    {"--eager", NULL, set_flag, IN(eager), "compute every conversion, also of units that no one looks at\n"
     "                           (docs/reference/lazy.md)"},
    {"--bitrate", " HZ", set_rate, IN(bitrate), "bit rate of every bus; overrides the scenario; 0: frames take no time"},
    {"--data-bitrate", " HZ", set_rate, IN(data_bitrate), "data bit rate of FD frames; overrides the scenario; 0: no FD"},
    {"--epoch", " SECONDS", set_epoch, 0, "offset of the time stamps that clients receive"},
    {"--scpi", " WHAT[:PORT]", set_scpi, 0, "SCPI instrument on 127.0.0.1: head, table, chamber, supply, or all of the scenario\n"
     "                           (default port: any free one); may be given several times\n"
     "  --scpi WHAT:pty[:LINK]   the same on a pseudo-terminal"},
    {"--control", " PATH", set_path, IN(control), "Unix socket for commands, one JSON object per line"},
    {"--truth", " PATH", set_path, IN(truth), "Unix socket with the true parameters, for programs that compare results"},
    {"--restore", " FILE", set_path, IN(restore), "continue from a snapshot, instead of a SCENARIO"},
    {"--lcm", " URL", set_lcm, 0, "publish frames, readings and instruments as LCM messages: udpm://[GROUP[:PORT]]\n"
     "                           multicast on this machine, or file://PATH an event log"},
    {"--lcm-truth", NULL, set_flag, IN(lcm_truth), "also publish the true state, for programs that compare results"},
    {"--truth-log", " FILE", set_path, IN(truth_log), "record the true state of every unit as lines of JSON"},
    {"--truth-every", " TIME", set_truth_every, 0, "interval between records of --truth-log and --lcm-truth (default 10ms)"},
    {"--unit", " NAME", set_path, IN(unit), "unit whose lines --vcd, --line and --logic show (default: the first)"},
    {"--vcd", " FILE", set_path, IN(vcd), "record the lines as VCD"},
    {"--vcd-unit", " NS", set_vcd_unit, 0, "time unit of the VCD (default 10)"},
    {"--pairs", NULL, set_flag, IN(pairs), "add the wires A and B of differential lines to --vcd, vcd.start and probe.arm, the wires\n"
     "                           B to --line (PSA-2: INT_B, DATA_B and CLK_B in bits 3 to 5)"},
    {"--vcd-analog", NULL, set_flag, IN(vcd_analog), "with the real-valued channels of the board: voltages of the integrators (PMKA)"},
    {"--line", " LINK", set_path, IN(line), "line port: lines of a board (PSA-2: INT, DATA and CLK) as sampled bytes on a\n"
     "                           pseudo-terminal; LINK becomes a symbolic link to it; -: no link"},
    {"--line-hz", " HZ", set_line_hz, 0, "sample rate of the line port (default 8000000)"},
    {"--logic", " beaglelogic[:PORT[:LINE,...]]", set_logic, 0, "\n"
     "                           logic analyser of the BeagleLogic TCP protocol on 127.0.0.1, for PulseView and sigrok-cli\n"
     "                           (default port: 5555; 0: any free one; default lines: 14 of the board; may be given several\n"
     "                           times)"},
    {"--bus-port", " [UNIT:]LINK", set_bus_port, 0, "bus port: cycles on a unit's parallel bus as lines of text on a pseudo-terminal\n"
     "                           (default: the first unit that has one); LINK as above; may be given several times"},
    {"--serial", " [UNIT:]LINK", set_serial, 0, "serial port of a unit that has one (receiver): its bytes on a pseudo-terminal, at their\n"
     "                           bit rate (default: the first unit that has one); LINK as above; may be given several times"},
    {"--mavlink", " KIND[,...]", set_mavlink, 0, "a unit as a MAVLink system (docs/tools/mavlink.md). KIND: udp[:PORT] (sends to 127.0.0.1),\n"
     "                           udpin[:PORT], tcp[:PORT] (wait for clients there), pty[:LINK]. Then, after commas:\n"
     "                           unit=NAME, sysid=N, compid=N, autopilot=generic|px4|ardupilot|invalid, imu=HZ,\n"
     "                           angles=HZ, hil=HZ (HIL messages, from the truth; off)"},
    {"--quiet", NULL, set_flag, IN(quiet), "no counters on stderr at exit"},
    {"--dump", NULL, set_action, OPTIONS_DUMP, "print the scenario with every key as JSON (itself a scenario) and exit"},
    {"--resolved", " FILE", set_path, IN(resolved), "write the scenario with every key to FILE and run"},
    {"--list-scenarios", NULL, set_action, OPTIONS_LIST_SCENARIOS, "names for SCENARIO"},
    {"--list-profiles", NULL, set_action, OPTIONS_LIST_PROFILES, "board profiles with clocks and frame"},
    {"--list-keys", NULL, set_action, OPTIONS_LIST_KEYS, "keys of a scenario with unit, range and default"},
    {"--list-commands", NULL, set_action, OPTIONS_LIST_COMMANDS, "commands of the control socket and the truth port"},
    {"--list-scpi", NULL, set_action, OPTIONS_LIST_SCPI, "SCPI headers of the instruments"},
    {"--list-faults", NULL, set_action, OPTIONS_LIST_FAULTS, "kinds of faults and their points"},
    {"--json", NULL, set_flag, IN(json), "print what a --list option or --version prints as JSON (docs/tools/json.md)"},
    {"--help", NULL, set_action, OPTIONS_HELP, NULL},
    {"--version", NULL, set_action, OPTIONS_VERSION, NULL},
};
// clang-format on
#define ROWS (sizeof rows / sizeof *rows)

bool options_print_help(FILE *out)
{
    char option[40];
    fprintf(out, "psa-emu [options] [SCENARIO]: a bench of accelerometer converter boards on a CAN bus, in software\n\n"
                 "SCENARIO is a YAML file or the name of one in proto/scenarios (default: calibrate).\n\n");
    for (unsigned i = 0; i < ROWS && rows[i].text; i++) {
        snprintf(option, sizeof option, "%s%s", rows[i].name, rows[i].form ? rows[i].form : "");
        fprintf(out, "  %-24s %s\n", option, rows[i].text);
    }
    return fprintf(out, "  --help, --version\n\n"
                        "On stdout: one line `ready key=value ...` for each endpoint, then `ready all`. Exit status: 0 "
                        "success, 2 bad input,\n"
                        "3 system error (port, interface, file), 130 interrupted by Ctrl-C.\n") >= 0;
}

bool options_cans(struct options *o, char *text, char *why, size_t cap)
{
    const struct target t = {o, why, cap, &rows[0]};
    char *rest = NULL;
    o->can_count = 0;
    for (const char *one = strtok_r(text, " ", &rest); one; one = strtok_r(NULL, " ", &rest)) {
        if (!set_can(&t, one)) return false;
    }
    return true;
}

static bool reject_option(const struct target *t, const char *word, int c)
{
    if (c == ':') return why_fail(t->why, t->cap, "%s: expected an argument, got none (psa-emu --help)", word);
    return why_fail(t->why, t->cap, "expected an option that --help lists, got %s", word);
}

static bool parse_all(struct target *t, int argc, char *const argv[])
{
    struct option longs[ROWS + 1] = {{0}};
    for (unsigned i = 0; i < ROWS; i++) {
        longs[i] = (struct option){.name = rows[i].name + 2, .has_arg = rows[i].form != NULL, .val = 256 + (int)i};
    }
    optind = 0;
    for (int c; (c = getopt_long(argc, argv, "-:", longs, NULL)) != -1;) {
        if (c < 256 && c != 1) return reject_option(t, argv[optind - 1], c);
        t->row = c == 1 ? &scenario_row : &rows[c - 256];
        if (!t->row->set(t, optarg)) return false;
    }
    for (t->row = &scenario_row; optind < argc; optind++) {
        if (!set_scenario(t, argv[optind])) return false;
    }
    return true;
}

bool options_parse(int argc, char *const argv[], struct options *o, char *why, size_t cap)
{
    *o = (struct options){
        .pace = PACE_WALL, .for_ns = INT64_MAX, .vcd_unit_ns = 10, .line_hz = 8000000, .truth_every_ns = 10000000};
    struct target t = {o, why, cap, NULL};
    for (int i = 1; i < argc; i++) /* paths are repeated in JSON */
        if (!utf8_valid(argv[i])) return why_fail(why, cap, "argument %d: expected UTF-8", i);
    if (!parse_all(&t, argc, argv)) return false;
    if (o->pace == PACE_STEP && !o->control) {
        return why_fail(why, cap, "--pace step: expected --control PATH, whose commands advance the time, got none");
    }
    if (o->json && (o->action == OPTIONS_RUN || o->action == OPTIONS_HELP)) {
        return why_fail(why, cap, "--json: expected a --list option or --version with it, got none");
    }
    if (o->lcm_truth && !o->lcm) return why_fail(why, cap, "--lcm-truth: expected --lcm URL, got none");
    if (o->wait_client && o->pace == PACE_STEP) {
        return why_fail(why, cap, "--wait-client: expected --pace wall or free, got step");
    }
    if (o->restore && (o->scenario || o->seed_given || o->bitrate.given || o->data_bitrate.given || o->start)) {
        return why_fail(
            why, cap,
            "--restore %s: expected no SCENARIO, --seed, --bitrate, --data-bitrate and --start: the snapshot has them",
            o->restore);
    }
    if (!o->can_given)
        o->can[o->can_count++] = (struct options_can){.kind = OPTIONS_SOCKETCAND, .port = SOCKETCAND_PORT};
    return true;
}

/* A scenario from YAML: what is on the bench and what happens to it. docs/scenarios.md lists the keys.
 *
 *     seed: 1
 *     buses: [{name: can0, bitrate_hz: 1000000, data_bitrate_hz: 5000000}]
 *     site: {g_mps2: 9.81}
 *     head: {resolution_arcsec: 1, setting_error_arcsec_rms: 2, turn_s: 2}
 *     units:
 *       - {name: a, board: psa2, profile: article, node: 5, serial: 17,
 *          axes: {x: {sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0}}}
 *     timeline:
 *       - {at_s: 1.5, cmd: head.turn, args: {angle_deg: 90}}
 *
 * Values are checked one by one with the line they stand on; profiles are loaded and checked with them. The dump is the
 * scenario with every key, as JSON, which is YAML 1.2: loaded again it gives the same bench and the same dump. */
#ifndef PSABENCH_SCENARIO_SCENARIO_H
#define PSABENCH_SCENARIO_SCENARIO_H

#include "base/can/can.h"
#include "base/sha256.h"
#include "phys/sensor/quartz_batch.h"
#include "scenario/find.h"
#include "unit/unit.h"

#include <cjson/cJSON.h>
#include <stdio.h>

#define SCENARIO_UNITS_MAX  1000u
#define SCENARIO_BUSES_MAX  8u
#define SCENARIO_EVENTS_MAX 128u
#define SCENARIO_ARGS_MAX   1024u

struct scenario_bus {
    char name[16];
    struct can_bus_cfg cfg;
};

/* As a map gives it. */
struct scenario_site {
    double g_mps2; /* given, or the normal gravity of the place */
    bool placed;   /* there is a latitude: the Earth turns under the bench */
    double latitude_deg, longitude_deg, height_m, azimuth_deg;
};

/* A signal from a file, by series_file.h. */
struct scenario_series {
    bool given;
    char file[256];  /* relative: from the scenario's folder; scenario_open() makes it absolute */
    char column[48]; /* its unit at the end */
    double start_s;
    enum series_between between;
    enum series_end at_end;
    char sha256[SHA256_HEX]; /* of the file; "": any */
};

struct scenario_unit {
    char name[32];
    const struct board_name *board; /* as the key says: of one type, several names */
    union board_profile_store profile;
    struct unit_cfg cfg; /* name and profile point into this struct once it is in its place: scenario_bind() */
    struct scenario_series series[UNIT_AXES];
    double misalignment_arcsec[3]; /* to cfg.mounting by scenario_bind() */
    char bus_name[16];
    char level[32];     /* of a gyro unit: the unit that reads its level sensors; "": none */
    unsigned bus;       /* index into the buses */
    uint8_t frame_form; /* written to object 2020h at the start; 0 pair, 1 fast, 2 FD frame, 3 FD block */
    uint8_t uds_ecu;    /* its UDS door; 0: none */
    bool spread;        /* parameters of its own, drawn from the production spread */
};

/* What differs from unit to unit: standard deviations, and a batch. */
struct scenario_spread {
    struct mems_g mems;
    struct cvg_dps cvg;
    struct afe_cfg afe;
    bool quartz_given;
    struct quartz_batch quartz; /* of which the quartz sensors are */
};

/* A command that the bench gives to itself. */
struct scenario_event {
    double at_s;
    char cmd[32];
    char args[SCENARIO_ARGS_MAX]; /* JSON */
    unsigned line, column;        /* in the file */
};

struct scenario_events {
    struct scenario_event event[SCENARIO_EVENTS_MAX];
    unsigned count;
};

struct scenario {
    char path[FIND_PATH_MAX];
    uint64_t seed;
    struct scenario_bus bus[SCENARIO_BUSES_MAX];
    unsigned bus_count;
    struct scenario_site site;
    struct lab_cfg lab; /* its site: from the one above, by scenario_bind() */
    bool start;         /* units are commanded to stream by the bench itself */
    struct scenario_spread spread;
    struct scenario_events timeline, faults; /* of faults: cmd is fault.add, given before power-on */
    unsigned unit_count;
    struct scenario_unit units[SCENARIO_UNITS_MAX]; /* last: those beyond unit_count are never written */
};

/* name: a path, or a scenario of proto/scenarios. False with one line in why. */
bool scenario_load(const char *name, struct scenario *s, char *why, size_t cap);

/* The same from memory; path says where relative profiles lie and is in messages. */
bool scenario_parse(const char *path, const char *text, size_t len, struct scenario *s, char *why, size_t cap);

/* Opens the files that signals come from: once, before scenario_bind(), when the struct's copies may go anywhere. The dump has
 * their SHA-256 from then on, and refuses another file. False with one line in why. */
bool scenario_open(struct scenario *s, char *why, size_t cap);

/* What there is of it: a scenario of few units is a small part of the struct. Before scenario_bind(). */
void scenario_copy(struct scenario *to, const struct scenario *from);

/* Sets the pointers inside the units and the seed of every noise, and draws what the production spread leaves open: once,
 * when the struct stays where it is and its seed is the one to be used. */
void scenario_bind(struct scenario *s);

/* Every key with its value, before scenario_bind(). The caller deletes it. */
cJSON *scenario_dump(const struct scenario *s);

/* The keys as Markdown tables, for docs/scenarios.md and --list-keys. */
void scenario_keys(FILE *out);
void scenario_add_keys(cJSON *to); /* the same as JSON */

#endif

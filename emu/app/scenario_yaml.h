/* A scenario from YAML: what stands on the bench. docs/emulator.md lists the keys.
 *
 *     seed: 1
 *     bus: {bitrate_hz: 1000000, data_bitrate_hz: 5000000}
 *     site: {g_mps2: 9.81}
 *     head: {resolution_arcsec: 1, setting_error_arcsec_rms: 2, turn_s: 2}
 *     units:
 *       - {name: a, board: psa2, profile: article, node: 5, serial: 17,
 *          axes: {x: {sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0}}}
 *
 * Values are checked one by one with the line they stand on; profiles are loaded and checked with them. */
#ifndef PSABENCH_APP_SCENARIO_YAML_H
#define PSABENCH_APP_SCENARIO_YAML_H

#include "app/find.h"
#include "base/can.h"
#include "board/unit.h"

#define SCENARIO_UNITS_MAX 8u

struct scenario_unit {
    char name[32];
    char board_name[8]; /* psa2 or psa1 */
    struct psa2_profile profile;
    bool profile_named, profile_changed; /* while loading */
    struct unit_cfg cfg; /* name and profile point into this struct once it is in its place: scenario_bind() */
    uint8_t frame_form;  /* written to object 2020h at the start; 0 pair, 1 fast, 2 FD frame, 3 FD block */
};

struct scenario {
    char path[FIND_PATH_MAX];
    uint64_t seed;
    struct can_bus_cfg bus;
    struct site site;
    struct head_cfg head;
    bool start; /* units are told to stream by the bench itself */
    unsigned unit_count;
    struct scenario_unit units[SCENARIO_UNITS_MAX];
};

/* name: a path, or a scenario of proto/scenarios. False with one line in why. */
bool scenario_load(const char *name, struct scenario *s, char *why, size_t cap);

/* The same from memory; path says where relative profiles lie and stands in messages. */
bool scenario_parse(const char *path, const char *text, size_t len, struct scenario *s, char *why, size_t cap);

/* Sets the pointers inside the units and the seed of every noise; call when the struct stays where it is. */
void scenario_bind(struct scenario *s);

#endif

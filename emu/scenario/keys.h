/* The tables of the scenario's keys, one for each mapping: loader, dump and reference read them. */
#ifndef PSABENCH_SCENARIO_KEYS_H
#define PSABENCH_SCENARIO_KEYS_H

#include "scenario/fields.h"
#include "scenario/scenario.h"

/* A number of a struct: key, limits, meaning. */
#define REAL_ROW(of, name, lo, hi, words)                                                                              \
    {                                                                                                                  \
        .key = #name, .type = FIELD_REAL, .offset = offsetof(of, name), .min = (lo), .max = (hi), .what = (words)      \
    }

extern const struct fields scenario_bus_fields;           /* of struct can_bus_cfg: the key `bus` */
extern const struct fields scenario_buses_fields;         /* of struct scenario_bus: an element of `buses` */
extern const struct fields scenario_site_fields;          /* of struct scenario_site */
extern const struct fields scenario_head_fields;          /* of struct head_cfg */
extern const struct fields scenario_table_fields;         /* of struct table_cfg */
extern const struct fields scenario_axis_of_table_fields; /* of struct table_axis_cfg */
extern const struct fields scenario_chamber_fields;       /* of struct chamber_cfg */
extern const struct fields scenario_supply_fields;        /* of struct supply_cfg */
extern const struct fields scenario_platform_fields;      /* of struct platform_cfg */
extern const struct fields scenario_vehicle_fields;       /* of struct vehicle_cfg */
extern const struct fields scenario_sway_fields;          /* of struct vehicle_sway */
extern const struct fields scenario_magnetic_fields;      /* of struct magnetic_cfg */
extern const struct fields scenario_flight_fields;        /* of struct flight_cfg */
extern const struct fields scenario_leg_fields;           /* of struct flight_leg: every key of every kind */
extern const struct fields scenario_baro_fields;          /* of struct baro_cfg */
extern const struct fields scenario_spread_fields;        /* of struct scenario_spread */
extern const struct fields scenario_batch_fields;         /* of struct quartz_batch */
extern const struct fields scenario_afe_fields;           /* of struct afe_cfg */
extern const struct fields scenario_afe_numbers;          /* its numbers alone */
extern const struct fields scenario_mems_fields;          /* of struct mems_g */
extern const struct fields scenario_quartz_fields;        /* of struct quartz_g */
extern const struct fields scenario_cvg_fields;           /* of struct cvg_dps */
extern const struct fields scenario_pendulum_fields;      /* of struct pendulum */
extern const struct fields scenario_series_fields;        /* of struct scenario_series */
extern const struct fields scenario_unit_fields;          /* of struct scenario_unit */
extern const struct fields scenario_axis_fields;          /* of struct scenario_unit: its channel X */
extern const struct fields scenario_event_fields;         /* of struct scenario_event */
extern const struct fields scenario_fields;               /* of struct scenario */

void scenario_default(struct scenario *s, const char *path);
struct scenario_unit scenario_unit_default(unsigned i); /* of the i-th unit, with the first of the boards */

void scenario_dump_unit(const struct scenario_unit *u, cJSON *to); /* the keys that its board has */

/* For the rows of struct scenario. */
bool scenario_load_site(struct yaml_file *f, const struct yaml_node *node, void *section);
void scenario_dump_site(const struct field *d, const void *section, cJSON *to);
bool scenario_load_table(struct yaml_file *f, const struct yaml_node *node, void *section);
void scenario_dump_table(const struct field *d, const void *section, cJSON *to);
bool scenario_load_batch(struct yaml_file *f, const struct yaml_node *node,
                         void *section); /* of struct scenario_spread */
void scenario_dump_batch(const struct field *d, const void *section, cJSON *to);
bool scenario_load_vehicle(struct yaml_file *f, const struct yaml_node *node, void *section);

struct site scenario_site(const struct scenario_site *s);

/* What is in more than one key. */
bool scenario_check_lab(struct yaml_file *f, const struct yaml_node *root, const struct lab_cfg *lab);
bool scenario_check_seats(struct yaml_file *f, const struct yaml_node *root, const struct scenario *s);

bool scenario_check_flight(struct yaml_file *f, const struct yaml_node *root, const struct scenario *s);
bool scenario_check_platform(struct yaml_file *f, const struct yaml_node *root, const struct scenario *s);

/* The node of its level unit, by the name that it gives. */
void scenario_bind_level(const struct scenario *s, struct scenario_unit *u);

/* The list `units`, an element of which may be several units. */
bool scenario_load_units(struct yaml_file *f, const struct yaml_node *node, void *section);

#endif

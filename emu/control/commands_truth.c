/* Commands of the truth port: hidden parameters and true state, for graders alone. */
#include "control/commands.h"
#include "control/describe.h"
#include "phys/sensor/quartz_batch.h"
#include "scenario/keys.h"

/* ---- parameters: by the tables of the scenario's keys */

static void add_section(const struct fields *rows, const void *section, const char *name, cJSON *to)
{
    yaml_dump(rows, section, cJSON_AddObjectToObject(to, name));
}

static void put_hidden(void *ctx, const char *name, double value)
{
    add_real(ctx, name, value);
}

/* Of boards that heed them. */
static void add_noise(const struct unit *u, cJSON *to)
{
    const struct board_cfg *c = &u->cfg.board;
    const struct board_type *t = u->type;
    add_real(to, "adc_noise_scale", c->adc_noise_scale);
    if (board_has(t, "temp_noise_scale")) add_real(to, "temp_noise_scale", c->temp_noise_scale);
    if (board_has(t, "temp_adc_offset_v")) add_real(to, "temp_adc_offset_v", c->temp_adc_offset_v);
    if (board_has(t, "temp_adc_gain_error")) add_real(to, "temp_adc_gain_error", c->temp_adc_gain_error);
}

static void add_axis(struct unit *u, unsigned i, cJSON *to, int64_t t_ns)
{
    static const char *const names[] = {[UNIT_NO_SENSOR] = "none",
                                        [UNIT_MEMS] = "mems",
                                        [UNIT_QUARTZ] = "quartz",
                                        [UNIT_RECORDED] = "recorded",
                                        [UNIT_CVG] = "mems_gyro"};
    const enum unit_sensor sensor = u->cfg.axis[i].sensor;
    cJSON_AddStringToObject(to, "sensor", names[sensor]);
    if (sensor == UNIT_MEMS) yaml_dump(&scenario_mems_fields, &u->cfg.axis[i].mems, to);
    if (sensor == UNIT_MEMS) add_real(to, "sensor_v", unit_sensor_out(u, i, t_ns));
    if (sensor == UNIT_CVG) add_section(&scenario_cvg_fields, &u->cfg.axis[i].cvg, "gyro", to);
    if (sensor == UNIT_CVG) add_real(to, "sensor_v", unit_sensor_out(u, i, t_ns));
    if (sensor == UNIT_QUARTZ) add_section(&scenario_quartz_fields, &u->quartz[i].cfg, "quartz", to);
    if (sensor == UNIT_QUARTZ) cJSON_AddStringToObject(to, "group", quartz_group_name(quartz_group(&u->quartz[i].cfg)));
    if (sensor == UNIT_QUARTZ) add_real(to, "sensor_a", unit_sensor_out(u, i, t_ns));
    const bool current = u->cfg.board.afe[i].input == AFE_CURRENT;
    if (sensor == UNIT_RECORDED) add_real(to, current ? "sensor_a" : "sensor_v", unit_sensor_out(u, i, t_ns));
    add_section(&scenario_afe_fields, &u->cfg.board.afe[i], "afe", to);
}

static void add_unit_truth(struct unit *u, cJSON *to, int64_t t_ns)
{
    static const char *const axis[] = {"x", "y", "z"};
    cJSON_AddStringToObject(to, "board", u->type->name);
    add_count(to, "serial", u->cfg.board.serial);
    if (u->sensors_serial != u->cfg.board.serial) add_count(to, "sensors_serial", u->sensors_serial);
    add_count(to, "node", u->cfg.node);
    cJSON_AddStringToObject(to, "profile", u->profile);
    add_noise(u, to);
    if (u->type->truth) u->type->truth(u->board, put_hidden, cJSON_AddObjectToObject(to, "specimen"));
    cJSON *temps = cJSON_AddArrayToObject(to, "temp_degc");
    for (unsigned i = 0; i < UNIT_TEMPS; i++) cJSON_AddItemToArray(temps, cJSON_CreateNumber(u->cfg.temp_degc[i]));
    cJSON *axes = cJSON_AddObjectToObject(to, "axes");
    for (unsigned i = 0; i < UNIT_AXES; i++) add_axis(u, i, cJSON_AddObjectToObject(axes, axis[i]), t_ns);
}

static enum control_outcome do_truth(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    cJSON *to = call->result;
    cJSON_AddStringToObject(to, "scenario", b->scenario);
    add_count(to, "seed", b->seed);
    cJSON *site = cJSON_AddObjectToObject(to, "site");
    add_real(site, "g_mps2", b->lab->head.site.g_mps2);
    cJSON *head = cJSON_AddObjectToObject(to, "head");
    add_real(head, "angle_rad", head_angle_rad(&b->lab->head, call->t_ns));
    add_real(head, "setting_error_arcsec_rms", b->lab->head.cfg.setting_error_arcsec_rms);
    add_real(head, "resolution_arcsec", b->lab->head.cfg.resolution_arcsec);
    add_real(head, "periodic_arcsec", b->lab->head.cfg.periodic_arcsec);
    add_real(head, "mount_error_arcsec_rms", b->lab->head.cfg.mount_error_arcsec_rms);
    add_real(head, "turn_s", b->lab->head.cfg.turn_s);
    cJSON *units = cJSON_AddObjectToObject(to, "units");
    for (unsigned i = 0; i < b->units; i++) {
        add_unit_truth(b->unit[i], cJSON_AddObjectToObject(units, b->unit[i]->cfg.name), call->t_ns);
    }
    return CONTROL_DONE;
}

/* ---- state */

static const double deg_of_rad = 57.295779513082320877;

static void add_table(const struct lab *l, cJSON *to, int64_t t_ns)
{
    cJSON *list = cJSON_AddArrayToObject(to, "table");
    for (unsigned i = 0; i < l->table.cfg.axes; i++) {
        const struct motion_state s = table_axis(&l->table, i, t_ns);
        cJSON *j = add_object(list);
        add_real(j, "angle_deg", s.angle_rad * deg_of_rad);
        add_real(j, "rate_dps", s.rate_radps * deg_of_rad);
        add_real(j, "accel_dps2", s.accel_radps2 * deg_of_rad);
    }
}

static void add_pair(cJSON *to, const char *name, const double v[2], double scale)
{
    const double scaled[2] = {v[0] * scale, v[1] * scale};
    cJSON_AddItemToObject(to, name, cJSON_CreateDoubleArray(scaled, 2));
}

/* Angles of platform and vehicle as in phys/motion/platform.h; pairs: about x, about z. */
static void add_platform(struct lab *l, cJSON *to, int64_t t_ns)
{
    const double degph_of_radps = deg_of_rad * 3600.0;
    struct platform_state s;
    struct vehicle_state v;
    cJSON *j = cJSON_AddObjectToObject(to, "platform");
    platform_at(&l->platform, t_ns, &s);
    vehicle_at(&l->platform.vehicle, t_ns, &v);
    add_real(j, "alpha_deg", s.alpha_rad * deg_of_rad);
    add_real(j, "beta_deg", s.beta_rad * deg_of_rad);
    add_real(j, "gamma_deg", s.gamma_rad * deg_of_rad);
    add_real(j, "q_deg", s.q_rad * deg_of_rad);
    add_real(j, "servo_deg", platform_servo_rad(&l->platform, t_ns) * deg_of_rad);
    add_real(j, "encoder_deg", platform_encoder_rad(&l->platform, t_ns) * deg_of_rad);
    add_pair(j, "drift_degph", s.drift_radps, degph_of_radps);
    add_pair(j, "torque_degph", s.torque_radps, degph_of_radps);
    cJSON *vehicle = cJSON_AddObjectToObject(to, "vehicle");
    add_real(vehicle, "heading_deg", v.heading_rad * deg_of_rad);
    add_real(vehicle, "pitch_deg", v.pitch_rad * deg_of_rad);
    add_real(vehicle, "roll_deg", v.roll_rad * deg_of_rad);
    add_real(vehicle, "speed_mps", v.speed_mps);
    add_real(vehicle, "latitude_deg", v.latitude_rad * deg_of_rad);
    cJSON_AddItemToObject(vehicle, "accel_l_mps2", cJSON_CreateDoubleArray(v.accel_l_mps2, 3));
}

static void add_triple(cJSON *to, const char *name, const double v[3])
{
    cJSON_AddItemToObject(to, name, cJSON_CreateDoubleArray(v, 3));
}

/* As in phys/flight/flight.h; velocities and accelerations east, north, up. */
static void add_flight(struct lab *l, cJSON *to, int64_t t_ns)
{
    const struct flight_state *s = lab_aircraft(l, t_ns);
    const struct flight_leg *leg = &l->flight.cfg.plan.leg[s->leg];
    cJSON *j = cJSON_AddObjectToObject(to, "flight");
    add_count(j, "leg", s->leg);
    cJSON_AddStringToObject(j, "kind", flight_kind(leg->kind)->key);
    add_real(j, "latitude_deg", s->lat_rad * deg_of_rad);
    add_real(j, "longitude_deg", s->lon_rad * deg_of_rad);
    add_real(j, "height_m", s->h_m);
    add_triple(j, "v_enu_mps", s->v_enu_mps);
    add_triple(j, "a_enu_mps2", s->a_enu_mps2);
    add_real(j, "heading_deg", s->heading_rad * deg_of_rad);
    add_real(j, "pitch_deg", s->pitch_rad * deg_of_rad);
    add_real(j, "roll_deg", s->roll_rad * deg_of_rad);
    add_real(j, "baro_m", flight_baro_m(&l->flight, t_ns));
}

/* Of the quartz sensors whose pendulum is known: what their phase-sensitive amplifiers have before them. */
static void add_pickoffs(const struct unit *u, cJSON *to)
{
    static const char *const axis[] = {"x", "y", "z"};
    struct pickoff p;
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        if (u->cfg.axis[i].sensor != UNIT_QUARTZ || !quartz_pickoff(&u->quartz[i], &p)) continue;
        cJSON *all = cJSON_GetObjectItem(to, "pickoff");
        cJSON *j = cJSON_AddObjectToObject(all ? all : cJSON_AddObjectToObject(to, "pickoff"), axis[i]);
        add_real(j, "angle_urad", p.angle_rad * 1e6);
        cJSON_AddItemToObject(j, "gap_m", cJSON_CreateDoubleArray(p.gap_m, 2));
        add_real(j, "delta_m", p.delta_m);
        add_real(j, "pickoff_v", p.volt_v);
        add_real(j, "amplifier_a", p.current_a);
    }
}

/* At the unit's origin, in the axes of its case. */
static void add_unit_state(struct unit *u, cJSON *to, int64_t t_ns)
{
    static const double origin_m[3];
    struct kinematics kin;
    const struct chamber *k = &u->lab->chamber;
    lab_kinematics(u->lab, &u->cfg.mounting, origin_m, t_ns, &kin);
    cJSON_AddStringToObject(to, "name", u->cfg.name);
    cJSON_AddItemToObject(to, "f_mps2", cJSON_CreateDoubleArray(kin.f_mps2, 3));
    cJSON_AddItemToObject(to, "w_radps", cJSON_CreateDoubleArray(kin.w_radps, 3));
    if (k->cfg.present) add_real(to, "case_degc", chamber_case_degc(k, &u->body, t_ns));
    if (k->cfg.present) add_real(to, "element_degc", chamber_element_degc(k, &u->body, t_ns));
    if (!k->cfg.present) cJSON_AddItemToObject(to, "temp_degc", cJSON_CreateDoubleArray(u->cfg.temp_degc, UNIT_TEMPS));
    cJSON *volts = cJSON_AddArrayToObject(to, "sensor_v");
    cJSON *amperes = cJSON_AddArrayToObject(to, "sensor_a");
    cJSON *moved = cJSON_AddArrayToObject(to, "zero_moved_v");
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        const double out = unit_sensor_out(u, i, t_ns);
        const enum unit_sensor sensor = u->cfg.axis[i].sensor;
        const bool current =
            sensor == UNIT_QUARTZ || (sensor == UNIT_RECORDED && u->cfg.board.afe[i].input == AFE_CURRENT);
        cJSON_AddItemToArray(volts, cJSON_CreateNumber(current ? 0.0 : out));
        cJSON_AddItemToArray(amperes, cJSON_CreateNumber(current ? out : 0.0));
        cJSON_AddItemToArray(moved, cJSON_CreateNumber(unit_zero_moved_v(u, i, t_ns)));
    }
    add_pickoffs(u, to);
}

static enum control_outcome do_state(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    const int64_t t_ns = call->t_ns;
    cJSON *to = call->result;
    cJSON *head = cJSON_AddObjectToObject(to, "head");
    add_real(head, "angle_deg", head_angle_rad(&b->lab->head, t_ns) * deg_of_rad);
    cJSON_AddStringToObject(head, "face", head_face_name(head_face(&b->lab->head, t_ns)));
    add_table(b->lab, to, t_ns);
    if (b->lab->chamber.cfg.present) add_real(to, "air_degc", chamber_air_degc(&b->lab->chamber, t_ns));
    if (b->lab->platform.cfg.present) add_platform(b->lab, to, t_ns);
    if (b->lab->flight.cfg.present) add_flight(b->lab, to, t_ns);
    if (b->lab->supply.cfg.present) add_real(to, "supply_v", supply_volts(&b->lab->supply, t_ns));
    if (b->units) add_unit_state(b->unit[call->v[0].unit], cJSON_AddObjectToObject(to, "unit"), t_ns);
    return CONTROL_DONE;
}

static const struct control_command rows[] = {
    {"help", "Lists the commands with their arguments.", NULL, .run = describe_commands},
    {"truth", "Reads the hidden parameters of the bench, for graders after the estimate.", NULL, .run = do_truth},
    {"truth.state",
     "Reads the true state now: angles, rates, temperatures, supply, and the kinematics and sensor outputs of a unit.",
     CONTROL_ARGS({"unit", CONTROL_UNIT, true, .what = "unit; default: the first"}), .run = do_state},
};
const struct control_table commands_truth = {rows, sizeof rows / sizeof *rows};

#include "telemetry/lcm_state.h"

#include "gen/lcm/psabench_lcm_instruments_t.h"
#include "gen/lcm/psabench_lcm_truth_t.h"
#include "telemetry/lcm_board.h"

#include <math.h>

static const double deg_of_rad = 57.295779513082320877;

void lcm_state_instruments(struct lcm_feed *f, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX];
    double angle_deg[TABLE_AXES_MAX], rate_dps[TABLE_AXES_MAX];
    const struct lab *l = f->bench->lab;
    for (unsigned i = 0; i < l->table.cfg.axes; i++) {
        const struct table_reading r = table_read(&l->table, i, t_ns);
        angle_deg[i] = r.angle_deg;
        rate_dps[i] = r.rate_dps;
    }
    const struct supply *supply = &l->supply;
    const psabench_lcm_instruments_t shown = {.t_ns = t_ns,
                                              .epoch_ns = f->epoch_ns,
                                              .head_deg = head_read_deg(&l->head, t_ns),
                                              .head_face = lcm_text(head_face_name(head_face(&l->head, t_ns))),
                                              .head_at_rest = head_at_rest(&l->head, t_ns),
                                              .table_axes = (int32_t)l->table.cfg.axes,
                                              .table_deg = angle_deg,
                                              .table_dps = rate_dps,
                                              .chamber_degc =
                                                  l->chamber.cfg.present ? chamber_shown_degc(&l->chamber, t_ns) : NAN,
                                              .supply_v = supply->cfg.present ? supply_shown_v(supply, t_ns) : NAN,
                                              .supply_on = supply->cfg.present && supply->on};
    const int len = psabench_lcm_instruments_t_encode(out, 0, sizeof out, &shown);
    lcm_feed_send(f, "PSABENCH_INSTRUMENTS", out, len, t_ns);
}

void lcm_state_truth(struct lcm_feed *f, struct lcm_unit *u, int64_t t_ns)
{
    static const double origin_m[3];
    uint8_t out[LCM_MESSAGE_MAX];
    struct kinematics kin;
    struct lab *l = f->bench->lab;
    psabench_lcm_truth_t truth = {.t_ns = t_ns, .epoch_ns = f->epoch_ns, .unit = lcm_text(u->name)};
    lab_kinematics(l, &u->unit->cfg.mounting, origin_m, t_ns, &kin);
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        const double output = unit_sensor_out(u->unit, i, t_ns);
        const bool current = u->unit->cfg.axis[i].sensor == UNIT_QUARTZ;
        truth.f_mps2[i] = kin.f_mps2[i];
        truth.w_radps[i] = kin.w_radps[i];
        truth.sensor_v[i] = current ? 0.0 : output;
        truth.sensor_a[i] = current ? output : 0.0;
        truth.case_degc[i] =
            l->chamber.cfg.present ? chamber_case_degc(&l->chamber, &u->unit->body, t_ns) : u->unit->cfg.temp_degc[i];
    }
    truth.head_deg = head_angle_rad(&l->head, t_ns) * deg_of_rad;
    truth.supply_v = l->supply.cfg.present ? supply_volts(&l->supply, t_ns) : NAN;
    lcm_feed_send(f, u->truth, out, psabench_lcm_truth_t_encode(out, 0, sizeof out, &truth), t_ns);
}

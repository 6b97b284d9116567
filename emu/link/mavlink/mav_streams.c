/* Messages that the station sends by itself: each a row with its rate, due with a reading of the board or with time. */
#include "link/mavlink/mav_station.h"

#include <math.h>
#include <string.h>

enum { HEARTBEAT, HIGHRES_IMU, ACCEL, ATTITUDE, ANGLES, LINK, HIL_SENSOR, HIL_GPS, VERSION };

#define DEG (3.14159265358979323846 / 180.0)

static const double hil_gps_hz = 5.0;

/* ---- one function a message */

static void send_heartbeat(struct mav_station *s, int64_t t_ns)
{
    (void)t_ns;
    const mavlink_heartbeat_t m = {
        .type = s->cfg.type, .autopilot = s->cfg.autopilot, .system_status = MAV_STATE_ACTIVE, .mavlink_version = 3};
    mav_send(s, MAV_KIND(HEARTBEAT), &m);
}

/* Specific force, as autopilots have it: -g on an axis that points down. The board's convention is the article's, +g there. */
static float force_mps2(const struct mav_station *s, unsigned axis)
{
    return (float)-s->accel_mps2[axis];
}

static void send_highres_imu(struct mav_station *s, int64_t t_ns)
{
    enum { ACCEL_FIELDS = 7 };
    (void)t_ns;
    const mavlink_highres_imu_t m = {.time_usec = mav_time_us(s, s->reading.t_ns),
                                     .xacc = force_mps2(s, 0),
                                     .yacc = force_mps2(s, 1),
                                     .zacc = force_mps2(s, 2),
                                     .fields_updated = ACCEL_FIELDS};
    mav_send(s, MAV_KIND(HIGHRES_IMU), &m);
}

static void send_accel(struct mav_station *s, int64_t t_ns)
{
    const struct mav_reading *r = &s->reading;
    (void)t_ns;
    mavlink_psabench_accel_t m = {.time_usec = mav_time_us(s, r->t_ns),
                                  .seq = s->counters.readings - 1,
                                  .temp_code = r->temp_code,
                                  .temp_channel = r->temp_channel,
                                  .status = r->status,
                                  .scale = PSABENCH_SCALE_NOMINAL};
    memcpy(m.code, r->code, sizeof m.code);
    memcpy(m.volts, r->volts, sizeof m.volts);
    memcpy(m.accel_mps2, s->accel_mps2, sizeof m.accel_mps2);
    mav_send(s, MAV_KIND(PSABENCH_ACCEL), &m);
}

static float wrapped_rad(double angle_deg)
{
    return (float)(remainder(angle_deg, 360.0) * DEG);
}

/* Of one axis z; of two, y carries z; of three, z carries y carries x. The head's scale is the pitch where there is no table. */
static void send_attitude(struct mav_station *s, int64_t t_ns)
{
    struct mav_readouts r = {0};
    s->io.readouts(s->io.ctx, &r, t_ns);
    mavlink_attitude_t m = {.time_boot_ms = (uint32_t)(t_ns / 1000000)};
    if (r.axes == 0) {
        m.pitch = wrapped_rad(r.head_deg);
    } else {
        const unsigned yaw = r.axes == 2 ? 1 : 0, pitch = r.axes == 2 ? 0 : 1;
        m.yaw = wrapped_rad(r.table_deg[yaw]);
        m.yawspeed = (float)(r.table_dps[yaw] * DEG);
        m.pitch = r.axes > 1 ? wrapped_rad(r.table_deg[pitch]) : 0.0f;
        m.pitchspeed = r.axes > 1 ? (float)(r.table_dps[pitch] * DEG) : 0.0f;
        m.roll = r.axes > 2 ? wrapped_rad(r.table_deg[2]) : 0.0f;
        m.rollspeed = r.axes > 2 ? (float)(r.table_dps[2] * DEG) : 0.0f;
    }
    mav_send(s, MAV_KIND(ATTITUDE), &m);
}

static void send_angles(struct mav_station *s, int64_t t_ns)
{
    struct mav_readouts r = {0};
    s->io.readouts(s->io.ctx, &r, t_ns);
    mavlink_psabench_angles_t m = {.time_usec = mav_time_us(s, t_ns), .head_deg = r.head_deg};
    m.valid = (uint8_t)(((1u << r.axes) - 1u) | (r.head ? PSABENCH_INSTRUMENT_HEAD : 0u));
    memcpy(m.table_deg, r.table_deg, sizeof m.table_deg);
    memcpy(m.table_dps, r.table_dps, sizeof m.table_dps);
    mav_send(s, MAV_KIND(PSABENCH_ANGLES), &m);
}

static void send_link(struct mav_station *s, int64_t t_ns)
{
    const mavlink_psabench_link_t m = {.time_usec = mav_time_us(s, t_ns),
                                       .sent = s->counters.sent,
                                       .lost = s->lost,
                                       .received = s->received,
                                       .malformed = s->malformed,
                                       .readings = s->counters.readings,
                                       .readings_lost = s->counters.readings_lost,
                                       .peers = (uint8_t)s->peers};
    mav_send(s, MAV_KIND(PSABENCH_LINK), &m);
}

/* Pressure of the standard atmosphere below 11 km, hPa. */
static double pressure_hpa(double height_m)
{
    return 1013.25 * pow(1.0 - 2.25577e-5 * height_m, 5.25588);
}

/* Accelerations of the board, by its codes; angular rate and pressure are the simulated world's own, without errors. */
static void send_hil_sensor(struct mav_station *s, int64_t t_ns)
{
    enum { ACCEL_GYRO_PRESSURE = 0x003F | 0x0A00, ID_0 = 0 };
    struct mav_world w = {0};
    s->io.world(s->io.ctx, &w, t_ns);
    const mavlink_hil_sensor_t m = {.time_usec = mav_time_us(s, t_ns),
                                    .xacc = force_mps2(s, 0),
                                    .yacc = force_mps2(s, 1),
                                    .zacc = force_mps2(s, 2),
                                    .xgyro = (float)w.gyro_radps[0],
                                    .ygyro = (float)w.gyro_radps[1],
                                    .zgyro = (float)w.gyro_radps[2],
                                    .abs_pressure = (float)pressure_hpa(w.height_m),
                                    .pressure_alt = (float)w.height_m,
                                    .fields_updated = ACCEL_GYRO_PRESSURE,
                                    .id = ID_0};
    mav_send(s, MAV_KIND(HIL_SENSOR), &m);
}

static int16_t cm_per_s(double v_mps)
{
    const double v = nearbyint(v_mps * 100.0);
    return (int16_t)(v > INT16_MAX ? INT16_MAX : v < INT16_MIN ? INT16_MIN : v);
}

static void send_hil_gps(struct mav_station *s, int64_t t_ns)
{
    enum { FIX_3D = 3, DILUTION = 100, SATELLITES = 10 };
    struct mav_world w = {0};
    s->io.world(s->io.ctx, &w, t_ns);
    const double speed_mps = hypot(w.north_mps, w.east_mps);
    const double track_deg = atan2(w.east_mps, w.north_mps) / DEG;
    const mavlink_hil_gps_t m = {.time_usec = mav_time_us(s, t_ns),
                                 .lat = (int32_t)nearbyint(w.latitude_deg * 1e7),
                                 .lon = (int32_t)nearbyint(w.longitude_deg * 1e7),
                                 .alt = (int32_t)nearbyint(w.height_m * 1e3),
                                 .eph = DILUTION,
                                 .epv = DILUTION,
                                 .vel = (uint16_t)cm_per_s(speed_mps),
                                 .vn = cm_per_s(w.north_mps),
                                 .ve = cm_per_s(w.east_mps),
                                 .vd = cm_per_s(w.down_mps),
                                 .cog =
                                     speed_mps > 0.1 ? (uint16_t)(fmod(track_deg + 360.0, 360.0) * 100.0) : UINT16_MAX,
                                 .fix_type = FIX_3D,
                                 .satellites_visible = SATELLITES};
    mav_send(s, MAV_KIND(HIL_GPS), &m);
}

static void send_version(struct mav_station *s, int64_t t_ns)
{
    (void)t_ns;
    const mavlink_autopilot_version_t m = {.capabilities = MAV_PROTOCOL_CAPABILITY_MAVLINK2 |
                                                           MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE |
                                                           MAV_PROTOCOL_CAPABILITY_COMMAND_INT,
                                           .uid = s->sdo.node};
    mav_send(s, MAV_KIND(AUTOPILOT_VERSION), &m);
}

/* ---- rates */

static const struct {
    uint32_t id;
    enum { BY_TIME, BY_READING, ON_REQUEST } due;
    bool truth; /* only if the user asked for HIL messages */
    void (*send)(struct mav_station *s, int64_t t_ns);
} rows[MAV_STREAMS] = {
    [HEARTBEAT] = {MAVLINK_MSG_ID_HEARTBEAT, BY_TIME, false, send_heartbeat},
    [HIGHRES_IMU] = {MAVLINK_MSG_ID_HIGHRES_IMU, BY_READING, false, send_highres_imu},
    [ACCEL] = {MAVLINK_MSG_ID_PSABENCH_ACCEL, BY_READING, false, send_accel},
    [ATTITUDE] = {MAVLINK_MSG_ID_ATTITUDE, BY_TIME, false, send_attitude},
    [ANGLES] = {MAVLINK_MSG_ID_PSABENCH_ANGLES, BY_TIME, false, send_angles},
    [LINK] = {MAVLINK_MSG_ID_PSABENCH_LINK, BY_TIME, false, send_link},
    [HIL_SENSOR] = {MAVLINK_MSG_ID_HIL_SENSOR, BY_TIME, true, send_hil_sensor},
    [HIL_GPS] = {MAVLINK_MSG_ID_HIL_GPS, BY_TIME, true, send_hil_gps},
    [VERSION] = {MAVLINK_MSG_ID_AUTOPILOT_VERSION, ON_REQUEST, false, send_version},
};

static int64_t interval_ns(double hz)
{
    return hz > 0 ? (int64_t)nearbyint(1e9 / hz) : -1;
}

int64_t mav_stream_default_ns(const struct mav_station *s, unsigned stream)
{
    const struct mav_cfg *c = &s->cfg;
    switch (stream) {
    case HEARTBEAT:
    case LINK:
        return NS_PER_S;
    case HIGHRES_IMU:
        return interval_ns(c->imu_hz);
    case ACCEL:
        return 0;
    case ATTITUDE:
    case ANGLES:
        return interval_ns(c->angles_hz);
    case HIL_SENSOR:
        return interval_ns(c->hil_hz);
    case HIL_GPS:
        return c->hil_hz > 0 ? interval_ns(hil_gps_hz) : -1;
    default:
        return -1;
    }
}

unsigned mav_stream_find(uint32_t msgid)
{
    unsigned i = 0;
    while (i < MAV_STREAMS && rows[i].id != msgid) i++;
    return i;
}

static bool is_ready(const struct mav_station *s, unsigned stream)
{
    if (rows[stream].truth && !s->io.world) return false;
    if (stream == HIGHRES_IMU || stream == HIL_SENSOR) return s->has_reading && s->cfg.scale_index;
    return rows[stream].due != BY_READING || s->has_reading;
}

bool mav_stream_emit(struct mav_station *s, unsigned stream, int64_t t_ns)
{
    if (!is_ready(s, stream)) return false;
    rows[stream].send(s, t_ns);
    return true;
}

/* On a grid from the first one on, so that a rate is kept on average; one that is late starts a new grid. */
static bool is_due(struct mav_stream *m, int64_t t_ns)
{
    if (m->interval_ns < 0 || t_ns < m->next_ns) return false;
    m->next_ns += m->interval_ns;
    if (m->next_ns <= t_ns) m->next_ns = t_ns + m->interval_ns;
    return true;
}

static void arm_tick(struct mav_station *s)
{
    int64_t next_ns = SCHED_NEVER;
    for (unsigned i = 0; i < MAV_STREAMS; i++) {
        const struct mav_stream *m = &s->stream[i];
        if (rows[i].due == BY_TIME && m->interval_ns > 0 && m->next_ns < next_ns) next_ns = m->next_ns;
    }
    if (next_ns < SCHED_NEVER) sched_at(s->sched, &s->tick, next_ns);
    else sched_cancel(s->sched, &s->tick);
}

static void on_tick(void *ctx, int64_t t_ns)
{
    struct mav_station *s = ctx;
    for (unsigned i = 0; i < MAV_STREAMS; i++) {
        if (rows[i].due == BY_TIME && is_due(&s->stream[i], t_ns)) (void)mav_stream_emit(s, i, t_ns);
    }
    arm_tick(s);
}

bool mav_stream_set(struct mav_station *s, unsigned stream, int64_t interval, int64_t t_ns)
{
    if (rows[stream].due == ON_REQUEST || (rows[stream].truth && !s->io.world)) return false;
    if (stream == HEARTBEAT && interval <= 0) return false;
    if (rows[stream].due == BY_TIME && interval == 0) return false;
    s->stream[stream] = (struct mav_stream){.interval_ns = interval, .next_ns = t_ns + (interval > 0 ? interval : 0)};
    arm_tick(s);
    return true;
}

void mav_station_reading(struct mav_station *s, const struct mav_reading *r)
{
    s->reading = *r;
    s->has_reading = true;
    s->counters.readings++;
    s->counters.readings_lost += r->lost;
    for (unsigned k = 0; k < 3; k++)
        s->accel_mps2[k] = (r->volts[k] - s->cfg.zero_v[k]) / s->cfg.scale_v_per_g[k] * MAV_G_MPS2;
    for (unsigned i = 0; i < MAV_STREAMS; i++) {
        if (rows[i].due == BY_READING && is_due(&s->stream[i], r->t_ns)) (void)mav_stream_emit(s, i, r->t_ns);
    }
}

void mav_streams_open(struct mav_station *s)
{
    sched_ev(&s->tick, on_tick, s);
    for (unsigned i = 0; i < MAV_STREAMS; i++) {
        s->stream[i] = (struct mav_stream){.interval_ns = mav_stream_default_ns(s, i), .next_ns = s->sched->now_ns};
    }
    arm_tick(s);
}

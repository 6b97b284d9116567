/* A MAVLink system whose sensor is a unit on the CAN bus: what it sends, and what it answers (docs/tools/mavlink.md).
 *
 * It knows no transport: frames go out through send(), to every peer alike, and messages come in whole. Readings and readouts
 * are handed in or asked for through callbacks; it has no way to the truth but mav_io.world, which is NULL unless the user
 * asked for HIL messages. Times are simulated. Owned by its port, never moved, one thread. */
#ifndef PSABENCH_LINK_MAVLINK_MAV_STATION_H
#define PSABENCH_LINK_MAVLINK_MAV_STATION_H

#include "link/mavlink/mav_param.h"
#include "link/mavlink/mav_sdo.h"
#include "link/mavlink/mav_wire.h"

#define MAV_STREAMS    9u
#define MAV_PARAM_JOBS 32u
#define MAV_G_MPS2     9.80665 /* standard gravity */

struct mav_reading { /* of the board, from its frames */
    int64_t t_ns;    /* of the sample */
    int32_t code[3];
    double volts[3]; /* nominal */
    uint32_t lost;   /* readings missing before this one, by the board's own count */
    int16_t temp_code;
    uint8_t temp_channel, status; /* status: PSABENCH_STATUS */
};

struct mav_readouts { /* of the instruments, as an operator sees them */
    unsigned axes;    /* of the table */
    double table_deg[3], table_dps[3];
    bool head;
    double head_deg;
};

struct mav_world { /* truth, for HIL messages alone */
    double gyro_radps[3];
    double latitude_deg, longitude_deg, height_m;
    double north_mps, east_mps, down_mps;
};

struct mav_io {
    void *ctx;
    void (*send)(void *ctx, const uint8_t *frame, size_t n);
    void (*readouts)(void *ctx, struct mav_readouts *out, int64_t t_ns);
    void (*world)(void *ctx, struct mav_world *out, int64_t t_ns); /* NULL: no HIL messages */
    double (*value)(void *ctx, unsigned which, int64_t t_ns); /* of a parameter that is no object and not the link's */
};

struct mav_cfg {
    uint8_t sysid, compid, autopilot, type;
    double imu_hz, angles_hz, hil_hz; /* 0: not sent */
    int64_t epoch_ns;
    double zero_v[3], scale_v_per_g[3]; /* of objects 2210h and 2211h, their defaults */
    uint16_t zero_index, scale_index;   /* 2210h, 2211h; 0: the unit has none, and there is no acceleration */
    const struct mav_param *params;     /* those of the link first, MAV_OWN_PARAMS of them */
    unsigned param_count;
};

/* Parameters of the link itself, in this order; index of the others that are no objects: from MAV_OWN_PARAMS. */
enum { MAV_OWN_IMU_HZ, MAV_OWN_ANGLES_HZ, MAV_OWN_CODES_HZ, MAV_OWN_PARAMS };
extern const struct mav_param mav_own_params[MAV_OWN_PARAMS];

struct mav_stream {
    int64_t interval_ns; /* 0: with each reading; -1: off */
    int64_t next_ns;
};

enum mav_job_kind { MAV_JOB_READ, MAV_JOB_WRITE };
struct mav_job {
    enum mav_job_kind kind;
    unsigned param;
    double value; /* of a write */
};

struct mav_counters {
    uint32_t sent, readings, readings_lost, params_refused, jobs_dropped;
};

/* Read-only outside link/mavlink. */
struct mav_station {
    struct mav_cfg cfg;
    struct mav_io io;
    struct sched *sched;
    struct mav_sender sender;
    struct mav_sdo sdo;
    struct sched_ev tick;
    struct mav_stream stream[MAV_STREAMS];
    struct mav_reading reading; /* the latest */
    double accel_mps2[3];
    bool has_reading;
    /* parameter protocol */
    struct mav_job job[MAV_PARAM_JOBS];
    unsigned job_first, job_count;
    bool busy;                 /* job[job_first] is under way */
    unsigned list_at;          /* next parameter of a list; param_count: no list */
    uint16_t text_id;          /* of the latest long STATUSTEXT */
    struct can_msg write_seen; /* latest SDO request to the unit, of any host */
    struct mav_counters counters;
    uint32_t lost, malformed, received, peers; /* the port's, for PSABENCH_LINK */
};

/* sdo.hub and sdo.node are filled in by the caller. */
void mav_station_open(struct mav_station *s, const struct mav_cfg *cfg, const struct mav_io *io, struct sched *sched);
void mav_station_close(struct mav_station *s);

void mav_station_reading(struct mav_station *s, const struct mav_reading *r);
void mav_station_frame(struct mav_station *s, const struct can_msg *m, int64_t t_ns); /* every frame of the bus */
void mav_station_message(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns);
void mav_station_turn(struct mav_station *s, int64_t t_ns); /* of the loop */

/* ---- for the files of the station */

/* mav_send.c */
void mav_send(struct mav_station *s, struct mav_kind kind, const void *payload);
void mav_text_out(struct mav_station *s, uint8_t severity,
                  const char *text);                             /* STATUSTEXT, in chunks where it is long */
uint64_t mav_time_us(const struct mav_station *s, int64_t t_ns); /* epoch included */
bool mav_is_for_us(const struct mav_station *s, uint8_t sysid, uint8_t compid);

/* mav_streams.c */
void mav_streams_open(struct mav_station *s);

/* Position of a message among the streams; MAV_STREAMS: it is none. */
unsigned mav_stream_find(uint32_t msgid);
bool mav_stream_emit(struct mav_station *s, unsigned stream, int64_t t_ns); /* false: there is nothing to send yet */
bool mav_stream_set(struct mav_station *s, unsigned stream, int64_t interval_ns, int64_t t_ns); /* false: not allowed */
int64_t mav_stream_default_ns(const struct mav_station *s, unsigned stream);

/* mav_commands.c */
void mav_command_message(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns);

/* mav_params.c */
void mav_params_message(struct mav_station *s, const mavlink_message_t *m, int64_t t_ns);
void mav_params_turn(struct mav_station *s, int64_t t_ns);
void mav_params_answer(void *ctx, uint32_t abort, uint32_t raw, int64_t t_ns); /* mav_sdo.done */

#endif

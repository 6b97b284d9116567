/* libpsabench without a bench: sensors and motion for campaigns (docs/library.md). Errors and time as in psabench.h. */
#ifndef PSABENCH_MODELS_H
#define PSABENCH_MODELS_H

#include "psabench.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Quartz accelerometers of a production batch, without a board: run-in (docs/procedures/run_in.md) ---- */

enum { PSABENCH_QUARTZ_POSITIONS = 4, PSABENCH_QUARTZ_CYCLES_MAX = 100 };

/* Each unit in a chamber of -60 to +85 degC: as warm as read_degc, switched on, read; then cycles times: to cold_degc,
 * to hot_degc, soak_min at each, to read_degc, rest_min, switched on, read. Unit k is the accelerometer x of the serial
 * number k in scenario quartz_chamber. */
struct psabench_quartz_job {
    uint32_t size; /* of this struct, set by the caller */
    uint32_t cycles;
    uint64_t seed;
    uint32_t first_serial, units;
    double g_mps2, noise_a_rthz;
    double cold_degc, hot_degc, read_degc, ramp_k_per_min, soak_min, rest_min;
    double reading_s; /* of a position: mean of 64 looks */
    double play_k;    /* half the width of the hysteresis in temperature */
};

/* Readings, A: mean_a and sd_a, the standard deviation of the mean, have for each unit and start (cycles + 1 of them) the
 * positions with g along +x, -x, +y, -y. truth, for each unit and start: bias in millionths of g, scale in A for one g, tilt of
 * the input axis to y in mrad; NULL: none. batch: the numbers of proto/batches/serial.yaml in its order; NULL: those. The
 * same job gives the same numbers, however it is cut into ranges of serials. PSABENCH_BAD_ARGUMENT: a field out of range, a
 * temperature that the chamber has not, a batch that has no unit within its ratios. */
PSABENCH_API int psabench_quartz_run_in(const struct psabench_quartz_job *job, const double *batch, size_t numbers,
                                        double *mean_a, double *sd_a, double *truth);

/* ---- An aircraft's flight, without a unit (docs/procedures/flight.md) ---- */

enum { PSABENCH_FLIGHT_PARAMS = 11, PSABENCH_FLIGHT_LEG = 2 + PSABENCH_FLIGHT_PARAMS, PSABENCH_FLIGHT_STATE = 29 };

struct psabench_flight_job {
    uint32_t size, legs;     /* of this struct, set by the caller; number of legs */
    double place[3];         /* latitude, longitude, deg; height, m */
    double plan[4], baro[4]; /* keys of `flight` and `flight.baro` in their order in docs/scenarios.md */
    const double *leg;       /* rows: kind, value, parameters, NaN: the default */
};
typedef struct psabench_flight psabench_flight;

/* NULL, with the text in why: it cannot be flown. Kinds and parameters are numbered as psabench_flight_key() says: first kinds, then
 * parameters; NULL after the last. A flight may be asked by several threads. */
PSABENCH_API psabench_flight *psabench_flight_new(const struct psabench_flight_job *job, char *why, size_t cap);
PSABENCH_API void psabench_flight_free(psabench_flight *f);
PSABENCH_API const char *psabench_flight_key(unsigned number);
/* Beginning of a leg; legs: the end. */
PSABENCH_API int64_t psabench_flight_leg_ns(const psabench_flight *f, unsigned leg);
/* n rows: latitude, longitude, rad, height; velocity and acceleration east, north, up; heading, pitch, roll, rad; C_nb row by row, n
 * north, east, down, b ahead, right, down; specific force and rate in b; barometric height; gravity of the ellipsoid. */
PSABENCH_API int psabench_flight_states(const psabench_flight *f, const int64_t *t_ns, size_t n, double *out);
/* n rows: integrals of the rate, rad, and of the specific force, m/s, along b over intervals of up to 10 s. */
PSABENCH_API int psabench_flight_increments(const psabench_flight *f, int64_t from_ns, int64_t dt_ns, size_t n,
                                            double *out);

#ifdef __cplusplus
}
#endif
#endif

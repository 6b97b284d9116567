/* State of a PMKA board: included by board/pmka/pmka.h, read-only outside board/pmka*.c. */
#ifndef PSABENCH_BOARD_PMKA_STATE_H
#define PSABENCH_BOARD_PMKA_STATE_H

/* A specimen's own, beside its integrators. */
struct pmka_specimen {
    double uref_v, uref_tc_v_per_k; /* at 25 degC */
    double uc_v[PMKA_INTS][2];      /* comparators, by enum pmka_sign */
    double adc_offset_lsb, adc_gain;
    double temp_offset_k;
};

/* One integrator with its key, its reset and what was last taken of it. */
struct pmka_channel {
    struct pmka_int integrator;
    int axis;        /* connected; -1: ground */
    int said_axis;   /* as the controller believes */
    unsigned served; /* axis + 1 as it believes, since the last sample; 0: none */
    int64_t at_ns;   /* integrated up to here */
    int64_t cell_ns; /* end of the cell of the quadrature under way */
    bool resetting;
    enum pmka_sign sign;
    int64_t reset_from_ns, reset_until_ns;
    int8_t done;       /* reset of the period under way: 1, -1, 0 */
    uint32_t count[2]; /* resets since the start, by sign */
    struct sched_ev reset_end;
};

struct pmka_axis {
    int64_t at_ns;      /* pulled up to here */
    double integral_vs; /* truth: of the input since power-on */
};

enum pmka_stage { /* of a Ts, in order of time */
                  PMKA_AT_X,
                  PMKA_AT_Y,
                  PMKA_AT_Z,
                  PMKA_AT_RELEASE,
                  PMKA_AT_K,
                  PMKA_AT_TAKE,
                  PMKA_AT_READING
};

enum pmka_life { PMKA_OFF, PMKA_STARTING, PMKA_RUNNING };

struct pmka_rotation {
    enum pmka_mode mode;
    unsigned tau;       /* beat; 0: none yet */
    unsigned age;       /* readings since the hand-over */
    enum pmka_cal cal;  /* of the period under way */
    unsigned asked_tau; /* by program; 0: stay */
    enum pmka_cal asked_cal;
    unsigned beat_periods, zero_periods; /* autonomous */
};

struct pmka_bus {
    struct board_cycle *cycle;
    uint16_t answer;
    struct sched_ev end;
    uint16_t index;
    bool fresh, overrun; /* a reading waits; one was not read in time */
};

struct pmka {
    struct board base;
    struct pmka_profile profile;
    struct pmka_host host; /* set by the receiver */
    struct pmka_specimen specimen;
    uint16_t rom[PMKA_ROM_WORDS];
    struct draws adc_noise, temp_noise;
    bool adc_stuck, adc_stuck_level;
    struct pmka_counters counters;

    enum pmka_life life;
    bool unpowered; /* the lines lie low since a power-down */
    struct pmka_channel channel[PMKA_INTS];
    struct pmka_axis axis[BOARD_AXES];
    double board_degc, uref_v; /* refreshed each Ts */
    struct pmka_rotation rotation;
    struct pmka_bus bus;
    enum pmka_stage stage;
    int64_t set_ns; /* X of the present Ts is sampled */
    struct sched_ev step;
    struct pmka_reading next, latest; /* being taken; complete */
    bool any;                         /* a reading is there */
    struct trace_reals reals;         /* output voltages, by integrator */
    /* converter, for the trace */
    int64_t sampled_ns; /* last */
    struct sched_ev conversion;
};

#endif

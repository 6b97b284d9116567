/* State of the board: included by board/pik/pik.h, read-only outside the board's files. */
#ifndef PSABENCH_BOARD_PIK_STATE_H
#define PSABENCH_BOARD_PIK_STATE_H

/* What a specimen differs by from its profile: relative errors in ppm at 25 degC and per K. */
struct pik_specimen {
    double uref_ppm, uref_tc, clock_ppm;
    double ratio_ppm[PIK_AXES], ratio_tc[PIK_AXES], asymmetry_ppm[PIK_AXES], c_pct[PIK_AXES];
    double zero_v[PIK_AXES], zero_tc[PIK_AXES];
};

struct pik_channel {
    struct pik_axis axis;
    struct draws noise;
    double due_vs;                  /* of the input, that no tick has got yet */
    double slope_v_per_s;           /* of the input, when it was last taken */
    double noise_v;                 /* until the next look */
    struct pik_drive drive;         /* for no input, at this temperature */
    double per_volt;                /* charge of a tick for a volt */
    double zero_v;                  /* drift, at this temperature */
    double lost_per_volt;           /* charge that a reset loses because it takes the input off */
    uint64_t plus_from, minus_from; /* the counters: this beside the converter's pulses; all, while the pin is stuck */
    bool stuck, stuck_level;
    int64_t shown_tick;                                   /* begin of the last pulse that the trace has */
    bool saturated;                                       /* since the reading before */
    uint32_t plus, minus, saturated_looks, opposed, lost; /* counters, as of the last look */
};

struct pik {
    struct board base;
    struct pik_profile profile;
    struct pik_host host; /* set by the receiver */
    struct pik_specimen specimen;
    struct pik_channel channel[PIK_AXES];
    struct pik_counters counters;
    bool on;
    int32_t clock_fault_ppm;
    /* time: tick first_tick lies at edge 0 of clk */
    struct clk clk;
    int64_t first_tick;
    int64_t look_tick; /* next */
    int64_t fed_ns;    /* up to which the inputs have been taken */
    int64_t warm_ns;   /* of the next look at the temperature */
    int64_t heard_ns;  /* since when io.event has a subscriber */
    double degc;
    double k_hz_per_v, noise_v; /* nominal; rms of the mean from look to look */
    struct sched_ev look, latch, latch_end, cycle_end;
    /* saturation as notified */
    bool saturated;
    int64_t saturated_ns;
    /* registers */
    struct pik_reading latched;
    bool any; /* latched since power-up or reset */
    unsigned period_100us;
    struct board_cycle *cycle; /* under way */
    int64_t clk_shown_tick;    /* next rise of CLK that the trace has not got */
};

#endif

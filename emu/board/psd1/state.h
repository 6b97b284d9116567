/* State of a PSD-1 board: included by board/psd1/psd1.h, read-only outside board/psd1*.c. */
#ifndef PSABENCH_BOARD_PSD1_STATE_H
#define PSABENCH_BOARD_PSD1_STATE_H

#include "board/board.h"
#include "board/psd1/wave.h"

struct psd1;

/* What the controller does at its next event. */
enum psd1_phase {
    PSD1_OFF,
    PSD1_IN_RESET, /* the first control word is due */
    PSD1_IDLE,     /* nothing is due: DR, a flag or a command is awaited */
    PSD1_START,    /* A0 rises */
    PSD1_RF_FALL,
    PSD1_RF_RISE,
    PSD1_READY,      /* FL2 is active; the built-in host's strobe is due, or nothing */
    PSD1_STROBE_END, /* of the built-in host */
    PSD1_CLEAR,      /* FL2 ends */
    /* control words and coefficients */
    PSD1_TFS_FALL,
    PSD1_TFS_RISE,
    PSD1_AWAIT_DR, /* DR is not looked at before */
    PSD1_COEF_A0,
    PSD1_COEF_FALL,
    PSD1_COEF_RISE,
    PSD1_PHASES
};

/* A strobe on the bus. */
struct psd1_strobe {
    bool busy;
    bool takes;                          /* it reads the word that waits */
    struct board_cycle *cycle, *waiting; /* under way (NULL: the built-in host's, or rejected), waits for its end */
    int64_t end_ns;
    struct sched_ev ev; /* its end, but for the built-in host's */
};

struct psd1_job_step;

/* A row of operations between cycles. */
struct psd1_job {
    const struct psd1_job_step *at; /* NULL: none */
    struct psd1_request *request;   /* under way or waiting; NULL: none, or the set-up's */
    struct psd1_request own;        /* of register COMMAND */
    bool waits;                     /* for the end of the cycle */
    unsigned axis;                  /* that is being read */
    bool data_first;                /* its word is read, that its control word can be */
    int64_t word_ns;                /* when that was over */
    bool failed;                    /* the latest of register COMMAND */
    struct sched_ev ev;             /* its timeout while it waits for the cycle */
};

struct psd1_gyro {                     /* one laser gyro and its rate sensor */
    double bias_radps, scale, arw_rad; /* of a step of its random walk */
    double rate_offset_radps, rate_scale;
    double angle_rad; /* up to psd1_gyros.t_ns */
    double w_radps;   /* then */
    struct draws noise;
};

struct psd1_gyros {
    struct psd1_gyro axis[3];
    int64_t t_ns;    /* integrated up to here */
    int64_t grid_ns; /* next point of the grid */
    uint32_t points; /* of the grid, so far */
    bool stale;      /* the rate has changed abruptly: look again */
};

struct psd1_port { /* which converter a callback came from */
    struct psd1 *b;
    unsigned axis;
};

struct psd1 {
    struct board base;
    struct psd1_profile profile;
    struct psd1_host host; /* set by the receiver */
    struct ad7712 adc[3];
    struct psd1_port port[3];
    /* specimen */
    double vref_error, vref_tc_per_k, temp_offset_k[4], supply_v;
    double vref_scale, per_vref; /* of the reference at the board's temperature; its inverse */
    double board_degc;           /* refreshed at each DR */
    struct psd1_counters counters;

    int64_t t0_ns; /* power-up: 1M25 rises at t0 + 800 k */
    enum psd1_phase phase;
    int64_t due_ns; /* of the phase; SCHED_NEVER */
    struct sched_ev ev;
    bool stepping;       /* inside the event: it arms itself */
    bool ready;          /* the set-up has been carried out */
    bool int0, fl1, fl2; /* active */
    bool drdy[3], dr;    /* levels */
    int64_t dr_ns;       /* latest fall of DR */
    struct psd1_rk rk;
    struct psd1_frame frame;
    struct psd1_wave wave;
    struct psd1_strobe bus;
    struct psd1_job job;
    struct psd1_gyros gyros;
    /* cycle */
    unsigned axis;
    int64_t fl2_ns; /* it was set */
    bool taken;     /* the word that waited has been read */
    uint32_t seq;
    uint32_t conversions; /* of all converters, when the cycle began */
    uint32_t lost;        /* lost, counted in the same way */
    struct psd1_cycle now, latest;
    /* control words and what else registers hold */
    uint32_t uc1, uc2, staged;
    uint32_t zero[3], full[3]; /* coefficients as read after the latest calibration */
    bool coef_known;
    uint8_t last_command, temp_channel, service_channel;
    /* timeout of DR */
    int64_t timeout_ns;
    bool fault_notified;
    struct sched_ev timeout;
};

#endif

/* State of a PSA-2 board: included by board/psa2/psa2.h, read-only outside board/psa2*.c and unit/unit.c. */
#ifndef PSABENCH_BOARD_PSA2_STATE_H
#define PSABENCH_BOARD_PSA2_STATE_H

struct psa2;

#define PSA2_XFER_MAX 8u

/* One burst on the serial port. Bytes are MSB first; gap_ns[i] is the least time from the last sampling edge of byte i to
 * the first edge of byte i + 1 (after the last byte: to the next burst for the same chips). */
struct psa2_xfer {
    enum psa2_group group;
    uint8_t count;
    bool zeros; /* a read: nothing but zeros to the accelerometers' converters, byte after byte */
    uint8_t tx[PSA2_XFER_MAX];
    int32_t gap_ns[PSA2_XFER_MAX];
    void (*done)(struct psa2 *b, int64_t t_ns); /* SClk rests (accelerometers), CST high again (temperature) */
};

enum psa2_spi_phase {
    PSA2_SPI_IDLE,
    PSA2_SPI_FIRST,
    PSA2_SPI_SAMPLE_A,
    PSA2_SPI_SAMPLE_T,
    PSA2_SPI_REST,
    PSA2_SPI_CST_UP
};

/* What the instants of a burst depend on beside its start. */
struct psa2_spi_past {
    struct clk_pos first; /* rising edge of the byte under way or last */
    int64_t ready_ns[2];  /* per group: gap after its last burst is over */
};

/* Serial port engine: SClk edges from a count of half periods, two instants a byte. */
struct psa2_spi {
    struct clk half;                                /* edge k: rising for even k, falling for odd */
    struct clk_step one, back, period;              /* half periods: 1, -1, 2 */
    struct clk_step fall, sample_a, sample_t, byte; /* from the first rising edge of a byte to others */
    struct clk_step read;                           /* from there to the end of a read */
    struct psa2_xfer x;
    uint8_t rx[4][PSA2_XFER_MAX]; /* X, Y, Z, T */
    enum psa2_spi_phase phase;
    uint8_t at; /* byte under way */
    struct psa2_spi_past past;
    int64_t due_ns; /* of the phase */
    bool stepping;  /* inside the event: it arms itself when it can go no further */
    struct sched_ev ev;
};

enum psa2_mode { PSA2_OFF, PSA2_IN_RESET, PSA2_SETUP, PSA2_RUN };

/* A pulse on SYNC_A (up and down) or SYNC_T (down and up). */
struct psa2_pulse {
    bool busy, active; /* active: the pin is away from its idle level */
    bool skipped;      /* a fault: the pin does not move */
    enum psa2_group group;
    void (*done)(struct psa2 *b, int64_t t_ns);
    struct sched_ev ev;
};

enum psa2_scan { PSA2_SCAN_MUX, PSA2_SCAN_SYNC, PSA2_SCAN_WAIT, PSA2_SCAN_READ };

/* Temperature scan: MUX write, SYNC_T pulse, DRD_T, read. */
struct psa2_temp {
    enum psa2_scan stage;
    uint8_t channel; /* being converted */
    bool hold;       /* a request went to the converter: wait for DRD_T before anything else */
    bool fresh;      /* new code since the previous frame */
    bool fault_notified;
    uint8_t code_channel; /* of code */
    uint16_t code;
    struct sched_ev timeout;
};

/* Output line: the frame under way. */
struct psa2_out {
    struct clk half;                      /* edge k: falling CLK for even k, rising for odd */
    struct clk_step one, frame;           /* a half period; INT low */
    struct clk_step lead, bits, word_gap; /* before the first word; a word without and with the gap after it */
    struct clk_pos start;                 /* INT falls */
    struct clk_pos at;                    /* watched: the word that is reported next begins */
    bool busy;
    int watched_words; /* words reported to the trace; -1: INT fall not yet reported */
    struct psa2_frame f;
    struct sched_ev rise, word, fall; /* fall: only while observed */
};

/* Accelerometer side: what DRD_A brought and what is being read. */
struct psa2_sample {
    bool due, reading, overrun;
    uint32_t due_seq, seq; /* seq: of the word being read */
    unsigned unsettled;    /* words still to come that mix two settings of CONFIG1 */
    int64_t due_ns, t_ns;
};

struct psa2_port { /* which converter a callback came from */
    struct psa2 *b;
    unsigned axis;
};

struct psa2 {
    struct board base;
    struct psa2_profile profile;
    struct psa2_host host; /* set by the receiver */
    uint64_t idle_lines;   /* levels at rest */
    struct ads1282 adc[3];
    struct ads1256 tadc;
    struct psa2_port port[3];
    double board_degc;   /* refreshed at each DRD_A */
    uint32_t open_temps; /* bit n: the lead of temperature sensor n is open; outlives resets and power */
    struct psa2_counters counters;

    enum psa2_mode mode;
    bool unpowered; /* the lines are low since a power-down */
    unsigned step;  /* of the set-up */
    bool reversed;  /* the present set-up runs in reverse order */
    struct psa2_spi spi;
    struct psa2_xfer read; /* of the three codes */
    struct psa2_pulse pulse;
    struct psa2_temp temp;
    struct psa2_out out;
    struct psa2_sample sample;
    struct psa2_lazy lazy;
    void (*idle)(struct psa2 *b, int64_t t_ns); /* the controller: a transfer or a pulse has ended */
    struct sched_ev res_up, timeout;
    bool fault_notified; /* no DRD_A has come since the fault */
    bool drd_a_seen;
    int64_t drd_a_ns;   /* last fall */
    int64_t period_ns;  /* of DRD_A as CONFIG0 is */
    int64_t timeout_ns; /* no DRD_A until then is a fault; `timeout` may be due earlier and then waits on */
    uint32_t seq;       /* of the next DRD_A */
    struct psa2_request *request;
    struct psa2_frame latest; /* last complete reading, whether it was sent or not; t_int_* as sent last */
};

#endif

#include "fault/args.h"

#define TIME_MAX_S 1e6

static const char *const levels[] = {"low", "high", NULL};

// clang-format off
const struct control_arg fault_args[FAULT_ARGS + 1] = {
    [FAULT_KIND] = {"kind", CONTROL_NAME, .what = "what goes wrong: a name of fault.kinds"},
    [FAULT_POINT] = {"point", CONTROL_NAME, .what = "where: a name of fault.points"},
    [FAULT_AT_S] = {"at_s", CONTROL_REAL, true, "s", 0, TIME_MAX_S, .what = "simulated instant; without it: now. With after: events count from then on"},
    [FAULT_AFTER] = {"after", CONTROL_EVENT, true, .what = "event of a board that brings it about, one that this board has"},
    [FAULT_COUNT] = {"count", CONTROL_COUNT, true, NULL, 1, 1e9, .what = "which of these events; without it the first"},
    [FAULT_SINCE] = {"since", CONTROL_EVENT, true, .what = "event that starts the count again"},
    [FAULT_UNIT] = {"unit", CONTROL_UNIT, true, .what = "whose events; without it those of the point's unit"},
    [FAULT_DELAY_S] = {"delay_s", CONTROL_REAL, true, "s", 0, 1000, .what = "from the event to the fault"},
    [FAULT_FOR_S] = {"for_s", CONTROL_REAL, true, "s", 0, TIME_MAX_S, .what = "how long it lasts; 0 or without it: until fault.clear"},
    [FAULT_OUT_V] = {"out_v", CONTROL_REAL, true, "V", -15, 15, .what = "output of the sensor (one with current output: at its load)"},
    [FAULT_BIAS_V] = {"bias_v", CONTROL_REAL, true, "V", -15, 15, .what = "added to the output of the sensor", .least = FAULT_LEAST_V},
    [FAULT_DRIFT_V_PER_S] = {"drift_v_per_s", CONTROL_REAL, true, "V/s", -1000, 1000, .what = "by which the output of the sensor grows", .least = FAULT_LEAST_V},
    [FAULT_SCALE_PPM] = {"scale_ppm", CONTROL_REAL, true, "ppm", -1e7, 1e7, .what = "error of the sensor's scale factor; -1000000: deaf", .least = FAULT_LEAST_PPM},
    [FAULT_RMS_V] = {"rms_v", CONTROL_REAL, true, "V", FAULT_LEAST_V, 10, .what = "noise of a settled reading at 1000 SPS"},
    [FAULT_LOW_V] = {"low_v", CONTROL_REAL, true, "V", -15, 15, .what = "least output of the sensor"},
    [FAULT_HIGH_V] = {"high_v", CONTROL_REAL, true, "V", -15, 15, .what = "greatest output of the sensor"},
    [FAULT_REFERENCE_PPM] = {"reference_ppm", CONTROL_REAL, true, "ppm", -500000, 1e6, .what = "error of the converter's reference", .least = FAULT_LEAST_PPM},
    [FAULT_DRIFT_PPM_PER_S] = {"drift_ppm_per_s", CONTROL_REAL, true, "ppm/s", FAULT_LEAST_PPM, 1e6, .what = "by which that error grows"},
    [FAULT_AMPLITUDE_V] = {"amplitude_v", CONTROL_REAL, true, "V", FAULT_LEAST_V, 10, .what = "of the ripple at the load"},
    [FAULT_FREQUENCY_HZ] = {"frequency_hz", CONTROL_REAL, true, "Hz", 0.1, 100, .what = "of the ripple; more would not pass the filter at 250 SPS"},
    [FAULT_LEVEL] = {"level", CONTROL_CHOICE, true, .what = "at which it stays", .choices = levels},
    [FAULT_REGISTER] = {"register", CONTROL_COUNT, true, NULL, 0, 255, .what = "number of the register in the chip"},
    [FAULT_MASK] = {"mask", CONTROL_COUNT, true, NULL, 1, 255, .what = "bits that are inverted"},
    [FAULT_CLOCK_PPM] = {"clock_ppm", CONTROL_REAL, true, "ppm", -FAULT_PPM_MAX, FAULT_PPM_MAX, .what = "error of the chip's clock; negative: slow"},
    [FAULT_WIDTH_NS] = {"width_ns", CONTROL_COUNT, true, "ns", 1, 1e9, .what = "of the pulse"},
    [FAULT_PULSE] = {"pulse", CONTROL_COUNT, true, NULL, 1, 128, .what = "number of the pulse in the frame, from 1"},
    [FAULT_RATE_HZ] = {"rate_hz", CONTROL_REAL, true, "Hz", 0.001, 1e6, .what = "pulses a second, on average"},
    [FAULT_PROBABILITY] = {"probability", CONTROL_REAL, true, NULL, 1e-6, 1, .what = "that a frame is hit; without it 1"},
    [FAULT_FRAMES] = {"frames", CONTROL_COUNT, true, NULL, 1, 1e9, .what = "that are hit, then no more; without it all"},
    [FAULT_ID] = {"can_id", CONTROL_COUNT, true, NULL, 0, 536870911, .what = "identifier of the frames; without it any"},
    [FAULT_ID_MASK] = {"can_id_mask", CONTROL_COUNT, true, NULL, 0, 536870911, .what = "bits of the identifier that are compared; without it all"},
    [FAULT_HOLD_S] = {"hold_s", CONTROL_REAL, true, "s", 0, 10, .what = "by which a frame is held back"},
    [FAULT_DROP_V] = {"drop_v", CONTROL_REAL, true, "V", 1e-3, 100, .what = "by which the supply falls"},
    [FAULT_DRIFT_DEGPH] = {"drift_degph", CONTROL_REAL, true, "deg/h", -1000, 1000, .what = "of the gyroscope, more than it had", .least = 1e-3},
};
// clang-format on
_Static_assert(FAULT_ARGS <= CONTROL_ARGS_MAX, "all values of a command fit");

"""Hosts on the line that are broken on purpose: replacements in docs/examples/host_line.c."""

from __future__ import annotations

from broken_hosts import BrokenHost

L = "host_line.c"
BROKEN_LINES = (
    BrokenHost(
        "falling_clk",
        "!(b & INT) && ~last & b & CLK",
        "!(b & INT) && last & ~b & CLK",
        "line_narrow",
        "HOST-LINE-02",
        L,
    ),
    BrokenHost(
        "bits_reversed",
        "word[bits / word_bits] >> 1 | (b & DATA ? 1U << 31 : 0)",
        "word[bits / word_bits] << 1 | (b & DATA ? 1U : 0)",
        "line_good",
        "HOST-LINE-03",
        L,
    ),
    BrokenHost(
        "no_sign",
        "(int32_t)word[0] / last, (int32_t)word[1] / last",
        "(int32_t)(word[0] & 0xFFFFFF), (int32_t)(word[1] & 0xFFFFFF)",
        "line_good",
        "HOST-LINE-04",
        L,
    ),
    BrokenHost("channel_of_status", "t >> 16 & 15, status", "t >> 20 & 15, status", "line_good", "HOST-LINE-05", L),
    BrokenHost("times_of_rise", "(double)fall / 8", "(double)(now - fall) / 8", "line_slow", "HOST-LINE-06", L),
    BrokenHost(
        "half_frames",
        "int64_t now, fall, before,",
        "int64_t now, fall = 1, before,",
        "line_under_way",
        "HOST-LINE-07",
        L,
        also=("code_bits = 24, bits, listening,", "code_bits = 24, bits, listening = 1,"),
    ),
    BrokenHost(
        "few_bits_taken",
        "bits == 4 * word_bits && whole()",
        "bits >= 4 * word_bits - 1",
        "line_missing",
        "HOST-TORN-01",
        L,
    ),
    BrokenHost(
        "many_bits_taken", "bits == 4 * word_bits && whole()", "bits >= 4 * word_bits", "line_extra", "HOST-TORN-02", L
    ),
    BrokenHost(
        "pauses_unseen", "bits == 4 * word_bits && whole()", "bits == 4 * word_bits", "line_pauses", "HOST-TORN-03", L
    ),
    BrokenHost("empty_unseen", "if (!bits && now - fall < GLITCH)", "if (!bits)", "line_cut", "HOST-TORN-04", L),
    BrokenHost(
        "glitch_is_a_frame",
        "if (!bits && now - fall < GLITCH) return;",
        "if (!bits) { word[3] = 1U << 20, on_frame(); return; }",
        "line_glitch",
        "HOST-TORN-05",
        L,
    ),
    BrokenHost("losses_untold", "if (steps > 1) TELL", "if (steps > 2) TELL", "line_lost", "HOST-LOST-01", L),
    BrokenHost("silence_untold", "STALE = 250 * PERIOD", "STALE = 800 * PERIOD", "line_silence", "HOST-STALE-01", L),
    BrokenHost("half_times", "(double)fall / 8", "(double)fall / 16", "line_good", "HOST-LINE-01", L),
    BrokenHost("torn_untold", '    else TELL("torn", "%d", 1);\n', "", "line_missing", "HOST-TORN-01", L),
    BrokenHost("frozen_untold", "(same >= 999)", "(same >= 9999)", "line_frozen", "HOST-STALE-02", L),
    BrokenHost("positive_limit", "c[i] >= most", "c[i] > most", "line_over", "HOST-RANGE-01", L),
    BrokenHost(
        "unsettled_taken", "if (!(status & 1)) return; /* not settled */", "", "line_status", "HOST-SETTLE-01", L
    ),
    BrokenHost("overrun_untold", "if (status & 4) TELL", "if (status & 2) TELL", "line_status", "HOST-OVER-01", L),
)

// Hand-written driver of psd1.v under Verilator: the peer of PSD-1 in `make bench`. No simulated time: it steps from edge to
// edge, plays the host, counts what changes, and nothing else.
// Usage: psd1_drive WORDS CYCLES [clock] [check]. The clock stands still between cycles unless `clock` says that it runs all
// the 1216 periods of a conversion. Prints "frames N checksum H edges E ns T"; with check the number and instants of the edges
// of each line as bench_psd1_words does.
#include "Vpsd1.h"
#include "verilated.h"

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <vector>

namespace
{

enum { A0 = 0, FL2 = 3, DR = 4, SCLK = 9, SDAT = 10, CLK = 11, CS = 12, AB = 14, D = 18, LINES = 34 };
constexpr int PERIODS = 1216; // of the clock, a conversion
constexpr uint64_t ONE = 1;

struct Row {
    unsigned x, y, z;
};

// What a logic analyser and the host make of the lines.
template <bool check> class Watcher
{
  public:
    explicit Watcher(uint64_t lines) : before_(lines)
    {
    }

    void see(uint64_t lines)
    {
        const uint64_t changed = lines ^ before_;
        before_ = lines;
        edges_ += static_cast<uint64_t>(__builtin_popcountll(changed));
        if (check) account(lines, changed);
    }

    // As bench_psd1_words: in edges of the clock since A0 rose; of SDAT and DR, which are late by less, in those of SCLK.
    void account(uint64_t lines, uint64_t changed)
    {
        if (changed & lines & ONE << A0) halves_ = sclks_ = 0;
        else halves_ += changed >> CLK & 1;
        sclks_ += changed >> SCLK & 1;
        for (int i = 0; i < LINES; i++) {
            if (!(changed >> i & 1)) continue;
            line_[i]++;
            when_[i] += i == SDAT || i == DR ? sclks_ : halves_;
        }
    }

    uint64_t edges_ = 0, line_[LINES] = {}, when_[LINES] = {}, halves_ = 0, sclks_ = 96, before_;
    uint32_t sum_ = 0;
};

std::vector<Row> read_rows(const char *path)
{
    std::vector<Row> rows;
    FILE *in = std::fopen(path, "r");
    if (!in) {
        std::perror(path);
        std::exit(2);
    }
    for (Row r; std::fscanf(in, "%x %x %x", &r.x, &r.y, &r.z) == 3;) rows.push_back(r);
    std::fclose(in);
    if (rows.empty()) std::exit(2);
    return rows;
}

// The host: a strobe of one period from 600 ns after the first rise of the clock that finds FL2 high.
template <bool check> class Host
{
  public:
    void after_fall(Vpsd1 &top, Watcher<check> &w)
    {
        if (!top.cs_n) {
            w.sum_ = w.sum_ * 31 + static_cast<uint32_t>(top.lines >> D & 0xFFFF);
            top.cs_n = 1;
            top.ab = 0;
            axis_ = axis_ == 2 ? 0 : axis_ + 1;
            done_ = true;
        } else if (!(top.lines >> FL2 & 1)) {
            waited_ = done_ = false;
            return;
        } else if (done_ || !waited_) {
            waited_ = true;
            return;
        } else {
            top.cs_n = 0;
            top.ab = axis_;
        }
        top.eval();
        w.see(top.lines);
    }

  private:
    uint8_t axis_ = 0;
    bool waited_ = false, done_ = false;
};

template <bool check> void period(Vpsd1 &top, Watcher<check> &w, Host<check> &host)
{
    top.clk = 1;
    top.eval();
    w.see(top.lines);
    const bool on = top.lines & ONE << A0;
    if (on) {
        top.clk_3_8 = 1;
        top.eval();
        w.see(top.lines);
    }
    top.clk = 0;
    top.eval();
    w.see(top.lines);
    if (!on) return;
    host.after_fall(top, w);
    top.clk_3_8 = 0;
    top.eval();
    w.see(top.lines);
}

template <bool check> void cycle(Vpsd1 &top, Watcher<check> &w, Host<check> &host, const Row &r, bool clock)
{
    top.word_x = static_cast<uint16_t>(r.x);
    top.word_y = static_cast<uint16_t>(r.y);
    top.word_z = static_cast<uint16_t>(r.z);
    top.update = 1;
    top.eval();
    top.update = 0;
    top.eval();
    w.see(top.lines);
    int n = 0;
    do {
        period(top, w, host);
        n++;
    } while (top.lines & ONE << A0);
    for (; clock && n < PERIODS; n++) period(top, w, host);
}

int64_t cpu_ns()
{
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return int64_t{t.tv_sec} * 1000000000 + t.tv_nsec;
}

template <bool check> void run(Vpsd1 &top, const std::vector<Row> &rows, uint64_t cycles, bool clock)
{
    top.int0 = 1;
    top.cs_n = top.rw = 1;
    top.eval();
    Watcher<check> w(top.lines);
    Host<check> host;
    const int64_t began_ns = cpu_ns();
    for (uint64_t n = 0, at = 0; n < cycles; n++) {
        cycle(top, w, host, rows[at], clock);
        if (++at == rows.size()) at = 0;
    }
    const int64_t took_ns = cpu_ns() - began_ns;
    std::printf("frames %llu checksum %08x edges %llu ns %lld\n", static_cast<unsigned long long>(cycles), w.sum_,
                static_cast<unsigned long long>(w.edges_), static_cast<long long>(took_ns));
    for (int i = 0; check && i < LINES; i++)
        std::printf("line %d edges %llu when %llu\n", i, static_cast<unsigned long long>(w.line_[i]),
                    static_cast<unsigned long long>(w.when_[i]));
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 3) return 2;
    const std::vector<Row> rows = read_rows(argv[1]);
    const uint64_t cycles = std::strtoull(argv[2], nullptr, 10);
    bool clock = false, check = false;
    for (int i = 3; i < argc; i++) {
        clock |= std::strcmp(argv[i], "clock") == 0;
        check |= std::strcmp(argv[i], "check") == 0;
    }
    VerilatedContext context;
    Vpsd1 top(&context);
    if (check) run<true>(top, rows, cycles, clock);
    else run<false>(top, rows, cycles, clock);
    top.final();
    return 0;
}

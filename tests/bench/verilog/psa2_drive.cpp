// Hand-written driver of psa2.v under Verilator: the peer of `make bench`. No simulated time and no idle clock at all: it
// steps from edge to edge, counts what changes and hands the next words over, and nothing else.
// Usage: psa2_drive WORDS FRAMES [check]. Prints "frames N checksum H edges E ns T"; with check the number and instants of
// the edges of each line as bench_words does.
#include "Vpsa2.h"
#include "verilated.h"

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

namespace
{

enum { SCLK, DRD_A, DIN, DOUTX, DOUTY, DOUTZ, DATA, CLK, INT, LINES };
constexpr int SPI_CLKS = 26, LINE_CLKS = 149; // one to start, the 24 of a read, one that ends it; the 148 of a frame

struct Row {
    uint32_t x, y, z, t;
};

// What a logic analyser and the receiver of the frame make of the lines.
template <bool check> class Watcher
{
  public:
    explicit Watcher(uint32_t lines) : before_(lines)
    {
    }

    void see(uint32_t lines)
    {
        const uint32_t changed = lines ^ before_;
        before_ = lines;
        edges_ += static_cast<uint64_t>(__builtin_popcount(changed));
        if (check) account(lines, changed);
    }

    // One more half period of line_clk.
    void tick()
    {
        if (check) halves_++;
    }

    // After a rise of line_clk, the only time a bit can be taken.
    void take(uint32_t lines)
    {
        if (!(lines >> CLK & 1)) return;
        word_ = word_ >> 1 | (lines >> DATA & 1) << 31;
        if (++bits_ % 32 == 0) sum_ = sum_ * 31 + word_;
    }

    void account(uint32_t lines, uint32_t changed)
    {
        if (changed & ~lines & 1 << INT) halves_ = 0;
        if (changed & ~lines & 1 << DRD_A) sclk_levels_ = 0;
        sclk_levels_ += changed >> SCLK & 1;
        for (int i = 0; i < LINES; i++) {
            if (!(changed >> i & 1)) continue;
            line_[i]++;
            if (i >= DATA) when_[i] += halves_;
            else if (i >= DOUTX) when_[i] += sclk_levels_;
        }
    }

    uint64_t edges_ = 0, line_[LINES] = {}, when_[LINES] = {}, halves_ = 0, sclk_levels_ = 0;
    uint32_t before_, word_ = 0, bits_ = 0, sum_ = 0;
};

std::vector<Row> read_rows(const char *path)
{
    std::vector<Row> rows;
    FILE *in = std::fopen(path, "r");
    if (!in) {
        std::perror(path);
        std::exit(2);
    }
    for (Row r; std::fscanf(in, "%x %x %x %x", &r.x, &r.y, &r.z, &r.t) == 4;) rows.push_back(r);
    std::fclose(in);
    if (rows.empty()) std::exit(2);
    return rows;
}

template <bool check> void frame(Vpsa2 &top, Watcher<check> &w, const Row &r)
{
    top.word_x = r.x;
    top.word_y = r.y;
    top.word_z = r.z;
    top.word_t = r.t;
    top.conv = 1;
    top.eval();
    w.see(top.lines);
    for (int i = 0; i < SPI_CLKS; i++) {
        top.conv = 0;
        top.spi_clk = 1;
        top.eval();
        w.see(top.lines);
        top.spi_clk = 0;
        top.eval();
        w.see(top.lines);
    }
    for (int i = 0; i < LINE_CLKS; i++) {
        top.line_clk = 1;
        top.eval();
        w.tick();
        w.see(top.lines);
        w.take(top.lines);
        top.line_clk = 0;
        top.eval();
        w.tick();
        w.see(top.lines);
    }
}

int64_t cpu_ns()
{
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return int64_t{t.tv_sec} * 1000000000 + t.tv_nsec;
}

template <bool check> void run(Vpsa2 &top, const std::vector<Row> &rows, uint64_t frames)
{
    top.eval();
    Watcher<check> w(top.lines);
    const int64_t began_ns = cpu_ns();
    for (uint64_t n = 0, at = 0; n < frames; n++) {
        frame(top, w, rows[at]);
        if (++at == rows.size()) at = 0;
    }
    const int64_t took_ns = cpu_ns() - began_ns;
    std::printf("frames %llu checksum %08x edges %llu ns %lld\n", static_cast<unsigned long long>(frames), w.sum_,
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
    const uint64_t frames = std::strtoull(argv[2], nullptr, 10);
    VerilatedContext context;
    Vpsa2 top(&context);
    if (argc > 3) run<true>(top, rows, frames);
    else run<false>(top, rows, frames);
    top.final();
    return 0;
}

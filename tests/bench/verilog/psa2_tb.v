// Test bench of psa2.v with the board's real times: a frame a millisecond, the clocks run only while something is to be done.
// Prints frames and checksum and, with CHECK, number and instants of the edges of each line as bench_words does. For Icarus and for Verilator --timing.
`timescale 1ns / 1ps
module psa2_tb;
    parameter CHECK = 0;
    parameter ROWS = 512;  // of the input file: words X, Y, Z, T of a frame on a line

    localparam real SPI_HALF_NS = 488.28125, LINE_HALF_NS = 250.0, PERIOD_NS = 1000000.0;
    localparam real REST_NS = PERIOD_NS - 52 * SPI_HALF_NS - 298 * LINE_HALF_NS;

    reg        conv = 1'b0, spi_clk = 1'b0, line_clk = 1'b0;
    reg [31:0] word_x = 32'd0, word_y = 32'd0, word_z = 32'd0, word_t = 32'd0;
    reg [31:0] rows[0:4 * ROWS - 1];
    wire [8:0] lines;
    wire       int_n = lines[8], clk = lines[7], data = lines[6];

    psa2 dut (
        .conv(conv), .spi_clk(spi_clk), .line_clk(line_clk), .word_x(word_x), .word_y(word_y), .word_z(word_z),
        .word_t(word_t), .lines(lines)
    );

    // ---- receiver, as the navigation computer reads the lines
    reg [31:0] taken = 32'd0, sum = 32'd0;
    reg [4:0]  taken_bits = 5'd0;
    integer    frames = 0;

    always @(posedge clk) begin
        taken = {data, taken[31:1]};
        taken_bits = taken_bits + 5'd1;
        if (taken_bits == 5'd0) sum = sum * 32'd31 + taken;
    end

    always @(posedge int_n) if ($time > 0) frames = frames + 1;

    // ---- edges, a counter a line
    integer      count[0:8];
    integer      when[0:8];
    integer      sclk_levels = 0;  // since DRD_A fell
    real         int_fall_ns = 0.0;
    integer      i;
    generate
        if (CHECK != 0) begin : edges
            reg [8:0] was;
            initial begin
                for (i = 0; i < 9; i = i + 1) {count[i], when[i]} = 0;
                #1 was = lines;
                forever begin
                    @(lines);
                    if (lines[8] < was[8]) int_fall_ns = $realtime;
                    if (lines[1] < was[1]) sclk_levels = 0;
                    if (lines[0] != was[0]) sclk_levels = sclk_levels + 1;
                    for (i = 0; i < 9; i = i + 1)
                        if (lines[i] != was[i]) begin
                            count[i] = count[i] + 1;
                            if (i >= 6) when[i] = when[i] + $rtoi(($realtime - int_fall_ns) / LINE_HALF_NS + 0.5);
                            else if (i >= 3) when[i] = when[i] + sclk_levels;
                        end
                    was = lines;
                end
            end
        end
    endgenerate

    // ---- stimulus
    integer      n, row, wanted;
    reg [1023:0] file;
    initial begin
        if (!$value$plusargs("words=%s", file) || !$value$plusargs("frames=%d", wanted)) begin
            $display("usage: +words=FILE +frames=N");
            $finish;
        end
        $readmemh(file, rows);
        #1000;
        for (n = 0; n < wanted; n = n + 1) begin
            row = 4 * (n % ROWS);
            word_x = rows[row];
            word_y = rows[row + 1];
            word_z = rows[row + 2];
            word_t = rows[row + 3];
            conv = 1'b1;
            repeat (26) begin
                #SPI_HALF_NS spi_clk = 1'b1;
                conv = 1'b0;
                #SPI_HALF_NS spi_clk = 1'b0;
            end
            repeat (149) begin
                #LINE_HALF_NS line_clk = 1'b1;
                #LINE_HALF_NS line_clk = 1'b0;
            end
            #REST_NS;
        end
        $display("frames %0d checksum %h", frames, sum);
        if (CHECK != 0) for (i = 0; i < 9; i = i + 1) $display("line %0d edges %0d when %0d", i, count[i], when[i]);
        $finish;
    end
endmodule

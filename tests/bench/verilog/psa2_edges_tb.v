// Test bench of psa2.v in the board's time, for Icarus: given only what the controller cannot know, it writes down every edge.
//   vvp psa2_edges_tb.vvp +frames=FILE +edges=FILE +end=NS
// frames: one a line, instant at which the conversions end, ns from power-up, then X, Y, Z as the converters shift them out and
// the word T, hexadecimal. edges: instant and the nine lines, hexadecimal, whenever one has changed; of one instant the last
// row counts. Edge k of a clock lies at its exact instant, rounded down to ns, as the board has it.
`timescale 1ns / 1ns
module psa2_edges_tb;
    localparam [63:0] SPI_HALF_HZ = 64'd2048000, LINE_HALF_HZ = 64'd4000000, SECOND_NS = 64'd1000000000;

    reg        conv = 1'b0;
    reg [31:0] word_x = 32'd0, word_y = 32'd0, word_z = 32'd0, word_t = 32'd0;
    wire [8:0] lines;

    // ---- clocks from a count that runs from power-up on, computed while a frame is under way; rises of SClk and falls of CLK
    // are the even ones. At one instant: conversions, then the clock of the converters, then, after what follows from it, that
    // of the line.
    localparam [63:0] BEFORE_NS = 64'd5000, FRAME_NS = 64'd120000;
    reg         spi_now = 1'b0, line_now = 1'b0;
    reg  [63:0] spi_k, line_k, conv_ns = 64'd0;
    event       frame;
    always @(frame) begin
        spi_k = $time * SPI_HALF_HZ / SECOND_NS + 64'd1;
        while ($time < conv_ns + FRAME_NS) begin
            #(spi_k * SECOND_NS / SPI_HALF_HZ - $time) spi_now = !spi_k[0];
            spi_k = spi_k + 64'd1;
        end
    end
    always @(frame) begin
        line_k = $time * LINE_HALF_HZ / SECOND_NS + 64'd1;
        while ($time < conv_ns + FRAME_NS) begin
            #(line_k * SECOND_NS / LINE_HALF_HZ - $time) line_now = line_k[0];
            line_k = line_k + 64'd1;
        end
    end
    reg [1:0] spi_later = 2'd0;
    reg [5:0] line_later = 6'd0;
    always @(spi_now or spi_later) spi_later <= {spi_later[0], spi_now};
    always @(line_now or line_later) line_later <= {line_later[4:0], line_now};

    psa2 dut (
        .conv(conv), .spi_clk(spi_later[1]), .line_clk(line_later[5]), .word_x(word_x), .word_y(word_y), .word_z(word_z),
        .word_t(word_t), .lines(lines)
    );

    // ---- stimulus
    reg [1023:0] frames_name, edges_name;
    integer      frames, edges = 0, got;
    reg [63:0]   end_ns, next_ns;
    reg [31:0]   next_t;
    initial begin
        if (!$value$plusargs("frames=%s", frames_name) || !$value$plusargs("edges=%s", edges_name) ||
            !$value$plusargs("end=%d", end_ns)) begin
            $display("usage: +frames=FILE +edges=FILE +end=NS");
            $finish;
        end
        edges = $fopen(edges_name, "w");
        #end_ns;
        $fclose(edges);
        edges = 0;
        $finish;
    end
    initial begin
        #1 frames = $fopen(frames_name, "r");
        got = $fscanf(frames, "%d %h %h %h %h", next_ns, word_x, word_y, word_z, next_t);
        while (got == 5) begin
            #(next_ns - BEFORE_NS - $time) conv_ns = next_ns;
            -> frame;
            #BEFORE_NS conv = 1'b1;
            word_t = next_t;
            #1000 conv = 1'b0;
            got = $fscanf(frames, "%d %h %h %h %h", next_ns, word_x, word_y, word_z, next_t);
        end
    end

    // ---- the record
    always @(lines) if (edges != 0) $fdisplay(edges, "%0d %h", $time, lines);
endmodule

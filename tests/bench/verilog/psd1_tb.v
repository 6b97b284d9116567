// Test bench of psd1.v in real time, for Icarus: given only what the controller cannot know, it writes down every edge.
//   vvp psd1_tb.vvp +updates=FILE +words=FILE +host=FILE +flags=FILE +edges=FILE +end=NS [+update_ns=NS]
// updates: instants at which conversions end, ns from power-up, one a line. words: X, Y, Z of each cycle, hexadecimal.
// host: strobes, one a line: after (0: the next rise of FL2, 1: the strobe before), delay and length in ns, address, R/W,
// data of a write. flags: changes of INT0 and FL1, instant and levels; before the first both are active.
// edges: instant and all lines but the clock, hexadecimal, whenever one has changed; of one instant the last row counts.
`timescale 1ns / 1ns
module psd1_tb;
    reg         clk = 1'b0, clk_3_8 = 1'b0, update = 1'b1, cs_n = 1'b1, rw = 1'b1, int0 = 1'b1, fl1_n = 1'b0;
    reg  [3:0]  ab = 4'd0;
    reg  [15:0] host_d = 16'd0;
    reg  [15:0] word_x = 16'd0, word_y = 16'd0, word_z = 16'd0;
    wire [33:0] lines;
    wire        fl2 = lines[3], rfx_n = lines[5], rfz_n = lines[7];

    psd1 dut (
        .clk(clk), .clk_3_8(clk_3_8), .update(update), .word_x(word_x), .word_y(word_y), .word_z(word_z), .int0(int0),
        .fl1_n(fl1_n), .cs_n(cs_n), .rw(rw), .ab(ab), .lines(lines)
    );

    // ---- clocks; what the stimulus changes at the instant of an edge, this edge does not see yet: it is assigned with <=
    initial forever begin
        clk = 1'b1;
        #400 clk = 1'b0;
        #400;
    end
    initial #300 forever begin
        clk_3_8 = 1'b1;
        #400 clk_3_8 = 1'b0;
        #400;
    end

    reg [1023:0] updates_name, words_name, host_name, flags_name, edges_name;
    integer      edges = 0;
    reg [63:0]   end_ns;
    initial begin
        if (!$value$plusargs("updates=%s", updates_name) || !$value$plusargs("words=%s", words_name) ||
            !$value$plusargs("host=%s", host_name) || !$value$plusargs("flags=%s", flags_name) ||
            !$value$plusargs("edges=%s", edges_name) || !$value$plusargs("end=%d", end_ns)) begin
            $display("usage: +updates=FILE +words=FILE +host=FILE +flags=FILE +edges=FILE +end=NS");
            $finish;
        end
        edges = $fopen(edges_name, "w");
        #end_ns;
        $fclose(edges);
        edges = 0;
        $finish;
    end

    // ---- the ends of conversions; an old word is no longer offered for a moment before each
    integer    updates, got_update;
    reg [63:0] update_at_ns, update_ns;
    initial begin
        if (!$value$plusargs("update_ns=%d", update_ns)) update_ns = 64'd1;
        updates = $fopen(updates_name, "r");
        got_update = $fscanf(updates, "%d", update_at_ns);
        while (got_update == 1) begin
            #(update_at_ns - update_ns - $time) update <= 1'b1;
            #update_ns update <= 1'b0;
            got_update = $fscanf(updates, "%d", update_at_ns);
        end
    end

    // ---- the words of the next cycle
    integer words, got_words;
    initial begin
        words = $fopen(words_name, "r");
        got_words = $fscanf(words, "%h %h %h", word_x, word_y, word_z);
        #1 forever begin
            @(posedge rfz_n);
            got_words = $fscanf(words, "%h %h %h", word_x, word_y, word_z);
        end
    end

    // ---- INT0 and FL1
    integer    flags, got_flags, next_int0, next_fl1;
    reg [63:0] flags_at_ns;
    initial begin
        flags = $fopen(flags_name, "r");
        got_flags = $fscanf(flags, "%d %d %d", flags_at_ns, next_int0, next_fl1);
        while (got_flags == 3) begin
            #(flags_at_ns - $time);
            int0 <= next_int0[0];
            fl1_n <= next_fl1[0];
            got_flags = $fscanf(flags, "%d %d %d", flags_at_ns, next_int0, next_fl1);
        end
    end

    // ---- the host
    integer    host, got_host, after, next_rw;
    integer    rises = 0, met = 0;  // of FL2; those the host has waited for
    reg [63:0] delay_ns, length_ns, next_ab, next_d;
    always @(posedge fl2) rises = rises + 1;
    initial begin
        host = $fopen(host_name, "r");
        got_host = $fscanf(host, "%d %d %d %d %d %d", after, delay_ns, length_ns, next_ab, next_rw, next_d);
        while (got_host == 6) begin
            if (after == 0) begin
                wait (rises > met);
                met = rises;
            end
            #delay_ns;
            cs_n <= 1'b0;
            rw <= next_rw[0];
            host_d <= next_d[15:0];
            ab <= next_ab[3:0];
            #length_ns;
            cs_n <= 1'b1;
            rw <= 1'b1;
            host_d <= 16'd0;
            ab <= 4'd0;
            got_host = $fscanf(host, "%d %d %d %d %d %d", after, delay_ns, length_ns, next_ab, next_rw, next_d);
        end
    end

    // ---- the record
    wire [33:0] recorded = (lines & ~34'h800) | {host_d, 18'd0};
    always @(recorded) if (edges != 0) $fdisplay(edges, "%0d %h", $time, recorded);
endmodule

// Controller KPSA of PSA-2: three 24-bit reads in parallel at each fall of DRD_A, then four 32-bit words on Int, Data, CLK.
// Both clocks stand still while nothing is to be done; the bench gives as many periods as a frame takes.
`timescale 1ns / 1ps
module kpsa (
    input             spi_clk,   // 1.024 MHz
    input             line_clk,  // 2.000 MHz
    input             drd_a,
    input             doutx,
    input             douty,
    input             doutz,
    input      [31:0] word_t,    // the temperature word, ready made
    output            sclk,
    output            din,
    output reg        int_n = 1'b1,
    output            data,
    output            clk
);
    localparam [4:0] LEAD_IN = 5'd8, GAP = 5'd4;  // profile article

    // ---- read: a rise of spi_clk finds DRD_A low, and from the next one on SClk runs for 24 whole periods
    reg        ready = 1'b0, reading = 1'b0;
    reg        filled = 1'b0;  // changes with each complete read
    reg [4:0]  bits = 5'd0;
    reg [23:0] x = 24'd0, y = 24'd0, z = 24'd0;

    assign sclk = spi_clk & reading;
    assign din = 1'b0;  // no commands while reading

    always @(posedge spi_clk) begin
        ready <= !drd_a && !reading;
        if (reading) begin
            x <= {x[22:0], doutx};
            y <= {y[22:0], douty};
            z <= {z[22:0], doutz};
            bits <= bits + 5'd1;
        end else begin
            if (bits == 5'd24) filled <= !filled;
            bits <= 5'd0;
        end
    end

    always @(negedge spi_clk)
        if (!reading) reading <= ready;
        else if (bits == 5'd24) reading <= 1'b0;

    // ---- send: everything changes on falling edges of line_clk, a bit is taken on the rising one
    reg        emptied = 1'b0;  // follows filled: equal, nothing to send
    reg        sending = 1'b0;
    reg [1:0]  at = 2'd0;     // word under way
    reg [4:0]  left = 5'd0;   // periods of lead-in, word or gap after this one
    reg [31:0] shift = 32'd0;

    assign data = sending & shift[0];
    assign clk = line_clk & sending;

    always @(negedge line_clk)
        if (int_n) begin
            if (filled != emptied) begin
                int_n <= 1'b0;
                emptied <= filled;
                at <= 2'd0;
                left <= LEAD_IN - 5'd1;
            end
        end
        else if (left != 5'd0) begin
            left <= left - 5'd1;
            shift <= {1'b0, shift[31:1]};
        end
        else if (sending) begin
            sending <= 1'b0;
            left <= GAP - 5'd1;
            at <= at + 2'd1;
            int_n <= at == 2'd3;
        end
        else begin
            sending <= 1'b1;
            left <= 5'd31;
            case (at)
                2'd0: shift <= {{8{x[23]}}, x};
                2'd1: shift <= {{8{y[23]}}, y};
                2'd2: shift <= {{8{z[23]}}, z};
                2'd3: shift <= word_t;
            endcase
        end
endmodule

// Controller KPSD-1: on INT0, FL1 and DR together it reads converters X, Y and Z one after the other into its shift register
// and offers each word to the host, until it has read it (article, section 4; sources 4.5).
`timescale 1ns / 1ns
module kpsd1 (
    input             clk,      // 1M25
    input             clk_3_8,  // the same, 3/8 of a period later
    input             int0,
    input             fl1_n,
    input             dr_n,
    input             sdat,
    input             cs_n,
    input             rw,       // 1: read
    input      [3:0]  ab,
    output            a0,
    output reg [2:0]  rf_n = 3'b111,  // RFZ, RFY, RFX
    output            sclk,
    output reg        fl2 = 1'b0,
    output     [15:0] d
);
    // ---- a cycle begins on a rise of the clock and ends on a fall
    reg        begun = 1'b0, ended = 1'b0;
    assign a0 = begun != ended;

    always @(posedge clk) if (!a0 && int0 && !fl1_n && !dr_n) begun <= !ended;

    // ---- transfers: RFx, then 16 SCLK, then FL2 until the word has been read
    reg  [1:0] axis = 2'd0;
    reg        read = 1'b0, seen = 1'b0;  // differ: the word has been read
    reg  [4:0] bits = 5'd0;               // shifted in
    reg        run = 1'b0;                // SCLK is on
    wire       busy = rf_n != 3'b111;

    always @(negedge clk)
        if (busy) begin
            if (bits == 5'd16 && !run) begin  // after the end of the 16th pulse
                rf_n <= 3'b111;
                fl2 <= 1'b1;
            end
        end
        else if (!fl2) begin
            if (a0) rf_n <= 3'b110;
        end
        else if (read != seen) begin
            fl2 <= 1'b0;
            seen <= read;
            if (axis == 2'd2) begin
                axis <= 2'd0;
                ended <= begun;
            end else begin
                axis <= axis + 2'd1;
                rf_n <= axis == 2'd0 ? 3'b101 : 3'b011;
            end
        end

    // ---- shift register RK and its clock, which is gated while it is low
    /* verilator lint_off UNUSEDSIGNAL */
    reg  [23:0] rk = 24'd0;  // 24 bits for control words, which are not written here
    /* verilator lint_on UNUSEDSIGNAL */
    assign sclk = clk_3_8 & run;

    always @(negedge clk_3_8) run <= busy && bits != 5'd16;

    always @(posedge clk_3_8)
        if (run) begin
            rk <= {rk[22:0], sdat};
            bits <= bits + 5'd1;
        end
        else if (!busy) bits <= 5'd0;

    // ---- the host's strobe: at its beginning it is known whether the word is there and meant
    reg        mine = 1'b0;
    assign d = {16{mine & !cs_n}} & rk[15:0];

    always @(negedge cs_n) mine <= fl2 && read == seen && rw && ab == {2'b00, axis};

    always @(posedge cs_n) if (mine) read <= !seen;
endmodule

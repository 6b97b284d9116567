// Serial port of an AD7712 that is read in external clocking mode: 16 bits, most significant bit first, DRDY as a level.
// What a cycle of PSD-1 needs and no more: no control word, no conversion (sources 3.4). Delays as the board's profile has
// them; all 0: none, for who steps from edge to edge.
`timescale 1ns / 1ns
module ad7712_port #(
    parameter RFS_ACCESS_NS = 300,  // not more than 4 periods of 10 MHz
    parameter BIT_ACCESS_NS = 100,  // not more than 2 of them and 20 ns
    parameter DRDY_RISE_NS = 100    // not more than 1 of them and 10 ns
) (
    input        update,  // its fall ends a conversion; while it is high, an old word is no longer offered
    input [15:0] word,    // the one that waits
    /* verilator lint_off SYNCASYNCNET */
    input        rfs_n,   // it clocks and it resets, as in the part
    /* verilator lint_on SYNCASYNCNET */
    input        sclk,
    output       sdata,   // low in high impedance: three parts share the wire
    output       drdy_n
);
    reg [15:0] held = 16'd0;
    reg [4:0]  falls = 5'd0;  // of SCLK, in this frame
    reg        fresh = 1'b0, taken = 1'b0;  // differ: a word waits
    wire       bit_now = held[falls[4] ? 4'd0 : 4'd15 - falls[3:0]];
    wire       waits = fresh != taken;

    always @(negedge rfs_n) held <= word;

    always @(negedge sclk or posedge rfs_n)
        if (rfs_n) falls <= 5'd0;
        else if (!falls[4]) falls <= falls + 5'd1;

    // The word has gone out with the last of 16 clocks.
    always @(negedge sclk) if (!rfs_n && falls == 5'd15) taken <= fresh;

    // What ends while RFS is low is lost, and a word that is being read stays on offer.
    reg hides = 1'b1;
    always @(posedge update) hides <= rfs_n;
    always @(negedge update) if (rfs_n) fresh <= !taken;
    wire hidden = update & hides;

    generate
        if (RFS_ACCESS_NS == 0) begin : at_once
            assign sdata = bit_now & !rfs_n;
            assign drdy_n = !waits | hidden;
        end else begin : delayed
            reg selected = 1'b0, bit_out = 1'b0, waited = 1'b0;
            always @(rfs_n) selected <= #RFS_ACCESS_NS !rfs_n;
            always @(bit_now) bit_out <= #BIT_ACCESS_NS bit_now;
            always @(waits) waited <= #DRDY_RISE_NS waits;
            assign sdata = bit_out & selected & !rfs_n;
            assign drdy_n = !(waits | waited) | hidden;
        end
    endgenerate
endmodule

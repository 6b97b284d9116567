// PSD-1 as far as a cycle of reading shows it: three converter ports, the controller, and their lines, numbered as psa-emu's
// VCD has them: A0 is bit 0, D15 bit 33.
`timescale 1ns / 1ns
module psd1 #(
    parameter RFS_ACCESS_NS = 300,
    parameter BIT_ACCESS_NS = 100,
    parameter DRDY_RISE_NS = 100
) (
    input         clk,      // 1M25
    input         clk_3_8,  // the same, 3/8 of a period later
    input         update,   // of the converters' output registers
    input  [15:0] word_x,
    input  [15:0] word_y,
    input  [15:0] word_z,
    input         int0,
    input         fl1_n,
    input         cs_n,
    input         rw,
    input  [3:0]  ab,
    output [33:0] lines
);
    wire        a0, sclk, fl2, dr_n, sdat_x, sdat_y, sdat_z;
    wire [2:0]  rf_n;
    wire [15:0] d;
    wire        sdat = sdat_x | sdat_y | sdat_z;
    wire        tfs_n = 1'b1;  // control words are not written here

    /* verilator lint_off PINCONNECTEMPTY */
    ad7712_port #(RFS_ACCESS_NS, BIT_ACCESS_NS, DRDY_RISE_NS) adc_x (
        .update(update), .word(word_x), .rfs_n(rf_n[0]), .sclk(sclk), .sdata(sdat_x), .drdy_n(dr_n)
    );
    ad7712_port #(RFS_ACCESS_NS, BIT_ACCESS_NS, DRDY_RISE_NS) adc_y (
        .update(update), .word(word_y), .rfs_n(rf_n[1]), .sclk(sclk), .sdata(sdat_y), .drdy_n()
    );
    ad7712_port #(RFS_ACCESS_NS, BIT_ACCESS_NS, DRDY_RISE_NS) adc_z (
        .update(update), .word(word_z), .rfs_n(rf_n[2]), .sclk(sclk), .sdata(sdat_z), .drdy_n()
    );
    /* verilator lint_on PINCONNECTEMPTY */
    kpsd1 kpsd1 (
        .clk(clk), .clk_3_8(clk_3_8), .int0(int0), .fl1_n(fl1_n), .dr_n(dr_n), .sdat(sdat), .cs_n(cs_n), .rw(rw), .ab(ab),
        .a0(a0), .rf_n(rf_n), .sclk(sclk), .fl2(fl2), .d(d)
    );

    assign lines = {
        d, ab[3], ab[2], ab[1], ab[0], rw, cs_n, clk, sdat, sclk, tfs_n, rf_n[2], rf_n[1], rf_n[0], dr_n, fl2, fl1_n, int0, a0
    };
endmodule

// PSA-2 as far as a frame shows it: three converter ports and the controller. Bits of lines are numbered as in lines.h.
`timescale 1ns / 1ps
module psa2 (
    input         conv,
    input         spi_clk,
    input         line_clk,
    input  [31:0] word_x,
    input  [31:0] word_y,
    input  [31:0] word_z,
    input  [31:0] word_t,
    output [8:0]  lines
);
    wire sclk, din, drd_a, doutx, douty, doutz, int_n, data, clk;

    /* verilator lint_off PINCONNECTEMPTY */
    adc_port adc_x (.conv(conv), .word(word_x), .sclk(sclk), .dout(doutx), .drdy(drd_a));
    adc_port adc_y (.conv(conv), .word(word_y), .sclk(sclk), .dout(douty), .drdy());
    adc_port adc_z (.conv(conv), .word(word_z), .sclk(sclk), .dout(doutz), .drdy());
    /* verilator lint_on PINCONNECTEMPTY */
    kpsa kpsa (
        .spi_clk(spi_clk), .line_clk(line_clk), .drd_a(drd_a), .doutx(doutx), .douty(douty), .doutz(doutz),
        .word_t(word_t), .sclk(sclk), .din(din), .int_n(int_n), .data(data), .clk(clk)
    );

    assign lines = {int_n, clk, data, doutz, douty, doutx, din, drd_a, sclk};
endmodule

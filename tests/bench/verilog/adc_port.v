// Serial port of an ADS1282 in continuous reading: a 32-bit word, most significant bit first, DRDY as a level.
// What a frame needs and no more: no commands, no registers, no conversion (sources 1.1, 1.4).
`timescale 1ns / 1ps
module adc_port (
    input         conv,  // rises when a conversion ends
    input  [31:0] word,  // its result
    input         sclk,
    output        dout,
    output reg    drdy = 1'b1
);
    reg [31:0] shift = 32'd0;

    assign dout = shift[31];

    // DOUT changes on the falling edge of SCLK; DRDY returns on the first one.
    always @(posedge conv or negedge sclk)
        if (conv) begin
            shift <= word;
            drdy <= 1'b0;
        end else begin
            shift <= {shift[30:0], 1'b0};
            drdy <= 1'b1;
        end
endmodule

-- Bytes of the serial ports, as `psabench tap` records them: slcan, the bus port, the line port of a PSA-2.
-- A frame in a line of slcan is given to Wireshark's CAN dissector, and by that to psabench.lua.
-- Use: tshark -X lua_script:psabench_ports.lua -r run.pcap -V, or psabench waveform --wireshark.

local direction = Field.new("exported_pdu.p2p_dir")

-- True: from the board, false: to the board.
local function from_board()
    local found = direction()
    return found == nil or tonumber(tostring(found.value)) == 1 or tostring(found.value) == "Received"
end

local function way()
    return from_board() and "from the board: " or "to the board: "
end

-- Printable text of the bytes.
local function shown(tvb)
    return (tvb:raw():gsub("[%c\127-\255]", function(c) return string.format("\\x%02X", c:byte()) end))
end

local function unknown(proto)
    return ProtoExpert.new(proto.name:lower() .. ".unknown", "Not understood", expert.group.PROTOCOL, expert.severity.WARN)
end

-- The last row of a line: what it is; nil: not understood, with this note. Returns the bytes that are dissected, all.
local function add_kind(branch, tvb, field, kind, expert_info, note)
    if not kind then branch:add_proto_expert_info(expert_info, note) end
    branch:add(field, tvb(), kind or "unknown"):set_generated()
    branch:append_text(": " .. (kind or "unknown"))
    return tvb:len()
end

---------------------------------------------------------------- slcan

local slcan = Proto("psabench_slcan", "slcan line")
local s = {
    text = ProtoField.string("psabench_slcan.line", "Line"),
    kind = ProtoField.string("psabench_slcan.kind", "Kind"),
    stamp = ProtoField.uint16("psabench_slcan.stamp_ms", "Time stamp [ms]"),
    status = ProtoField.uint8("psabench_slcan.status", "Status", base.HEX),
}
slcan.fields = { s.text, s.kind, s.stamp, s.status }
local slcan_unknown = unknown(slcan)
slcan.experts = { slcan_unknown }

-- Digits of the identifier, and SocketCAN's flags: of the identifier (31: extended, 30: remote), of CAN FD (4: FD, 1: BRS).
local FRAMES = {
    t = { 3, 0, 0 }, T = { 8, 2 ^ 31, 0 }, r = { 3, 2 ^ 30, 0 }, R = { 8, 2 ^ 31 + 2 ^ 30, 0 },
    d = { 3, 0, 4 }, D = { 8, 2 ^ 31, 4 }, b = { 3, 0, 5 }, B = { 8, 2 ^ 31, 5 },
}
local LENGTHS = { [0] = 0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64 }
local TO_BOARD = {
    O = "open", L = "open, listen only", C = "close", S = "bit rate", Y = "data bit rate", V = "version", v = "version",
    N = "serial number", F = "status", Z = "time stamps",
}
local FROM_BOARD = { z = "sent", Z = "sent, extended", V = "version", v = "version", N = "serial number", F = "status" }

-- SocketCAN's header and data of a line, the number of its characters, or nil.
local function frame_of(line)
    local kind = FRAMES[line:sub(1, 1)]
    if not kind then return nil end
    local digits, id_flags, fd_flags = kind[1], kind[2], kind[3]
    local head = line:match("^%x+", 2) or ""
    if #head < digits + 1 then return nil end
    local id = tonumber(head:sub(1, digits), 16)
    local dlc = tonumber(head:sub(digits + 1, digits + 1), 16)
    if id > (digits == 8 and 0x1FFFFFFF or 0x7FF) or (fd_flags == 0 and dlc > 8) then return nil end
    local remote = line:sub(1, 1):lower() == "r"
    local length = LENGTHS[dlc]
    local size = remote and 0 or 2 * length
    if #head < digits + 1 + size then return nil end
    local data = head:sub(digits + 2, digits + 1 + size)
    local padding = string.rep("00", (fd_flags == 0 and 8 or 64) - #data / 2)
    local hex = string.format("%08X%02X%02X0000", id + id_flags, length, fd_flags) .. data .. padding
    return ByteArray.new(hex), 1 + digits + 1 + size
end

local function slcan_frame(tvb, pinfo, tree, branch, line)
    local bytes, size = frame_of(line)
    local stamp = bytes and line:sub(size + 1) or ""
    if not bytes or not (stamp == "" or stamp:match("^%x%x%x%x$")) then return false end
    if stamp ~= "" then branch:add(s.stamp, tvb(size, 4), tonumber(stamp, 16)) end
    DissectorTable.get("wtap_encap"):get_dissector(wtap.SOCKETCAN):call(bytes:tvb("CAN frame"), pinfo, tree)
    return true
end

function slcan.dissector(tvb, pinfo, tree)
    if tvb:len() == 0 then return 0 end
    local raw = tvb:raw()
    local line, last = raw:sub(1, -2), raw:sub(-1)
    local branch = tree:add(slcan, tvb())
    branch:add(s.text, tvb(), shown(tvb))
    pinfo.cols.protocol = "slcan"
    pinfo.cols.info = way() .. shown(tvb)
    local kind = (from_board() and FROM_BOARD or TO_BOARD)[line:sub(1, 1)]
    if last == "\r" and slcan_frame(tvb, pinfo, tree, branch, line) then
        kind = "frame"
    elseif last == "\r" and line == "" then
        kind = from_board() and "done" or "empty"
    elseif last == "\a" and line == "" and from_board() then
        kind = "rejected"
    elseif last ~= "\r" or not kind then
        kind = nil
    elseif kind == "status" and line:match("^F%x%x$") then
        branch:add(s.status, tvb(1, 2), tonumber(line:sub(2), 16))
    end
    return add_kind(branch, tvb, s.kind, kind, slcan_unknown, "Not a line of slcan")
end

---------------------------------------------------------------- the bus port

local bus = Proto("psabench_bus", "Bus port line")
local b = {
    text = ProtoField.string("psabench_bus.line", "Line"),
    kind = ProtoField.string("psabench_bus.kind", "Kind"),
    address = ProtoField.uint8("psabench_bus.address", "Address", base.HEX),
    data = ProtoField.uint16("psabench_bus.data", "Data", base.HEX),
    strobe = ProtoField.uint32("psabench_bus.strobe_ns", "Strobe [ns]"),
    t = ProtoField.int64("psabench_bus.t_ns", "Simulated time [ns]"),
    code = ProtoField.string("psabench_bus.code", "Code"),
    board = ProtoField.string("psabench_bus.board", "Board"),
}
bus.fields = { b.text, b.kind, b.address, b.data, b.strobe, b.t, b.code, b.board }
local bus_unknown = unknown(bus)
bus.experts = { bus_unknown }

-- Patterns of the lines, what they are, and the fields of their captures (docs/busport.md).
local TO_BUS = {
    { "^R (%x%x?)[hH]?$", "read", { "address" } },
    { "^R (%x%x?)[hH]? (%d+)$", "read", { "address", "strobe" } },
    { "^W (%x%x?)[hH]? (%x%x?%x?%x?)$", "write", { "address", "data" } },
    { "^W (%x%x?)[hH]? (%x%x?%x?%x?) (%d+)$", "write", { "address", "data", "strobe" } },
    { "^%?$", "identify", {} },
}
local FROM_BUS = {
    { "^R (%x%x)h (%x%x%x%x) t=(%d+)$", "read", { "address", "data", "t" } },
    { "^W (%x%x)h (%x%x%x%x) t=(%d+)$", "written", { "address", "data", "t" } },
    { "^E (%S+) [RW%?-] (%x%x)h t=(%d+)$", "rejected", { "code", "address", "t" } },
    { "^E (%S+) [RW%?-] %- t=(%d+)$", "rejected", { "code", "t" } },
    { "^I (%S+) .*t=(%d+)$", "board", { "board", "t" } },
}

local READ = {
    address = function(text) return tonumber(text, 16) end,
    data = function(text) return tonumber(text, 16) end,
    strobe = function(text) return math.min(tonumber(text), 2 ^ 32 - 1) end,
    t = function(text)
        local t = math.min(tonumber(text), 2 ^ 53)
        return Int64.new(t % 2 ^ 32, math.floor(t / 2 ^ 32))
    end,
    code = function(text) return text end,
    board = function(text) return text end,
}

local function bus_fields(tvb, branch, line)
    for _, form in ipairs(from_board() and FROM_BUS or TO_BUS) do
        local captures = { line:match(form[1]) }
        if #captures > 0 then
            for i, name in ipairs(form[3]) do branch:add(b[name], tvb(), READ[name](captures[i])) end
            return form[2]
        end
    end
end

function bus.dissector(tvb, pinfo, tree)
    if tvb:len() == 0 then return 0 end
    local branch = tree:add(bus, tvb())
    branch:add(b.text, tvb(), shown(tvb))
    pinfo.cols.protocol = "busport"
    pinfo.cols.info = way() .. shown(tvb)
    local line = tvb:raw():gsub("[\r\n]+$", ""):gsub("%s+", " "):gsub("^ ", "")
    if not from_board() then line = line:upper() end
    return add_kind(branch, tvb, b.kind, bus_fields(tvb, branch, line), bus_unknown, "Not a line of the bus port")
end

---------------------------------------------------------------- the line port of a PSA-2

local lines = Proto("psabench_line", "Line port frame")
local l = {
    samples = ProtoField.uint32("psabench_line.samples", "Samples"),
    bits = ProtoField.uint32("psabench_line.bits", "Bits"),
    x = ProtoField.int32("psabench_line.x", "X"),
    y = ProtoField.int32("psabench_line.y", "Y"),
    z = ProtoField.int32("psabench_line.z", "Z"),
    t = ProtoField.uint16("psabench_line.t", "T", base.HEX),
    channel = ProtoField.uint8("psabench_line.channel", "Channel"),
    status = ProtoField.uint8("psabench_line.status", "Status", base.HEX),
}
lines.fields = { l.samples, l.bits, l.x, l.y, l.z, l.t, l.channel, l.status }
local torn = ProtoExpert.new("psabench_line.torn", "Torn frame", expert.group.PROTOCOL, expert.severity.WARN)
local lost = ProtoExpert.new("psabench_line.lost", "Samples were lost", expert.group.SEQUENCE, expert.severity.WARN)
lines.experts = { torn, lost }

local function bit_of(sample, n)
    return math.floor(sample / 2 ^ n) % 2
end

-- Levels of DATA where CLK rises while INT is low, and whether samples were lost.
local function bits_of(raw)
    local bits, gap, clk = {}, false, nil
    for i = 1, #raw do
        local sample = raw:byte(i)
        gap = gap or (i > 1 and bit_of(sample, 7) == 1)
        if clk == 0 and bit_of(sample, 2) == 1 and bit_of(sample, 0) == 0 then table.insert(bits, bit_of(sample, 1)) end
        clk = bit_of(sample, 2)
    end
    return bits, gap
end

-- Word n, least significant bit first.
local function word_of(bits, n, size)
    local value = 0
    for i = (n + 1) * size, n * size + 1, -1 do value = value * 2 + bits[i] end
    return value
end

local function signed(value, size)
    return value >= 2 ^ (size - 1) and value - 2 ^ size or value
end

function lines.dissector(tvb, pinfo, tree)
    if tvb:len() == 0 then return 0 end
    local branch = tree:add(lines, tvb())
    local bits, gap = bits_of(tvb:raw())
    branch:add(l.samples, tvb(), tvb:len()):set_generated()
    branch:add(l.bits, tvb(), #bits):set_generated()
    pinfo.cols.protocol = "line port"
    pinfo.cols.info = string.format("%d bits", #bits)
    if gap then branch:add_proto_expert_info(lost) end
    local size = #bits / 4
    if size ~= 16 and size ~= 24 and size ~= 32 then
        branch:add_proto_expert_info(torn, string.format("Torn frame: %d bits", #bits))
        return tvb:len()
    end
    local x, y, z = signed(word_of(bits, 0, size), size), signed(word_of(bits, 1, size), size), signed(word_of(bits, 2, size), size)
    local t = word_of(bits, 3, size)
    branch:add(l.x, tvb(), x)
    branch:add(l.y, tvb(), y)
    branch:add(l.z, tvb(), z)
    branch:add(l.t, tvb(), t % 65536)
    if size > 16 then
        branch:add(l.channel, tvb(), math.floor(t / 2 ^ 16) % 16)
        branch:add(l.status, tvb(), math.floor(t / 2 ^ 20) % 16)
    end
    pinfo.cols.info = string.format("X=%d Y=%d Z=%d T=%04X", x, y, z, t % 65536)
    return tvb:len()
end

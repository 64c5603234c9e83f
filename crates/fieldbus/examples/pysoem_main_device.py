#!/usr/bin/env python3
"""An independent main device: pysoem (SOEM) brings the devices of a bus table to OP and replays recorded commands.

The commands are those of a run, `hydroboom log to-csv run.mcap` (columns time_s, command_motor_speed_rpm,
command_holding_valve). The table is that of `hydroboom run --bus`; only what a table says is written to the devices.
A simulated segment has to be at the other end of the interface.

    pip install pysoem==1.1.13
    python3 pysoem_main_device.py --interface bus0 --table bus.toml --commands run.csv --out replayed.csv

Prints the cycles, wrong and missing working counters, periods in which this program woke late, and the last position.
Exit status 1: a device did not reach OP or left it.
"""

import argparse
import csv
import struct
import sys
import time
import tomllib

import pysoem

STATES = {1: "INIT", 2: "PREOP", 3: "BOOT", 4: "SAFEOP", 8: "OP"}
KINDS = {"u8": "<B", "i8": "<b", "u16": "<H", "i16": "<h", "u32": "<I", "i32": "<i"}
# CiA 402: mask and value of the statusword in a state, and the controlword that leads onwards
TRANSITIONS = [(0x4F, 0x40, 0x06), (0x6F, 0x21, 0x07), (0x6F, 0x23, 0x0F)]
OPERATION_ENABLED = (0x6F, 0x27)
VELOCITY_MODE = 9
ANSWER_US = 2000


class Phase:
    """Keeps the cycle in phase with SYNC0, which comes at whole periods of the reference clock, as SOEM's examples do."""

    def __init__(self, period_ns):
        self.period, self.integral = period_ns, 0

    def correction(self, clock_ns):
        """By how much the next cycle is to begin later [s], so that frames pass half a period before SYNC0."""
        off = (clock_ns - self.period // 2) % self.period
        off -= self.period if off > self.period // 2 else 0
        self.integral += (off > 0) - (off < 0)
        return -1e-9 * (off / 100 + self.integral / 20)


class Place:
    """Bits of an entry in a device's process data."""

    def __init__(self, device, bit, bits, row):
        self.device, self.bit, self.bits = device, bit, bits
        self.is_signed = row["type"].startswith("i")
        self.factor, self.offset = row["factor"] * row.get("sign", 1), row.get("offset", 0.0)

    def read(self, image):
        counts = int.from_bytes(image, "little") >> self.bit & (1 << self.bits) - 1
        if self.is_signed and counts >> self.bits - 1:
            counts -= 1 << self.bits
        return self.factor * counts + self.offset

    def write(self, image, value):
        counts = round((value - self.offset) / self.factor) & (1 << self.bits) - 1
        put(image, self.bit, self.bits, counts)


def put(image, bit, bits, counts):
    mask = (1 << bits) - 1 << bit
    whole = int.from_bytes(image, "little") & ~mask | counts << bit
    image[:] = whole.to_bytes(len(image), "little")


def bit_of(device, direction, entry):
    """First bit and length of an entry among a device's outputs or inputs."""
    bit = 0
    for pdo in device.get(direction, []):
        for index, sub, bits in pdo["entries"]:
            if [index, sub] == entry:
                return bit, bits
            bit += bits
    sys.exit(f"{device['name']}: entry {entry} is not among its {direction}")


def place(table, direction, row):
    names = [device["name"] for device in table["device"]]
    position = names.index(row["device"])
    return Place(position, *bit_of(table["device"][position], direction, row["entry"]), row)


def configured(row):
    """Start-up SDOs of a device, which SOEM writes in PREOP."""

    def write(slave_or_position):
        slave = slave_or_position
        for sdo in row.get("sdo", []):
            slave.sdo_write(sdo["index"], sdo["sub"], struct.pack(KINDS[sdo["type"]], sdo["value"]))

    return write


def started(master, table, period_ns):
    """The devices in OP, with cyclic process data from SAFEOP on."""
    found, rows = master.config_init(), table["device"]
    if found != len(rows):
        sys.exit(f"{found} devices on the bus, {len(rows)} in the table")
    for position, (slave, row) in enumerate(zip(master.slaves, rows)):
        low, high = row["revision"]
        if (slave.man, slave.id) != (row["vendor"], row["product"]) or not low <= slave.rev <= high:
            sys.exit(f"device {position} is {slave.man:#x} {slave.id:#x} {slave.rev}, not {row['name']}")
        write = configured(row)
        slave.config_func = lambda _, slave=slave, write=write: write(slave)
    master.config_map()
    master.config_dc()
    for slave, row in zip(master.slaves, rows):
        if row["sync"] != "none":
            slave.dc_sync(True, period_ns)
        if "watchdog_ms" in row:
            slave.set_watchdog("processdata", row["watchdog_ms"])
    if master.state_check(pysoem.SAFEOP_STATE, 2_000_000) != pysoem.SAFEOP_STATE:
        sys.exit("not in SAFEOP: " + states(master))
    for _ in range(500):
        exchange(master)
        time.sleep(1e-9 * period_ns)
    master.state = pysoem.OP_STATE
    master.write_state()
    for _ in range(2000):
        exchange(master)
        time.sleep(1e-9 * period_ns)
        if master.state_check(pysoem.OP_STATE, 100) == pysoem.OP_STATE:
            return
    sys.exit("not in OP: " + states(master))


def states(master):
    master.read_state()
    return ", ".join(
        f"{slave.name} {STATES.get(slave.state & 0xF, slave.state)}, AL status code {slave.al_status:#x} "
        f"({pysoem.al_status_code_to_string(slave.al_status)})"
        for slave in master.slaves
    )


def exchange(master):
    master.send_processdata()
    return master.receive_processdata(ANSWER_US)


def recorded(path):
    """Commands of a run: speed of the motor [rev/s] and holding valve [0 or 1], a row a period."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return [
        (float(row["command_motor_speed_rpm"]) / 60.0, float(row["command_holding_valve"]))
        for row in rows
        if row["command_motor_speed_rpm"]
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("interface", "table", "commands", "out"):
        parser.add_argument(f"--{name}", required=True)
    arguments = parser.parse_args()
    with open(arguments.table, "rb") as file:
        table = tomllib.load(file)
    commands = recorded(arguments.commands)
    period = table["bus"]["period_us"] * 1e-6

    speed = place(table, "outputs", next(r for r in table["commanded"] if r["signal"] == "motor_speed_rev_per_s"))
    valve = place(table, "outputs", next(r for r in table["commanded"] if r["signal"] == "holding_valve"))
    measured = {row["signal"]: place(table, "inputs", row) for row in table["measured"]}
    drive = table["device"][speed.device]
    controlword, mode = bit_of(drive, "outputs", [0x6040, 0]), bit_of(drive, "outputs", [0x6060, 0])
    statusword = bit_of(drive, "inputs", [0x6041, 0])

    master = pysoem.Master()
    master.open(arguments.interface)
    wrong = missing = late = low = off = 0
    rows = []
    try:
        started(master, table, round(1e9 * period))
        images = [bytearray(len(slave.output)) for slave in master.slaves]
        due, at, phase = time.monotonic(), None, Phase(round(1e9 * period))
        enabled = 0
        # enabling takes some cycles; the recording begins when the drive is in operation
        while at is None or at < len(commands):
            # a drive that left operation, and devices that do not answer, end the run after ten cycles in a row
            if low >= 10 or off >= 10:
                break
            word = int.from_bytes(master.slaves[speed.device].input, "little") >> statusword[0] & 0xFFFF
            control = next((c for mask, value, c in TRANSITIONS if word & mask == value), 0x0F)
            put(images[speed.device], *controlword, control)
            put(images[speed.device], *mode, VELOCITY_MODE)
            wanted = (0.0, 0.0) if at is None else commands[at]
            speed.write(images[speed.device], wanted[0])
            valve.write(images[valve.device], wanted[1])
            for slave, image in zip(master.slaves, images):
                slave.output = bytes(image)
            counter = exchange(master)
            low = low + 1 if counter != master.expected_wkc else 0
            wrong += counter >= 0 and counter != master.expected_wkc
            missing += counter < 0
            if at is not None:
                values = [p.read(master.slaves[p.device].input) for p in measured.values()]
                rows.append([at * period, *wanted, counter, *values])
                at += 1
                off = 0 if word & OPERATION_ENABLED[0] == OPERATION_ENABLED[1] else off + 1
            elif word & OPERATION_ENABLED[0] == OPERATION_ENABLED[1]:
                at = 0
            else:
                enabled += 1
                if enabled > 5000:
                    sys.exit(f"the drive is not enabled: statusword {word:#06x}; {states(master)}")
            due += period + phase.correction(master.dc_time)
            wait = due - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            late += time.monotonic() - due > 0.5 * period
        ended = states(master)
        is_whole = at == len(commands) and all(slave.state == pysoem.OP_STATE for slave in master.slaves)
    finally:
        master.state = pysoem.INIT_STATE
        master.write_state()
        master.close()
    with open(arguments.out, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time_s", "commanded_motor_speed_rev_per_s", "commanded_holding_valve", "working_counter", *measured])
        writer.writerows(rows)
    stroke = list(measured).index("stroke_m") + 4
    print(f"{ended}")
    if not rows:
        return 1
    print(
        f"{len(rows)} of {len(commands)} periods; working counter wrong in {wrong}, missing in {missing}; "
        f"woke over half a period late in {late}; last position {1e3 * rows[-1][stroke]:.2f} mm"
    )
    return 0 if is_whole else 1


if __name__ == "__main__":
    sys.exit(main())

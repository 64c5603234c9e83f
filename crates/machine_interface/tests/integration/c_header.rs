//! The header for C states the same bytes: a C program answers a measurement with a command, and both sides read what the other wrote.

use hydroboom_machine_interface::datagram::{
    Body, Header, LONGEST, MeasuredAxis, Measurement, decode, encode,
};
use hydroboom_machine_interface::signal::{MachineState, Validity, ValveState};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Commands each axis to turn by its position, where the valve is open and the rod-side pressure is good.
const PROGRAM: &str = r#"
#include "hydroboom_machine.h"
#include <stdio.h>
#include <string.h>

int main(void) {
    unsigned char in[HYDROBOOM_MACHINE_LONGEST], out[HYDROBOOM_MACHINE_LONGEST];
    struct hydroboom_header header;
    struct hydroboom_measurement measurement;
    struct hydroboom_command command = {0};
    uint32_t sum;
    size_t length = fread(in, 1, sizeof in, stdin), to;
    memcpy(&header, in, sizeof header);
    memcpy(&measurement, in + sizeof header, sizeof measurement);
    memcpy(&sum, in + length - 4, 4);
    if (memcmp(header.magic, HYDROBOOM_MACHINE_MAGIC, 4) || header.kind != HYDROBOOM_MEASUREMENT || header.length != length) return 2;
    if (sum != hydroboom_crc32(in, length - 4) || measurement.state != HYDROBOOM_ENABLED || measurement.fault != 0x7500) return 3;
    header.kind = HYDROBOOM_COMMAND;
    header.received = header.sequence;
    header.sequence = 1;
    header.clock_ns = measurement.sampled_ns;
    command.is_enabled = 1;
    to = sizeof header;
    memcpy(out + to, &command, sizeof command);
    to += sizeof command;
    for (int k = 0; k < header.axes; k++) {
        struct hydroboom_measured_axis axis;
        struct hydroboom_commanded_axis answer;
        memcpy(&axis, in + sizeof header + sizeof measurement + k * sizeof axis, sizeof axis);
        answer.motor_speed_rev_per_s = axis.validity[3] == HYDROBOOM_GOOD ? axis.signals[0] : -1.0;
        answer.holding_valve = axis.valve == HYDROBOOM_VALVE_OPEN;
        memcpy(out + to, &answer, sizeof answer);
        to += sizeof answer;
    }
    header.length = (uint16_t)(to + 4);
    memcpy(out, &header, sizeof header);
    sum = hydroboom_crc32(out, to);
    memcpy(out + to, &sum, 4);
    return fwrite(out, 1, to + 4, stdout) == to + 4 ? 0 : 4;
}
"#;

#[test]
fn a_c_program_reads_measurements_and_writes_commands() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("machine_interface");
    std::fs::create_dir_all(&folder).expect("a folder");
    let (source, program) = (folder.join("machine.c"), folder.join("machine"));
    std::fs::write(&source, PROGRAM).expect("a file");
    let include = Path::new(env!("CARGO_MANIFEST_DIR")).join("include");
    let mut cc = Command::new("cc");
    cc.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-I"]).arg(include);
    let built = cc.arg(&source).arg("-o").arg(&program).status().expect("a C compiler");
    assert!(built.success());

    let mut measurement = Measurement {
        sampled: 123_456_789,
        state: MachineState::Enabled,
        fault: 0x7500,
        count: 2,
        ..Default::default()
    };
    let axis = |stroke| MeasuredAxis {
        signals: [stroke, 1e5, 2e5, 3e5, 4e5, 5e5, 6.0],
        valve: ValveState::Open,
        ..Default::default()
    };
    measurement.axes[..2].copy_from_slice(&[axis(0.25), axis(0.5)]);
    measurement.axes[1].validity[3] = Validity::OutOfRange;
    measurement.axes[1].valve = ValveState::Shut;
    let header = Header { session: 42, sequence: 17, received: 16, clock: 1 };
    let mut bytes = [0; LONGEST];
    let length = encode(&header, &Body::Measurement(measurement), &mut bytes);
    let mut child =
        Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("run");
    child.stdin.take().expect("piped").write_all(&bytes[..length]).expect("written");
    let output = child.wait_with_output().expect("an end");
    assert!(output.status.success(), "{}", output.status);

    let (answered, body) = decode(&output.stdout).expect("a datagram");
    assert_eq!((answered.session, answered.sequence, answered.received), (42, 1, 17));
    assert_eq!(answered.clock, measurement.sampled);
    let Body::Command(command) = body else { panic!("{body:?}") };
    assert!(command.is_enabled && command.count == 2);
    let axes = command.axes.map(|axis| (axis.motor_speed, axis.holding_valve));
    assert_eq!(axes[..2], [(0.25, 1.0), (-1.0, 0.0)]);
}

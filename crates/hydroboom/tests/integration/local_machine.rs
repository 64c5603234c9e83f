//! `run --machine`: an attachment that fails is reported with advice. Complete courses of machines in other
//! processes are in `crates/realtime/tests/integration/machine_examples.rs`.

use crate::support::command;
use crate::support::command::hydroboom;
use hydroboom_machine_interface::datagram::{
    Body, Header, Hello, LONGEST, MOST_AXES, Peer, VERSION, encode,
};
use std::io::{BufRead, BufReader, Read};
use std::net::{Ipv4Addr, UdpSocket};
use std::process::{Child, Command, Stdio};

/// Text of a message without its line breaks and line marks.
fn in_one_line(text: &str) -> String {
    text.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
}

/// Unused port.
fn free_port() -> u16 {
    UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap().port()
}

/// Run that waits for a machine, and its further output.
fn waiting(port: u16) -> (Child, BufReader<impl Read>) {
    let machine = format!("udp:{port}");
    let mut run = Command::new(env!("CARGO_BIN_EXE_hydroboom"))
        .args(["run", "--simulated-time", "--machine", &machine])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = BufReader::new(run.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("waiting for a machine") {
        line.clear();
        assert!(stderr.read_line(&mut line).unwrap() > 0, "it does not say what it waits for");
    }
    (run, stderr)
}

#[test]
fn a_machine_that_cannot_be_attached_is_refused_with_the_reason() {
    let taken = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = format!("udp:{}", taken.local_addr().unwrap().port());
    for (machine, named) in [
        ("udp:99999", "1 to 65535"),
        ("udp:", "1 to 65535"),
        ("ethercat:", "no network interface"),
        ("ethercat:lo", "clocks of their own"),
        ("virtual:../../cranes", "directory"),
        ("../../cranes", "directory"),
        (port.as_str(), "another program uses it"),
    ] {
        let output = hydroboom(&["run", "--simulated-time", "--machine", machine]);
        let message = in_one_line(&String::from_utf8_lossy(&output.stderr));
        assert!(!output.status.success() && message.contains(named), "{machine}: {message}");
    }
}

#[test]
fn an_unusable_bus_is_reported_before_anything_else_is_done() {
    let page = include_str!("../../../../docs/reference/ethercat-table.md");
    let table = page.split_once("```toml\n").unwrap().1.split_once("```").unwrap().0;
    let file = command::files("a_bus_that_cannot_be_opened");
    let (bus, slow) = (file("bus.toml"), file("slow.toml"));
    std::fs::write(&bus, table).unwrap();
    std::fs::write(&slow, table.replace("period_us       = 1000", "period_us = 2000")).unwrap();
    for (arguments, parts) in [
        (vec!["ethercat:lo"], ["[machine.ethercat]", "--bus FILE"]),
        (vec!["ethercat:lo", "--bus", &slow], ["2000 us", "control_period_ms is 1 ms"]),
        (vec!["ethercat:nowhere0", "--bus", &bus], ["no network interface nowhere0", "lo"]),
        (vec!["ethercat:lo", "--bus", &bus], ["loopback", "first device"]),
        (vec!["virtual", "--bus", &bus], ["--bus", "ethercat:eth1"]),
    ] {
        refuses(&[&["run", "--auto", "--machine"], &arguments[..]].concat(), parts);
    }
    for (arguments, parts) in [
        (vec!["--bus", "lo"], ["[machine.ethercat]", "--table FILE"]),
        (vec!["--bus", "nowhere0", "--table", &bus], ["no network interface nowhere0", "lo"]),
        (vec!["--bus", "lo", "--table", &bus], ["loopback", "first device"]),
        (vec!["--table", &bus], ["--bus <INTERFACE>", "required"]),
    ] {
        refuses(&[&["doctor"], &arguments[..]].concat(), parts);
    }
}

fn refuses(arguments: &[&str], parts: [&str; 2]) {
    let output = hydroboom(arguments);
    let message = in_one_line(&String::from_utf8_lossy(&output.stderr));
    assert!(!output.status.success(), "{arguments:?}: {message}");
    for part in parts {
        assert!(message.contains(part), "{arguments:?}: {part} is not in: {message}");
    }
}

#[test]
fn run_waits_for_a_machine_and_reports_a_mismatch() {
    let port = free_port();
    let (mut run, mut stderr) = waiting(port);
    assert!(run.try_wait().unwrap().is_none());
    let hello = Hello {
        peer: Peer::SimulatedMachine,
        period: 2_000_000,
        newest_version: VERSION,
        axes: 1,
        firmware: 0,
        ranges: [[[f64::NAN; 2]; 7]; MOST_AXES],
    };
    let mut bytes = [0; LONGEST];
    let length = encode(&Header::default(), &Body::Hello(hello), &mut bytes);
    let machine = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    machine.send_to(&bytes[..length], (Ipv4Addr::LOCALHOST, port)).unwrap();
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).unwrap();
    assert!(!run.wait().unwrap().success());
    let rest = in_one_line(&rest);
    assert!(rest.contains("2000000 ns") && rest.contains("control_period_ms"), "{rest}");
}

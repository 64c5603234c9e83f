//! `commission` on the virtual crane, and `run` at machines that were and were not commissioned.

use crate::support::command::{fails_with, files, hydroboom};
use hydroboom_machine_interface::datagram::{
    Body, Header, Hello, LONGEST, MOST_AXES, MeasuredAxis, Measurement, Peer, VERSION, decode,
    encode,
};
use hydroboom_machine_interface::session::Session;
use hydroboom_machine_interface::signal::{MEASURED, MachineState};
use std::net::{Ipv4Addr, UdpSocket};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A run at a UDP port, and a machine that has begun a session with it.
struct Attached {
    run: Child,
    socket: UdpSocket,
    session: Session,
    sampled: u64,
}

impl Attached {
    fn new(peer: Peer, firmware: u64, arguments: &[&str]) -> Self {
        let free = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = free.local_addr().unwrap().port();
        drop(free);
        let machine = format!("udp:{port}");
        let run = Command::new(env!("CARGO_BIN_EXE_hydroboom"))
            .args(["run", "--machine", &machine])
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        socket.connect((Ipv4Addr::LOCALHOST, port)).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
        let hello = Hello {
            peer,
            period: 1_000_000,
            newest_version: VERSION,
            axes: 1,
            firmware,
            ranges: [[[f64::NAN; 2]; MEASURED.len()]; MOST_AXES],
        };
        let mut bytes = [0; LONGEST];
        let session = loop {
            let length = encode(&Header::default(), &Body::Hello(hello), &mut bytes);
            // refused while the port is not open yet
            let _ = socket.send(&bytes[..length]);
            if let Ok(length) = socket.recv(&mut bytes) {
                break Session::new(decode(&bytes[..length]).unwrap().0.session);
            }
        };
        Self { run, socket, session, sampled: 0 }
    }

    /// Sends a measurement.
    fn measure(&mut self) {
        self.sampled += 1_000_000;
        let mut sent = Measurement {
            sampled: self.sampled,
            state: MachineState::Ready,
            count: 1,
            ..Measurement::default()
        };
        sent.axes[0] = MeasuredAxis {
            signals: [0.2, 1e5, 70e5, 5e5, 5e5, 5e5, 0.0],
            ..MeasuredAxis::default()
        };
        let header = self.session.next_header(self.sampled);
        let mut bytes = [0; LONGEST];
        let length = encode(&header, &Body::Measurement(sent), &mut bytes);
        let _ = self.socket.send(&bytes[..length]);
    }

    /// What it says when it ends by itself, in one line.
    fn end(mut self) -> String {
        self.measure();
        let output = self.run.wait_with_output().unwrap();
        assert!(!output.status.success());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
    }
}

#[test]
fn the_virtual_crane_is_commissioned_and_its_record_is_of_no_real_machine() {
    let file = files("commission_virtual");
    let record = file("virtual.toml");
    let done = hydroboom(&[
        "commission",
        "--machine",
        "virtual",
        "--simulated-time",
        "--json",
        "--record",
        &record,
    ]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let json: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!((&json["passed"], &json["is_simulated"]), (&true.into(), &true.into()));
    assert_eq!(json["steps"].as_array().unwrap().len(), 9);
    assert!(json["steps"][6]["measured"]["position_over_pump_volume"].is_number());
    let text = std::fs::read_to_string(&record).unwrap();
    assert!(text.contains("result = \"passed\"") && text.contains("noise_stroke_m"), "{text}");

    let said = Attached::new(Peer::RealMachine, 0, &["--auto"]).end();
    assert!(said.contains("no record of its commissioning is named"), "{said}");
    assert!(said.contains("--commissioning FILE"), "{said}");
    let arguments = ["--auto", "--commissioning", &record, "--set", "payload.mass_kg=300"];
    let said = Attached::new(Peer::RealMachine, 0x17, &arguments).end();
    for named in ["a simulated one was commissioned", "crane file", "identity of", "not moved"] {
        assert!(said.contains(named), "{named} is not in: {said}");
    }
}

#[test]
fn options_that_do_not_fit_and_a_load_without_room_are_refused() {
    let file = files("commission_refused");
    let record = file("record.toml");
    let of = |arguments: &[&str]| {
        hydroboom(&[&["commission", "--record", &record, "--machine"], arguments].concat())
    };
    fails_with(&of(&["udp:8150", "--simulated-time"]), "only the virtual crane");
    fails_with(&of(&["virtual", "--bus", "Cargo.toml"]), "--bus");
    let nowhere = file("no-such-folder/record.toml");
    let unwritten =
        ["commission", "--machine", "virtual", "--simulated-time", "--record", &nowhere];
    fails_with(&hydroboom(&unwritten), "does not begin without its record");
    // a held load near its upper stop leaves no room for the travel
    let at_the_stop = [
        "motion.start_mm=496",
        "motion.end_mm=499",
        "motion.fast_mm_s=5",
        "motion.slow_mm_s=2",
        "motion.ramp_s=0.3",
    ]
    .map(|set| ["--set", set]);
    let failed = of(&[&["virtual", "--simulated-time"], &at_the_stop.concat()[..]].concat());
    assert!(!failed.status.success());
    let text = std::fs::read_to_string(&record).unwrap();
    assert!(text.contains("result = \"failed\"") && text.contains("not reached"), "{text}");
}

#[test]
fn a_run_that_listens_enables_nothing_and_needs_no_record() {
    let mut attached = Attached::new(Peer::RealMachine, 0, &["--listen"]);
    let (mut bytes, mut commands) = ([0; LONGEST], 0);
    attached.socket.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
    for _ in 0..20_000 {
        attached.measure();
        if let Ok(length) = attached.socket.recv(&mut bytes)
            && let Some((_, Body::Command(command))) = attached.session.accept(&bytes[..length])
        {
            assert!(!command.is_enabled);
            let axis = command.axes[0];
            assert_eq!((axis.motor_speed, axis.holding_valve), (0.0, 0.0));
            commands += 1;
        }
        if commands >= 200 {
            break;
        }
    }
    attached.run.kill().unwrap();
    attached.run.wait().unwrap();
    assert!(commands >= 200, "{commands}");
}

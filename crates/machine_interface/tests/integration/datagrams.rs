//! Datagrams: what is sent arrives, and what is not whole, old or foreign is dropped and counted.

use hydroboom_machine_interface::datagram::{
    Body, Command, CommandedAxis, Dropped, Header, Hello, LONGEST, MOST_AXES, Measurement, Peer,
    VERSION, decode, encode,
};
use hydroboom_machine_interface::session::Session;
use hydroboom_machine_interface::signal::{MachineState, Validity, ValveState};

const HEADER: Header =
    Header { session: 0x0123_4567_89ab_cdef, sequence: 5, received: 4, clock: 9 };

fn datagram(header: &Header, body: &Body) -> Vec<u8> {
    let mut bytes = [0; LONGEST];
    let length = encode(header, body, &mut bytes);
    bytes[..length].to_vec()
}

/// A body of each kind, of some axes.
fn bodies(axes: usize) -> [Body; 3] {
    let hello = Hello {
        peer: Peer::SimulatedMachine,
        period: 1_000_000,
        newest_version: VERSION,
        axes,
        firmware: 0x0102_0304_0506_0708,
        ranges: [[[-1.5, 4e7]; 7]; MOST_AXES],
    };
    let mut measurement = Measurement {
        sampled: 77,
        state: MachineState::Enabled,
        fault: 0x7500,
        count: axes,
        ..Default::default()
    };
    let mut command = Command { is_enabled: true, count: axes, ..Default::default() };
    for k in 0..axes {
        let axis = &mut measurement.axes[k];
        axis.signals = std::array::from_fn(|i| (i + 10 * k) as f64 + 0.1);
        axis.validity[2] = Validity::OutOfRange;
        axis.valve = ValveState::Open;
        command.axes[k] = CommandedAxis { motor_speed: -3.25 * k as f64, holding_valve: 1.0 };
    }
    [Body::Hello(hello), Body::Measurement(measurement), Body::Command(command)]
}

#[test]
fn datagrams_of_any_number_of_axes_are_decoded_as_encoded() {
    for axes in 1..=MOST_AXES {
        for sent in bodies(axes) {
            let bytes = datagram(&HEADER, &sent);
            assert!(bytes.len() <= LONGEST);
            let (header, body) = decode(&bytes).expect("a whole datagram");
            assert_eq!(header, HEADER);
            match (sent, body) {
                // ranges beyond the axes are not sent, and not known
                (Body::Hello(sent), Body::Hello(read)) => {
                    assert_eq!(read.ranges[..axes], sent.ranges[..axes]);
                    assert!(read.ranges[axes..].iter().flatten().flatten().all(|n| n.is_nan()));
                }
                (sent, read) => assert_eq!(sent, read),
            }
        }
    }
}

/// The check sum is the one of zlib and Ethernet: any language has it.
#[test]
fn the_check_sum_is_crc_32() {
    assert_eq!(crc32fast::hash(b"123456789"), 0xcbf4_3926);
    let bytes = datagram(&HEADER, &bodies(1)[2]);
    let (all, sum) = bytes.split_at(bytes.len() - 4);
    // bit by bit, polynomial 0xEDB88320
    let expected = !all.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| {
            sum >> 1 ^ (0xedb8_8320 & (sum & 1).wrapping_neg())
        })
    });
    assert_eq!(sum, expected.to_le_bytes());
}

#[test]
fn a_datagram_with_any_byte_changed_or_cut_off_is_dropped() {
    for body in bodies(2) {
        let whole = datagram(&HEADER, &body);
        for at in 0..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 0x10;
            assert!(decode(&changed).is_err(), "byte {at}");
            assert!(decode(&whole[..at]).is_err(), "{at} bytes");
        }
        assert_eq!(decode(&[&whole[..], &[0]].concat()), Err(Dropped::Length));
    }
    assert_eq!(decode(b"GET / HTTP/1.1"), Err(Dropped::Magic));
}

#[test]
fn numbers_that_are_not_finite_are_dropped_unless_they_are_marked() {
    let [_, Body::Measurement(mut measurement), Body::Command(mut command)] = bodies(1) else {
        panic!("a measurement and a command");
    };
    // marked as out of range
    measurement.axes[0].signals[2] = f64::NAN;
    assert!(decode(&datagram(&HEADER, &Body::Measurement(measurement))).is_ok());
    measurement.axes[0].signals[3] = f64::INFINITY;
    let bytes = datagram(&HEADER, &Body::Measurement(measurement));
    assert_eq!(decode(&bytes), Err(Dropped::NotFinite));
    command.axes[0].motor_speed = f64::NAN;
    assert_eq!(decode(&datagram(&HEADER, &Body::Command(command))), Err(Dropped::NotFinite));
}

#[test]
fn a_session_accepts_each_datagram_once_in_order_and_counts_the_rest() {
    let mut machine = Session::new(HEADER.session);
    let [hello, _, command] = bodies(1);
    let of = |session, sequence| datagram(&Header { session, sequence, ..HEADER }, &command);
    assert!(machine.accept(&datagram(&Header { sequence: 0, ..HEADER }, &hello)).is_some());
    assert!(machine.accept(&of(HEADER.session, 1)).is_some());
    // two are lost, then an old one and the same once more
    assert!(machine.accept(&of(HEADER.session, 4)).is_some());
    assert!(machine.accept(&of(HEADER.session, 3)).is_none());
    assert!(machine.accept(&of(HEADER.session, 4)).is_none());
    assert!(machine.accept(&of(HEADER.session + 1, 9)).is_none());
    let mut changed = of(HEADER.session, 5);
    changed[60] ^= 1;
    assert!(machine.accept(&changed).is_none());
    assert!(machine.accept(b"HYDM").is_none());
    let counters = machine.counters;
    assert_eq!((counters.accepted, counters.lost, counters.sequence), (3, 2, 2));
    assert_eq!((counters.session, counters.check_sum, counters.malformed), (1, 1, 1));
    assert_eq!(counters.dropped(), 5);
    // what is sent next says what was accepted last
    let header = machine.next_header(0);
    assert_eq!((header.sequence, header.received), (1, 4));
}

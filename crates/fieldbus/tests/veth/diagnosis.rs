//! By hand, for four seconds: a diagnosis over the interfaces, in real time.
//!
//! ```sh
//! cargo test -p hydroboom-fieldbus --test veth diagnosis -- --ignored --nocapture
//! ```

use crate::{BUS, is_in_its_namespace, lay_cable, play, table_of_three};
use hydroboom_fieldbus::diagnosis::{HostFacts, Stage, diagnose_in_real_time};
use hydroboom_fieldbus::raw_socket::RawSocket;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

#[test]
#[ignore = "four seconds in real time: by hand"]
fn of_right_devices_at_a_network_interface_only_times_may_be_wrong() {
    if !is_in_its_namespace(
        "diagnosis::of_right_devices_at_a_network_interface_only_times_may_be_wrong",
    ) {
        return;
    }
    lay_cable();
    let table = table_of_three();
    let (stop, is_ready) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|scope| {
        let devices = scope.spawn(|| play(&table, &stop, &is_ready));
        while !is_ready.load(Ordering::Acquire) {
            thread::yield_now();
        }
        let (socket, host) = (RawSocket::open(BUS).unwrap(), HostFacts::read(BUS));
        let diagnosis = diagnose_in_real_time(table.clone(), socket, host, 1).unwrap();
        stop.store(true, Ordering::Release);
        let states = devices.join().unwrap();
        println!("{:#?}", diagnosis.findings);
        println!("{:?}\n{:#?}", diagnosis.host, diagnosis.bus.listening);
        // a computer that is held up by other work is told
        assert!(diagnosis.findings.iter().all(|found| found.stage >= Stage::State));
        assert_eq!(diagnosis.bus.line.len(), 3);
        assert_eq!(states, ["(Init, None)"; 3]);
    });
}

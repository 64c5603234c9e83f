//! Start-up and cyclic operation.

use crate::bench::{bus, table};
use hydroboom_control::command::Command;
use hydroboom_control::measurement::Validity;
use hydroboom_fieldbus::machine::MachineState;
use hydroboom_realtime::machine::Machine;

#[test]
fn four_devices_go_to_op_and_exchange_with_the_right_working_counter_in_every_cycle() {
    for exchanges in [1, 2] {
        let (mut bus, _) = bus(table(|table| table.bus.exchanges = exchanges));
        let mut machine = bus.take_machine().unwrap();
        // drive 3, inputs 1, outputs 2
        assert_eq!(bus.working_counter(), 6);
        for sequence in 1..=500 {
            bus.measure();
            machine.write(sequence, &Command::released([12.0]));
            bus.act();
        }
        let counters = bus.counters();
        assert_eq!((counters.cycles, counters.exchanges), (500, 500 * u64::from(exchanges)));
        assert_eq!((counters.lost, counters.low, counters.unexpected), (0, 0, 0));
        assert_eq!(machine.state(), MachineState::Enabled);
        let axis = machine.read().unwrap().measurement.axes[0];
        assert!((axis.signals.motor_speed - 12.0).abs() < 1e-5, "{}", axis.signals.motor_speed);
        assert!((axis.signals.stroke - 0.25).abs() < 1e-5, "{}", axis.signals.stroke);
        assert!(axis.validity.to_array().iter().all(|v| *v == Validity::Good), "{axis:?}");
    }
}

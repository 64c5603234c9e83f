//! The virtual crane behind the bus, against the same crane without one.

use crate::bench::enabled;
use crate::bench::{Behind, SimulatedLink, segment, table};
use hydroboom_control::command::{AxisCommand, Command};
use hydroboom_control::measurement::{AxisMeasurement, AxisSignals, Measurement};
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::supervisor::State;
use hydroboom_description::Description;
use hydroboom_design::limits;
use hydroboom_fieldbus::bus::Bus;
use hydroboom_fieldbus::machine::MachineState;
use hydroboom_fieldbus::table::{Scale, Table};
use hydroboom_realtime::control_task::{ControlTask, Period, Record};
use hydroboom_realtime::course::Course;
use hydroboom_realtime::machine::{Incoming, Machine};
use hydroboom_realtime::operator::Operator;
use hydroboom_realtime::simulation_task::SimulationTask;
use hydroboom_virtual_crane::VirtualCrane;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

const HELD: AxisCommand<f64> = AxisCommand { motor_speed: 0.0, holding_valve: 0.0 };
const STRATEGY: Strategy = Strategy::BenchmarkClosedLoop;

/// The executive of a course at 120 mm/s, which releases the load, moves it and holds it.
struct Executive {
    control: ControlTask,
    simulation: SimulationTask,
    operator: Operator,
    steps: u32,
}

impl Executive {
    fn new(model: &Description) -> Self {
        let n = &model.numbers;
        let motion = model.motion(n.fast);
        let limits = limits(model, n.fast).unwrap();
        Self {
            control: ControlTask::new(model, Course::new(Arc::new(motion)), limits, STRATEGY),
            simulation: SimulationTask::new(model, n.motion_start).unwrap(),
            operator: Operator::automatic(n.control_period),
            steps: (n.control_period / n.simulation_period).round() as u32,
        }
    }

    fn period(&mut self, incoming: Option<Incoming>) -> Record {
        let record = self.control.period(&Period {
            elapsed: 1e-3,
            incoming,
            simulated: Some(self.simulation.simulated()),
            request: self.operator.request(),
            strategy: STRATEGY,
            missed: 0,
            attended: true,
            clock_jumped: false,
            deadlines: None,
        });
        self.operator.see(&record.decision);
        if let Some(speed) = self.control.simulated_motor() {
            (0..self.steps).for_each(|_| self.simulation.step(speed));
        }
        record
    }
}

/// The virtual crane with its load held; the bus has the delay, the crane's own is off.
fn machine() -> VirtualCrane {
    let mut crane = Description::uia_virtual().unwrap();
    crane.set("fieldbus.delay_cycles=0").unwrap();
    let mut start = crane.start(crane.numbers.motion_start);
    start.preload = 0.0;
    VirtualCrane::new(&crane, &start).unwrap()
}

/// True piston positions of a course over the bus \[m\].
fn over_the_bus(model: &Description) -> (Vec<f64>, Bus<SimulatedLink>) {
    let behind = Rc::new(RefCell::new(Behind { crane: Some(machine()), ..Behind::default() }));
    let mut bus =
        Bus::start(table(|_| {}), SimulatedLink::new(segment(&behind, |_, _| {}))).unwrap();
    let mut attached = bus.take_machine().unwrap();
    // the drive is enabled first, the load held
    let mut sequence = 0;
    while attached.state() != MachineState::Enabled {
        bus.measure();
        sequence += 1;
        attached.write(sequence, &enabled(Command { axes: [HELD] }));
        bus.act();
        assert!(sequence < 100, "{bus:?}");
    }
    let mut executive = Executive::new(model);
    let mut positions = Vec::new();
    while !executive.operator.is_done() {
        bus.measure();
        let record = executive.period(attached.read());
        sequence += 1;
        attached.write(sequence, &enabled(Command { axes: [record.decision.command] }));
        // half way between two SYNC0, under what was taken over at the last one
        behind.borrow_mut().advance();
        bus.act();
        positions.push(behind.borrow().crane.as_ref().unwrap().truth().outputs.stroke);
        assert!(positions.len() < 60_000);
    }
    (positions, bus)
}

/// The same without a bus: measured and commanded with or without the rounding of a table, acted on one period later.
fn directly(model: &Description, rounding: Option<&Table>) -> Vec<f64> {
    let mut crane = machine();
    let mut executive = Executive::new(model);
    let mut on_the_way = HELD;
    let mut positions = Vec::new();
    while !executive.operator.is_done() {
        let mut signals = crane.signals();
        if let Some(table) = rounding {
            let mut rounded = signals.to_array();
            for row in &table.measured {
                rounded[row.signal] = round(&row.scale, rounded[row.signal]);
            }
            signals = AxisSignals::from_array(rounded);
        }
        let number = positions.len() as u64 + 1;
        let axes = [AxisMeasurement::new(signals)];
        let measurement = Measurement { number, axes, time: crane.time() };
        let record = executive.period(Some(Incoming::new(measurement, None)));
        let mut command = record.decision.command;
        if let Some(table) = rounding {
            command.motor_speed = round(&table.commanded[0].scale, command.motor_speed);
        }
        crane.advance(&std::mem::replace(&mut on_the_way, command)).unwrap();
        positions.push(crane.truth().outputs.stroke);
        assert!(positions.len() < 60_000);
        if number == 1 {
            assert_ne!(record.decision.state, State::Fault);
        }
    }
    positions
}

fn round(scale: &Scale, value: f64) -> f64 {
    scale.value(scale.counts(value))
}

fn farthest(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_course_over_the_bus_is_that_of_the_crane_with_the_tables_rounding_and_the_same_delay() {
    let model = Description::uia_single_boom().unwrap();
    let (over_the_bus, bus) = over_the_bus(&model);
    let rounded = directly(&model, Some(bus.table()));
    let exact = directly(&model, None);
    let travel = over_the_bus.iter().fold(0.0_f64, |most, x| most.max(x - over_the_bus[0]));
    assert!(travel > 0.2, "it moved {travel} m");
    let counters = bus.counters();
    assert_eq!((counters.lost, counters.low, counters.without_command), (0, 0, 0));
    assert_eq!(over_the_bus.len(), rounded.len());
    let apart = farthest(&over_the_bus, &rounded);
    assert!(apart < 1e-9, "{apart} m beside the rounded run");
    let apart = farthest(&over_the_bus, &exact);
    println!("{apart:e} m by rounding, over {} s", 1e-3 * over_the_bus.len() as f64);
    assert!(apart < 0.05e-3, "{apart} m beside the exact run");
}

//! A third of an hour in simulated time: no drift and no growth. In a process of its own, because memory is measured
//! per process.

#![expect(clippy::unwrap_used, reason = "a test that cannot set up has failed")]

use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_realtime::control_task::Record;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::lockstep::{Lockstep, Pace, run};
use hydroboom_realtime::session::{Attendant, Ending, Lookout, Order, Session};
use std::sync::Arc;

const CLOSED: Strategy = Strategy::SimulationFeedforwardClosedLoop;

#[test]
fn the_last_of_fifty_courses_is_as_accurate_as_the_first() {
    let model = Description::uia_single_boom().unwrap();
    let mut machine = Description::uia_virtual().unwrap();
    // the executive is tested, not the machine: one machine step per control period is a quarter of the
    // work
    machine.set("virtual.step_us=1000").unwrap();
    let motion = machine.motion(model.numbers.fast);
    let each = 24.0;
    let courses = 50;
    let desk = Arc::new(Desk::new(CLOSED));
    let mut soak = Soak {
        session: Session::new(&model),
        desk: Arc::clone(&desk),
        motion,
        each,
        courses,
        begun: 0,
        errors: vec![],
        memory: vec![],
    };
    let lockstep = Lockstep::new(&model, &machine, motion, CLOSED).unwrap();
    let lookout = Lookout { desk: &desk, attendant: &mut soak, ending: Ending::OnceClosed };
    run(lockstep, &machine, lookout, Pace::Free).unwrap();
    assert!(
        soak.session.fault().is_none(),
        "{:?}",
        soak.session.fault().map(|f| (f.time, f.cause))
    );
    let rms: Vec<f64> =
        soak.errors.iter().map(|(sum, count)| (sum / f64::from(*count)).sqrt() * 1e3).collect();
    assert_eq!(rms.len() as u32, courses);
    // the oil warms by a few degrees; courses differ by that and by sensor noise
    let (first, last) = (rms[1], rms[rms.len() - 1]);
    assert!((last / first - 1.0).abs() < 0.15, "{first} mm at first, {last} mm at last");
    assert!(rms.iter().all(|r| (r / first - 1.0).abs() < 0.2), "{rms:?}");
    let (early, late) = (soak.memory[5], soak.memory[soak.memory.len() - 1]);
    assert!(late - early < 340.0, "memory grew from {early} to {late} kB");
    assert_eq!(soak.session.synchronised_in_all(), 0);
}

/// Runs one course after the other, and sums up.
struct Soak {
    session: Session,
    desk: Arc<Desk>,
    motion: OutAndBack<f64>,
    each: f64,
    courses: u32,
    begun: u32,
    errors: Vec<(f64, u32)>,
    memory: Vec<f64>,
}

impl Attendant for Soak {
    fn see(&mut self, record: &Record) {
        self.session.see(record);
        if let (Some(error), Some((sum, count))) = (record.error(), self.errors.last_mut()) {
            *sum += error * error;
            *count += 1;
        }
    }

    fn orders(&mut self) -> Vec<Order> {
        let now = self.session.last().map_or(0.0, |r| r.time);
        if now < 0.5 + self.each * f64::from(self.begun) {
            return self.session.orders();
        }
        if self.begun == self.courses {
            self.desk.close();
            return vec![];
        }
        self.begun += 1;
        self.errors.push((0.0, 0));
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        self.memory.push(line.split_whitespace().nth(1).unwrap().parse().unwrap());
        let orders = self.session.prepare(Arc::new(self.motion), vec![]).unwrap();
        self.desk.start();
        orders
    }
}

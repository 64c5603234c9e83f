//! Machine on the local interface in simulated time: one measurement, one command per period. The clock is
//! the number of periods.

use crate::bus_task::BusTask;
use crate::control_task::{ControlTask, Period, Record};
use crate::desk::Desk;
use crate::local_machine::LocalMachine;
use crate::lockstep::Periods;
use crate::machine::{Machine, Outgoing};
use crate::operator::Operator;
use crate::posix::now;
use crate::session::Order;
use crate::simulation_task::SimulationTask;
use hydroboom_virtual_crane::Truth;
use std::convert::Infallible;

/// Time without a measurement after which the machine is silent \[ns of the computer's clock\]. Simulated
/// time then continues without it.
const SILENT: u64 = 2_000_000_000;
/// Waiting time per period for a machine that is already silent \[ns\].
const STILL_SILENT: u64 = 1_000_000;

/// Control task and simulation in simulated time, with a machine in another process.
pub struct LocalLockstep {
    control: ControlTask,
    simulation: SimulationTask,
    machine: LocalMachine,
    /// Bus task, which owns the controller's endpoint.
    pub bus: BusTask,
    /// Control period \[s\].
    period: f64,
    /// Simulation steps per control period.
    steps: u32,
    /// Periods since the start.
    periods: u64,
    /// Time without a measurement after which the machine is silent \[ns of the computer's clock\].
    time_out: u64,
    /// Number of the newest measurement, and periods since it without a measurement.
    number: u64,
    silent: u64,
}

impl LocalLockstep {
    /// Tasks with a machine on the local interface. `periods` are those of simulation and control \[s\]; the second is
    /// a multiple of the first.
    pub fn new(
        (control, simulation): (ControlTask, SimulationTask),
        (bus, machine): (BusTask, LocalMachine),
        periods: (f64, f64),
    ) -> Self {
        Self {
            control,
            simulation,
            machine,
            bus,
            period: periods.1,
            steps: (periods.1 / periods.0).round() as u32,
            periods: 0,
            time_out: SILENT,
            number: 0,
            silent: 0,
        }
    }

    /// The tasks without waiting for measurements, for a machine in this thread: its measurement is either there
    /// already or lost.
    #[must_use]
    pub fn without_waiting(self) -> Self {
        Self { time_out: 0, ..self }
    }

    /// Executes a period in which the control task is suspended and the bus task is not.
    pub fn stalled_period(&mut self) {
        let clock = self.next_period();
        self.wait(clock);
        self.bus.answer(clock);
    }

    /// Time of the next period \[ns\].
    fn next_period(&mut self) -> u64 {
        self.periods += 1;
        (self.periods as f64 * self.period * 1e9).round() as u64
    }

    /// Executes one control period: waits for a measurement and sends the command that answers it. After two seconds
    /// without one the machine is silent, and simulated time continues without it.
    pub fn period(&mut self, operator: &mut Operator, desk: &Desk) -> Record {
        let clock = self.next_period();
        self.wait(clock);
        let incoming = self.machine.read();
        let number = incoming.map_or(self.number, |incoming| incoming.measurement.number);
        // a lost measurement still advances the machine's time by a period
        let passed = match number.saturating_sub(self.number) {
            0 => 1,
            more => more.saturating_sub(self.silent).max(1),
        };
        self.silent = if number == self.number { self.silent + 1 } else { 0 };
        self.number = number;
        let record = self.control.period(&Period {
            elapsed: passed as f64 * self.period,
            incoming,
            simulated: Some(self.simulation.simulated()),
            request: operator.request(),
            strategy: desk.strategy(),
            missed: 0,
            attended: desk.is_attended(),
            clock_jumped: false,
            deadlines: None,
        });
        operator.see(&record.decision);
        self.machine.write(self.periods, &Outgoing::of(&record.decision));
        self.bus.answer(clock);
        self.simulation.set_conditions(&self.control.conditions());
        self.simulation.set_command_delay(self.control.command_delay());
        if let Some(speed) = self.control.simulated_motor() {
            (0..self.steps).for_each(|_| self.simulation.step(speed));
        }
        record
    }

    /// Waits for a measurement until the time-out.
    fn wait(&mut self, clock: u64) {
        let most = if self.silent > 0 { self.time_out.min(STILL_SILENT) } else { self.time_out };
        let until = now() + most;
        loop {
            self.bus.receive(clock);
            // the first measurement may have arrived before the run began
            let newest = self.machine.read();
            let left = until.saturating_sub(now());
            if left == 0 || newest.is_some_and(|it| it.measurement.number != self.number) {
                return;
            }
            self.bus.wait(left);
        }
    }
}

impl Periods for LocalLockstep {
    type Error = Infallible;

    fn duration(&self) -> f64 {
        self.period
    }

    fn take(&mut self, order: Order) {
        match order {
            Order::Course(course) => self.control.take(course),
            Order::Synchronise(at) => self.simulation.synchronise(&at),
            // faults cannot be injected into an external machine
            Order::Tamper(_) => {}
        }
    }

    fn next(
        &mut self,
        operator: &mut Operator,
        desk: &Desk,
    ) -> Result<(Option<Truth>, Record), Infallible> {
        Ok((None, self.period(operator, desk)))
    }
}

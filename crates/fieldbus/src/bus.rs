//! Bus: the cycle in SAFEOP and OP, which a bus task calls in real time, and a loop in simulated time.
//!
//! ```text
//! SYNC0          SYNC0          inputs are latched and outputs applied at SYNC0
//!   | A      B     |            A: inputs are read; B: outputs are sent
//!   two exchanges: outputs act one period after the inputs that they answer
//!   one exchange:  A alone, with the outputs computed in the cycle before: two periods after
//! ```
//!
//! A lost frame is not sent again: the measurement ages, and more losses in a window than the table allows are a
//! fault. Where no new command came for two periods, the safe command is sent: target velocity zero and valve shut;
//! enabled drives brake with torque for the braking time of the table.
//!
//! A bus that was started in SAFEOP requests OP once a command enables drives.

mod exchange;
mod outputs;

use crate::check::DeviceFacts;
use crate::cycle_record::CycleRecord;
use crate::drive::Drive;
use crate::fault::{Fault, LossWindow};
use crate::frame_ring::FrameRing;
use crate::input_decoding::decode;
use crate::link::Link;
use crate::machine::{BusSide, FieldbusMachine, hand_over};
use crate::pace::Pace;
use crate::start_up::{Devices, InitialState, OP, SAFE_OP, StartError, request, to_init};
use crate::statistics::{Counters, Times};
use crate::table::Table;
use crate::time::now;
use crate::wire::Wire;
use ethercrab::RegisterAddress;
use ethercrab::subdevice_group::SafeOp;
use hydroboom_realtime::machine::{Delay, Incoming, Link as Attachment, Outgoing};
use rtrb::{Consumer, Producer, RingBuffer};

/// Time before the next exchange, or before the end of the period, at which the wait for an answer ends \[ns\].
pub(crate) const MARGIN: u64 = 50_000;
/// Capacity of the queue of records to the log: four seconds at 1 ms.
const RECORDS: usize = 4096;
/// Longest wait at the end of the bus for drives to switch off, after their braking time \[ns\].
const UNTIL_OFF: u64 = 500_000_000;

/// Transition of the devices from SAFEOP to OP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transition {
    /// The devices are in SAFEOP.
    SafeOp,
    /// OP is to be requested.
    Due,
    /// OP was requested at a time \[ns\].
    Requested(u64),
    /// All devices have reached OP.
    Op,
}

impl Transition {
    /// Whether a device may be in a state.
    fn allows(self, state: u8) -> bool {
        match self {
            Self::SafeOp | Self::Due => state == SAFE_OP,
            Self::Requested(_) => state == SAFE_OP || state == OP,
            Self::Op => state == OP,
        }
    }
}

/// A bus in SAFEOP or OP.
pub struct Bus<L> {
    table: Table,
    facts: Vec<DeviceFacts>,
    wire: Wire<L>,
    /// Devices; the type stays that of the state in which the exchange of process data began.
    group: Devices<SafeOp>,
    initial_state: InitialState,
    transition: Transition,
    pace: Pace,
    inputs: Vec<Vec<u8>>,
    outputs: Vec<Vec<u8>>,
    working_counter: u16,
    drives: Vec<Drive>,
    side: BusSide,
    machine: Option<FieldbusMachine>,
    number: u64,
    /// The last command, and its age \[periods\]; none before the first command at rest.
    command: Option<(Outgoing, u32)>,
    /// SYNC0 of the measurement that the command to be sent next answers \[ns\]; none once it was sent.
    answers: Option<u64>,
    delay: Option<Delay>,
    times: Times,
    /// The first fault, and when it came \[ns\].
    fault: Option<(Fault, u64)>,
    lost: LossWindow,
    wrong_working_counters: LossWindow,
    /// Losses and SYNC0 of this cycle.
    cycle: CycleStatus,
    counters: Counters,
    /// A device that left its state, or did not reach OP, whose AL status code is still to be read.
    dropped: Option<u16>,
    /// Whether drives are being switched off for good.
    is_ending: bool,
    /// Whether a person has reset a fault that needs a restart of the bus from INIT.
    is_restart_due: bool,
    record: CycleRecord,
    /// Queue to the log; none where no records were requested.
    records: Option<Producer<CycleRecord>>,
}

/// Losses, wrong working counters and SYNC0 of a cycle's exchanges.
#[derive(Clone, Copy, Debug, Default)]
struct CycleStatus {
    is_lost: bool,
    has_wrong_working_counter: bool,
    /// SYNC0 before the first exchange that came back, by the devices' clock \[ns\].
    sync0: Option<u64>,
}

impl<L> std::fmt::Debug for Bus<L> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bus")
            .field("counters", &self.counters)
            .field("fault", &self.fault)
            .finish_non_exhaustive()
    }
}

impl<L: Link> Bus<L> {
    /// A bus whose devices have reached a state and exchange process data.
    pub(crate) fn running(
        initial_state: InitialState,
        table: Table,
        wire: Wire<L>,
        group: Devices<SafeOp>,
        pace: Pace,
        facts: Vec<DeviceFacts>,
        times: Times,
    ) -> Self {
        let (machine, side) = hand_over(&table.bus);
        let sizes = |bytes: fn(&crate::table::DeviceRow) -> usize| -> Vec<Vec<u8>> {
            table.devices.iter().map(|row| vec![0; bytes(row)]).collect()
        };
        let window = || LossWindow::new(table.bus.lost_max, table.bus.window);
        Self {
            inputs: sizes(crate::table::DeviceRow::input_bytes),
            outputs: sizes(crate::table::DeviceRow::output_bytes),
            working_counter: table
                .devices
                .iter()
                .map(crate::table::DeviceRow::working_counter)
                .sum(),
            drives: table
                .drives
                .iter()
                .map(|row| Drive::new(row.clone(), table.bus.period))
                .collect(),
            lost: window(),
            wrong_working_counters: window(),
            table,
            facts,
            wire,
            group,
            initial_state,
            transition: match initial_state {
                InitialState::SafeOp => Transition::SafeOp,
                InitialState::Op => Transition::Op,
            },
            pace,
            side,
            machine: Some(machine),
            number: 0,
            command: None,
            answers: None,
            delay: None,
            times,
            fault: None,
            cycle: CycleStatus::default(),
            counters: Counters::default(),
            dropped: None,
            is_ending: false,
            is_restart_due: false,
            record: CycleRecord::default(),
            records: None,
        }
    }

    /// Queue of the records of all further cycles, for a thread without real-time priority. It replaces an earlier
    /// one.
    ///
    /// It has room for 4096 records, four seconds with a cycle of 1 ms. Records that find it full are dropped and
    /// counted ([`Counters::records_lost`]).
    pub fn records(&mut self) -> Consumer<CycleRecord> {
        let (records, taken) = RingBuffer::new(RECORDS);
        self.records = Some(records);
        taken
    }

    /// The newest frames; after a fault, the last ones up to it.
    pub fn frames(&self) -> &FrameRing {
        &self.wire.frames
    }

    /// The control task's side of the bus; none after the first call.
    pub fn take_machine(&mut self) -> Option<FieldbusMachine> {
        self.machine.take()
    }

    /// Table of the bus: cycle, devices, signals and drives, in SI units or \[ns\].
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// Data that the devices reported at start-up, in the order of their positions.
    pub fn facts(&self) -> &[DeviceFacts] {
        &self.facts
    }

    /// Counters since the start.
    pub fn counters(&self) -> Counters {
        Counters { unexpected: self.wire.unexpected, ..self.counters }
    }

    /// Distributions \[ns\] of the outputs' margin to SYNC0 and of the frames' round trip, since the start.
    pub fn times(&self) -> &Times {
        &self.times
    }

    /// Delays from sampling, means over about a quarter of a second; none before a command has acted.
    pub fn delay(&self) -> Option<Delay> {
        self.delay
    }

    /// The first fault, which stopped the machine; none without one.
    pub fn fault(&self) -> Option<Fault> {
        self.fault.map(|(fault, _)| fault)
    }

    /// Expected working counter of an exchange: the sum over all devices of 2 for outputs and 1 for inputs.
    pub fn working_counter(&self) -> u16 {
        self.working_counter
    }

    /// Statusword (CiA 402, 0x6041) of each drive, as received last, in the order of the table.
    pub fn statuswords(&self) -> impl Iterator<Item = u16> {
        self.drives.iter().map(Drive::statusword)
    }

    /// The link, for tests that act on simulated devices.
    pub fn link_mut(&mut self) -> &mut L {
        &mut self.wire.link
    }

    /// One cycle for a bus task in a thread of its own: [`measure`](Self::measure), then [`act`](Self::act).
    pub fn cycle(&mut self) {
        self.measure();
        self.act();
    }

    /// Waits until the first exchange of a cycle is due, exchanges frames, and publishes the measurement.
    pub fn measure(&mut self) {
        self.counters.cycles += 1;
        self.cycle = CycleStatus::default();
        let (due, is_only) = (self.pace.next_exchange(), self.table.bus.exchanges == 1);
        self.wire.link.wait(due);
        if is_only {
            self.decide();
        }
        let counts = self.exchange(due, is_only);
        self.side.show_sync0(self.pace.in_cycle(0));
        // before the drives' inputs are evaluated: a drive that left OP reports a fault for it
        self.read_status_code();
        self.request_op();
        if counts {
            self.evaluate_drives();
            self.publish();
        }
    }

    /// Sends the newest command in the second exchange, and evaluates the losses of the cycle. With one exchange,
    /// [`measure`](Self::measure) of the next cycle sends the command.
    pub fn act(&mut self) {
        if self.table.bus.exchanges == 2 {
            let due = self.pace.in_cycle(self.table.bus.send);
            self.wire.link.wait(due);
            self.decide();
            self.exchange(due, true);
        }
        let CycleStatus { is_lost, has_wrong_working_counter, .. } = self.cycle;
        if self.lost.record(is_lost) {
            self.stop(Fault::FramesLost);
        }
        if self.wrong_working_counters.record(has_wrong_working_counter) {
            self.stop(Fault::WorkingCounter);
        }
        self.side.show(self.drives.iter().all(Drive::is_enabled), self.fault());
        self.push_record();
    }

    /// Takes a reset and the newest command, and writes the outputs.
    fn decide(&mut self) {
        self.take_reset();
        self.take_command();
        self.encode();
    }

    /// Queues the record of the cycle, and begins the next one.
    fn push_record(&mut self) {
        let mut record = std::mem::take(&mut self.record);
        self.record.states = record.states;
        let Some(records) = self.records.as_mut().filter(|records| !records.is_abandoned()) else {
            return;
        };
        record.measurement = self.number;
        record.sync0 = [self.pace.in_cycle(0), self.pace.system];
        for (shown, drive) in record.drives.iter_mut().zip(&self.drives) {
            *shown = [drive.statusword(), drive.error()];
        }
        record.image.record(&self.outputs, &self.inputs);
        record.fault = self.fault.map(|(fault, _)| fault);
        if records.push(record).is_err() {
            self.counters.records_lost += 1;
        }
    }

    /// Whether a person has reset a fault that needs [`restart_by_a_person`](Self::restart_by_a_person).
    pub fn is_restart_due(&self) -> bool {
        self.is_restart_due
    }

    /// Restarts the bus from INIT after a fault in which devices left OP or stopped answering; a person has removed
    /// the cause. The machine of the control task and the queue of the records stay in use.
    ///
    /// # Errors
    ///
    /// As of [`start_in`](Self::start_in).
    pub fn restart_by_a_person(self) -> Result<Self, StartError> {
        let Self { initial_state, table, wire, side, machine, records, .. } = self;
        let mut bus = Self::start_on(initial_state, table, wire)?;
        // the control task keeps its machine, and the log its queue
        (bus.side, bus.machine, bus.records) = (side, machine, records);
        Ok(bus)
    }

    /// A device left its state, or did not reach OP: its AL status code is read once, and the machine stops.
    fn read_status_code(&mut self) {
        let Some(device) = self.dropped.take() else { return };
        if self.fault.is_some() {
            return;
        }
        let main = self.wire.main;
        let mut code = 0;
        if let Ok(place) = self.group.subdevice(main, usize::from(device)) {
            let end = self.pace.in_cycle(self.table.bus.period - MARGIN);
            let read = place.register_read::<u16>(RegisterAddress::AlStatusCode);
            code = self.wire.run_until(read, end).and_then(Result::ok).unwrap_or(0);
        }
        self.stop(Fault::StateDropped { device, code });
    }

    fn evaluate_drives(&mut self) {
        let mut found = None;
        for drive in &mut self.drives {
            let fault = drive.evaluate(&self.inputs[drive.row.device]);
            found = found.or(fault);
            self.counters.warnings +=
                u64::from(drive.statusword() & crate::cia402::status_bit::WARNING != 0);
            self.counters.limits +=
                u64::from(drive.statusword() & crate::cia402::status_bit::INTERNAL_LIMIT != 0);
        }
        if let Some(fault) = found {
            self.stop(fault);
        }
    }

    /// Stops the machine. The first fault is kept, with the frames before it.
    fn stop(&mut self, fault: Fault) {
        self.fault.get_or_insert((fault, now()));
        self.wire.frames.freeze(true);
    }

    /// Requests OP where it is due; a request that is lost is repeated in the next cycle.
    fn request_op(&mut self) {
        if self.transition == Transition::Due {
            let end = self.pace.in_cycle(self.table.bus.period - MARGIN);
            if request(&mut self.wire, OP, end) {
                self.transition = Transition::Requested(now());
            }
        }
    }

    /// Publishes the measurement to the control task.
    fn publish(&mut self) {
        self.number += 1;
        let time = self.pace.system as f64 * 1e-9;
        let (measurement, valve) = decode(&self.table, &self.inputs, self.number, time);
        let link = Attachment {
            lost: self.counters.cycles - self.number,
            dropped: self.wire.unexpected,
            delay: self.delay,
            commands_lost: false,
        };
        let incoming = Incoming { link: Some(link), ..Incoming::new(measurement, valve) };
        self.side.publish(&incoming, self.pace.system);
    }

    /// Ends the bus: drives are switched off, and the devices go to INIT, so that their watchdogs do not expire.
    pub fn end(&mut self) {
        self.is_ending = true;
        let bus = &self.table.bus;
        for _ in 0..(bus.brake + UNTIL_OFF) / bus.period.max(1) {
            self.measure();
            self.decide();
            if !self.drives.iter().any(Drive::is_enabled) {
                break;
            }
        }
        to_init(&mut self.wire, self.table.bus.period);
    }

    /// The fault in a sentence, with what to do; none without a fault.
    pub fn fault_sentence(&self) -> Option<String> {
        Some(self.fault()?.sentence(&self.table))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Nowhere;

    impl Link for Nowhere {
        fn send(&mut self, _: &[u8]) -> bool {
            false
        }

        fn receive(&mut self, _: &mut [u8], _: u64) -> Option<usize> {
            None
        }

        fn wait(&mut self, _: u64) {}
    }

    #[test]
    fn a_bus_can_be_moved_to_another_thread() {
        fn is_send<T: Send>(_: Option<T>) {}
        is_send::<Bus<Nowhere>>(None);
    }
}

//! Attachment of a real machine, or of one in another process, with the tasks that control it.

use super::Run;
use super::attachment::{self, Attached};
use super::bus;
use super::bus_log::BusLog;
use super::control_setup::ControlSetup;
use super::operator::handle_ctrl_c;
use crate::commissioning_basis::{demand, of_bus, of_local};
use crate::machine_argument::MachineArgument;
use crate::machine_choice::MachineChoice;
use hydroboom_description::Description;
use hydroboom_fieldbus::raw_socket::RawSocket;
use hydroboom_fieldbus::start_up::InitialState;
use hydroboom_fieldbus::table::Table;
use hydroboom_realtime::commissioning::record::Basis;
use hydroboom_realtime::control_task::ControlTask;
use hydroboom_realtime::desk::Desk;
use hydroboom_realtime::simulation_task::SimulationTask;
use miette::{Result, miette};
use std::sync::Arc;

/// A machine that sends measurements and takes commands, and the tasks that control it.
pub struct AttachedMachine {
    /// Control task, and the task that simulates the model beside the machine.
    pub tasks: (ControlTask, SimulationTask),
    /// Connection to the machine.
    pub connection: Attached,
    /// Whether the machine says that it is simulated.
    pub is_simulated: bool,
    /// Log of the cycles of a bus; none for a machine on the local interface.
    pub bus_log: Option<BusLog>,
}

impl Run {
    /// Table and network interface of a bus; none where the machine is on no bus.
    ///
    /// # Errors
    ///
    /// If the table cannot be read or has another period than the model, or the interface cannot be opened. Also for a
    /// bus in simulated time, and for a table without a bus.
    pub(super) fn open_bus(&self, model: &Description) -> Result<Option<(Table, RawSocket)>> {
        match (&self.machine, &self.bus) {
            (Some(MachineArgument::EtherCat(_)), _) if self.simulated_time => Err(miette!(
                help = "leave --simulated-time out; virtual and udp:PORT run in simulated time",
                "devices on a bus have clocks of their own, and cannot run in simulated time"
            )),
            (Some(MachineArgument::EtherCat(interface)), file) => {
                let table = bus::table(file.as_deref(), &self.crane, model)?;
                Ok(Some((table, bus::open(interface)?)))
            }
            (_, Some(_)) => Err(miette!(
                help = "name the interface, as in --machine ethercat:eth1",
                "--bus is the table of devices at a network interface, and the machine is none"
            )),
            (_, None) => Ok(None),
        }
    }

    /// Attaches the machine that begins a session at a UDP port of the local interface; none if the operator ended the
    /// wait for it.
    ///
    /// # Errors
    ///
    /// If the port cannot be opened, machine and model differ in their interface, or a real machine was not
    /// commissioned as it is now.
    pub(super) fn attach_local(
        &self,
        port: u16,
        cranes: &MachineChoice,
        setup: &ControlSetup,
        desk: &Arc<Desk>,
    ) -> Result<Option<AttachedMachine>> {
        handle_ctrl_c(desk)?;
        // everything is prepared before the session begins, because the machine must be answered
        // from then on
        let tasks = setup.tasks(cranes)?;
        let (mut bus, side) = attachment::open(port, &cranes.model)?;
        if !attachment::wait_for_machine(&mut bus, desk)? {
            return Ok(None);
        }
        let basis = of_local(&cranes.model, &bus);
        self.require_commissioning(&basis)?;
        Ok(Some(AttachedMachine {
            tasks,
            connection: Attached::begin(bus, side, self.simulated_time),
            is_simulated: basis.is_simulated,
            bus_log: None,
        }))
    }

    /// Attaches the devices of a bus at an open network interface.
    ///
    /// # Errors
    ///
    /// If the bus does not start, a device has a fault, or real devices were not commissioned as they are now.
    pub(super) fn attach_bus(
        &self,
        interface: &str,
        (table, socket): (Table, RawSocket),
        cranes: &MachineChoice,
        setup: &ControlSetup,
        desk: &Arc<Desk>,
    ) -> Result<AttachedMachine> {
        handle_ctrl_c(desk)?;
        let tasks = setup.tasks(cranes)?;
        let mut is_simulated = false;
        // nothing is commanded while listening, so that OP is not needed
        let state = if self.listen { InitialState::SafeOp } else { InitialState::Op };
        let (connection, log) = bus::start(interface, table, socket, state, |table, facts| {
            let basis = of_bus(&cranes.model, table, facts);
            is_simulated = basis.is_simulated;
            self.require_commissioning(&basis)
        })?;
        Ok(AttachedMachine { tasks, connection, is_simulated, bus_log: Some(log) })
    }

    /// Refuses to move a real machine that was not commissioned as it is now. Listening does not move it.
    fn require_commissioning(&self, now: &Basis) -> Result<()> {
        if self.listen { Ok(()) } else { demand(self.commissioning.as_deref(), now) }
    }
}

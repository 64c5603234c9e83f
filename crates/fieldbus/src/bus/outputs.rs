//! Outputs of a cycle: the newest command, a reset by the operator, and their encoding by the table.

use super::{Bus, Transition};
use crate::drive::{Drive, RequestedState};
use crate::fault::Fault;
use crate::link::Link;
use crate::machine::Taken;
use crate::time::now;
use hydroboom_control::command::Command;

/// Periods without a new command after which the safe command is sent.
const COMMAND_PERIODS: u32 = 2;

impl<L: Link> Bus<L> {
    /// Takes the newest command. After a start and after a reset commands are ignored until the first one at rest, so
    /// that nothing moves unexpectedly (ISO 14118).
    pub(super) fn take_command(&mut self) {
        if self.is_ending {
            self.command = None;
            return;
        }
        if let Some(Taken { outgoing, answers }) = self.side.take_command() {
            let is_finite = outgoing
                .command
                .axes
                .iter()
                .all(|axis| axis.motor_speed.is_finite() && axis.holding_valve.is_finite());
            if !is_finite {
                self.stop(Fault::CommandsStopped);
            } else if self.command.is_some() || outgoing.is_safe() {
                if outgoing.is_enabled && self.transition == Transition::SafeOp {
                    self.transition = Transition::Due;
                }
                self.command = Some((outgoing, 0));
                self.answers = Some(answers).filter(|sampled| *sampled > 0);
            }
            return;
        }
        if self.side.is_left() && self.command.is_none_or(|(last, _)| last.is_safe()) {
            // control has ended with its load held: drives are switched off
            self.command = None;
            return;
        }
        if let Some((_, age)) = &mut self.command {
            *age += 1;
            self.counters.without_command += 1;
            if *age >= COMMAND_PERIODS {
                self.stop(Fault::CommandsStopped);
            }
        }
    }

    /// Resets faults on a person's request; devices that left OP need a restart of the bus.
    pub(super) fn take_reset(&mut self) {
        if !self.side.take_reset() {
            return;
        }
        let Some((fault, _)) = self.fault else { return };
        let mut states = self.record.states.iter().take(self.facts.len());
        let is_away = states.any(|state| !self.transition.allows(*state));
        if is_away || matches!(fault, Fault::StateDropped { .. } | Fault::DeviceSilent { .. }) {
            self.is_restart_due = true;
            return;
        }
        self.fault = None;
        self.wire.frames.freeze(false);
        if self.transition == Transition::SafeOp {
            // drives take a fault reset in OP only
            self.transition = Transition::Due;
        }
        // commands are ignored until the next one at rest
        self.command = None;
        self.lost.clear();
        self.wrong_working_counters.clear();
        self.drives.iter_mut().for_each(Drive::reset);
    }

    /// Writes the command into the outputs; with a fault, or before the first command, the safe one.
    pub(super) fn encode(&mut self) {
        let braking =
            self.fault.map(|(_, since)| now().saturating_sub(since) < self.table.bus.brake);
        let (command, requested) = match (self.command, braking) {
            (Some((outgoing, _)), None) if outgoing.is_enabled => {
                (outgoing.command, RequestedState::Operation)
            }
            (_, Some(true)) => (Command::default(), RequestedState::Braking),
            (_, None | Some(false)) => (Command::default(), RequestedState::Off),
        };
        for row in &self.table.commanded {
            let Some(axis) = command.axes.get(row.axis) else { continue };
            let value = if row.signal == 0 { axis.motor_speed } else { axis.holding_valve };
            let counts = row.scale.counts(value);
            let drive = self
                .drives
                .iter_mut()
                .find(|drive| row.signal == 0 && drive.row.target == row.place);
            let Some(outputs) = self.outputs.get_mut(row.place.device) else { continue };
            match drive {
                Some(drive) => drive.command(outputs, requested, counts),
                None => row.place.write(outputs, counts as u64),
            }
        }
    }
}

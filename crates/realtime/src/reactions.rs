//! Effect of each safety reaction on a moving machine, and the load drop with an ideal second line of
//! protection behind an unproven release. Simulated without the supervisor.

use crate::lockstep::Lockstep;
use crate::operator::Operator;
use crate::setup::SetupError;
use hydroboom_control::command::AxisCommand;
use hydroboom_control::reference::profile::OutAndBack;
use hydroboom_control::strategy::Strategy;
use hydroboom_control::supervision::fault::Reaction;
use hydroboom_control::supervision::supervisor::CONTROLLED_RAMP;
use hydroboom_description::Description;
use hydroboom_model::SimulationError;
use hydroboom_virtual_crane::VirtualCrane;
use thiserror::Error;

/// Motion and load of a machine after a safety reaction at one speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactionEffect {
    /// Safety reaction.
    pub reaction: Reaction,
    /// Speed of the piston at the start of the reaction \[m/s\], positive outwards.
    pub speed: f64,
    /// Largest distance of the piston from its position at the start \[m\].
    pub travel: f64,
    /// Time until load-holding valve and motor are at rest \[s\].
    pub time: f64,
    /// Largest pressure in any chamber \[Pa\], gauge.
    pub peak_pressure: f64,
    /// Largest force of the cylinder on the boom \[N\].
    pub force: f64,
}

/// Reason why the effect of a reaction cannot be computed.
#[derive(Clone, Debug, Error)]
pub enum ReactionError {
    /// The crane cannot be built.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The simulation of the machine failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
}

/// Time simulated after the start of a reaction \[s\].
const WATCHED: f64 = 2.5;

/// Effects of both reactions on a machine that moves inwards and outwards at the given piston speeds \[m/s\], which
/// are positive.
///
/// Each reaction begins in the middle of a stroke at constant speed, and is observed for 2.5 s. A case whose course
/// the supervisor stops before is left out.
///
/// # Errors
///
/// [`ReactionError`] if the crane cannot be built or its simulation fails.
pub fn reaction_effects(
    model: &Description,
    machine: &Description,
    speeds: &[f64],
) -> Result<Vec<ReactionEffect>, ReactionError> {
    let mut effects = Vec::new();
    for speed in speeds {
        let motion = machine.motion(*speed);
        let travel = motion.travel_time();
        let out = motion.rest + 0.5 * travel;
        for (sign, time) in [(1.0, out), (-1.0, out + travel + motion.dwell)] {
            let Some(moving) = moved_until(model, machine, motion, time)? else { continue };
            for reaction in Reaction::ALL {
                effects.push(effect(machine, moving.clone(), reaction, sign * speed)?);
            }
        }
    }
    Ok(effects)
}

/// Machine under the benchmark controller at a time of the course \[s\]; none if the course was stopped
/// before.
fn moved_until(
    model: &Description,
    machine: &Description,
    motion: OutAndBack<f64>,
    time: f64,
) -> Result<Option<VirtualCrane>, ReactionError> {
    let strategy = Strategy::BenchmarkClosedLoop;
    let mut run = Lockstep::new(model, machine, motion, strategy)?;
    let mut operator = Operator::automatic(model.numbers.control_period);
    loop {
        let record = run.period(&mut operator, strategy)?;
        if record.course_time.is_some_and(|now| now >= time) {
            return Ok(Some(run.machine().clone()));
        }
        if operator.is_done() {
            return Ok(None);
        }
    }
}

fn effect(
    machine: &Description,
    mut moving: VirtualCrane,
    reaction: Reaction,
    speed: f64,
) -> Result<ReactionEffect, ReactionError> {
    let n = &machine.numbers;
    let period = moving.period();
    let from = moving.truth();
    let cylinder = machine.cylinder();
    let ramp = match reaction {
        Reaction::ControlledStop => CONTROLLED_RAMP * n.supervision_stop,
        Reaction::ImmediateStop => from.motor_speed.abs() / n.motor_slew,
    };
    let shut_after = match reaction {
        Reaction::ControlledStop => n.supervision_stop,
        Reaction::ImmediateStop => 0.0,
    };
    let mut effect =
        ReactionEffect { reaction, speed, travel: 0.0, time: 0.0, peak_pressure: 0.0, force: 0.0 };
    for k in 0..(WATCHED / period) as u32 {
        let time = f64::from(k) * period;
        let left = (1.0 - time / ramp.max(period)).max(0.0);
        moving.advance(&AxisCommand {
            motor_speed: from.motor_speed * left,
            holding_valve: f64::from(u8::from(time < shut_after)),
        })?;
        let truth = moving.truth();
        let o = &truth.outputs;
        effect.travel = effect.travel.max((o.stroke - from.outputs.stroke).abs());
        let pressures = [o.pressure_a, o.pressure_b, o.pressure_pump_a, o.pressure_pump_b];
        effect.peak_pressure = pressures.into_iter().fold(effect.peak_pressure, f64::max);
        let force = o.pressure_a * cylinder.piston_area - o.pressure_b * cylinder.rod_side_area;
        effect.force = effect.force.max(force.abs());
        if truth.pilot > 0.05 || truth.motor_speed.abs() > 0.2 {
            effect.time = time + period;
        }
    }
    Ok(effect)
}

/// Drop of the load \[m\] if the valve opens onto an empty pump side and an ideal monitor shuts it again.
/// The monitor measures the piston itself and reacts in the period in which it has sunk by 0.1 mm. The
/// result is the largest drop within 2.5 s, due to pilot and closing time alone. The piston starts at half stroke or
/// farther out.
///
/// # Errors
///
/// [`ReactionError`] if the crane cannot be built or its simulation fails.
pub fn ideal_second_line(machine: &Description) -> Result<f64, ReactionError> {
    const SEEN: f64 = 1e-4;
    let mut start = machine.start(machine.numbers.motion_start.max(0.5 * machine.numbers.stroke));
    start.preload = 0.0;
    let mut crane = VirtualCrane::new(machine, &start).map_err(SetupError::from)?;
    let held = crane.truth().outputs.stroke;
    let (mut drop, mut valve) = (0.0_f64, 1.0);
    for _ in 0..(WATCHED / crane.period()) as u32 {
        crane.advance(&AxisCommand { motor_speed: 0.0, holding_valve: valve })?;
        drop = drop.max(held - crane.truth().outputs.stroke);
        if drop > SEEN {
            valve = 0.0;
        }
    }
    Ok(drop)
}

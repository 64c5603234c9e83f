//! Identification of a machine from a cycle: the output-error fit of the crate `identify`, applied to a closed-loop record.
//!
//! The measured motor speed drives the model, so that the controller in the loop is not in the way: what it commanded reaches the
//! machine through that speed alone. The drive, from command to speed, is identified apart ([`super::drive_fit`]): it shares no number with the rest.

use super::drive_fit::fitted_drive;
use super::record::Record;
use crate::LabError;
use hydroboom_control::measurement::AxisSignals;
use hydroboom_description::schema::{FrictionChoice, Numbers};
use hydroboom_description::{Description, Difference};
use hydroboom_identify::{Experiment, Free, Nuisance, Task, Window, fit};

/// Keys that the motion of a piston depends on within a cycle: load, friction, oil, pump and its leakage, check valves.
const IDENTIFIED: [&str; 14] = [
    "payload.mass_kg",
    "cylinder.dead_volume_a_l",
    "cylinder.dead_volume_b_l",
    "friction.viscous_ns_per_m",
    "friction.coulomb_n",
    "friction.stiction_n",
    "oil.transition_bar",
    "pump.flow_gain",
    "pump.internal_leakage_m3_s_sqrtpa",
    "pump.case_leakage_a_m3_s_sqrtpa",
    "pump.slip_l_min_per_bar",
    "pump.slip_cm3_per_rev_bar",
    "check_valve.cracking_bar",
    "check_valve.flow_coefficient_m3_s_sqrtpa",
];

/// A model of the machine that a cycle was recorded of, with friction that holds at rest, the drive that its motor shows, and the pressures
/// that the cycle began with.
///
/// # Errors
///
/// [`LabError`] when the model cannot be run under the record's motor speed.
pub(crate) fn identified(model: &Description, record: &Record) -> Result<Description, LabError> {
    let mut model = with_positive_start_values(model);
    model.choices.friction = FrictionChoice::LuGre;
    let (log, signals) = record.log();
    let experiments = Experiment::each(&model, &log, &signals, Window::default())?;
    let free: Vec<Free> = IDENTIFIED
        .iter()
        .map(|path| Free::from_path(path))
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .filter(|key| key.value(&model) > 0.0)
        .collect();
    // all readings of a period come by one bus, and what the position is read as is what is tracked
    let fixed = [Nuisance::named("delay")?, Nuisance::named("stroke.offset")?].concat();
    let task = Task {
        model: &model,
        experiments: &experiments,
        free: &free,
        fixed: &fixed,
        resume: None,
        generations: 0,
    };
    let mut machine = fit(&task, &|_| true)?.description;
    if let Some(rest) = record.readings.first() {
        machine = with_measured_pressures(&machine, rest);
    }
    machine.numbers = fitted_drive(&machine.numbers, &record.commands, &record.readings);
    Ok(machine)
}

/// A model whose identified numbers all can be moved in their logarithm: one that is zero begins in the middle of its range.
fn with_positive_start_values(model: &Description) -> Description {
    let mut started = model.clone();
    let mut numbers = started.numbers.to_array();
    for key in IDENTIFIED.iter().filter_map(|path| Free::from_path(path).ok()) {
        let range = model.range(&key.path());
        if let (true, Some(range)) = (numbers[key.place] == 0.0, range) {
            numbers[key.place] = 0.5 * (range.low + range.high);
        }
    }
    started.numbers = Numbers::from_array(numbers);
    started
}

/// A model that starts from the pressures that are read of a machine at rest.
fn with_measured_pressures(model: &Description, rest: &AxisSignals<f64>) -> Description {
    let mut model = model.clone();
    let n = &mut model.numbers;
    n.rod_side = rest.pressure_b;
    n.working_pressure = rest.pressure_accumulator;
    let [held, loaded] =
        [rest.pressure_a, rest.pressure_pump_a].map(|p| p - rest.pressure_accumulator);
    // an empty crane may hold no more than the accumulator has
    n.preload = if held > 0.0 { (loaded / held).clamp(0.0, 1.0) } else { 1.0 };
    model
}

/// What of a description was identified, as overrides (`--set`) that every command takes.
pub(crate) fn overrides(model: &Description, identified: &Description) -> Vec<String> {
    let of = |difference: Difference| match difference.there.parse::<f64>() {
        Ok(value) => format!("{}={}", difference.key, six_digits(value)),
        Err(_) => difference.assignment(),
    };
    model.differences(identified).into_iter().map(of).collect()
}

/// More digits than a log tells.
fn six_digits(value: f64) -> String {
    match (1e-3..1e6).contains(&value.abs()) {
        true => {
            let decimals = 5 - value.abs().log10().floor() as i32;
            format!("{value:.0$}", usize::try_from(decimals).unwrap_or(0))
        }
        false => format!("{value:.5e}"),
    }
}

//! A crane's description with what was learned of the crane in it.

use crate::leakage;
use hydroboom_control::learner::Known;
use hydroboom_control::schedule::Schedule;
use hydroboom_description::{Description, Difference};

/// The model with what is known of the machine in it: payload, friction, oil, the pump's flow and slip, its leakage, and how late its motor is.
///
/// State feedback tells what leaks of the model.
pub fn informed(model: &Description, schedule: &Schedule, known: &Known) -> Description {
    let before = leakage(&model.numbers, &schedule.at(model.numbers.payload));
    let mut informed = model.clone();
    let n = &mut informed.numbers;
    n.payload = known.payload;
    n.transition = known.balance.transition;
    // a crane file's pump delivers no more than it displaces
    n.displacement *= known.balance.flow_gain.max(1.0);
    n.flow_gain = known.balance.flow_gain.min(1.0);
    n.slip_per_speed = known.balance.slip;
    n.following_lead = known.lag;
    let [coulomb, viscous] = known.friction;
    // what breaks away is seals, as what slides slowly is
    n.coulomb *= coulomb;
    n.stiction *= coulomb;
    n.viscous *= viscous;
    // what leaks is known, and not where: all by the same factor
    let worn = if before > 0.0 { known.balance.leakage / before } else { 1.0 };
    for leakage in
        [&mut n.internal_leakage, &mut n.slip_at_rest, &mut n.case_leakage_a, &mut n.case_leakage_b]
    {
        *leakage *= worn;
    }
    informed
}

/// What of a description was learned, as overrides (`--set`) that every command takes: what was learned is kept by them.
pub fn overrides(model: &Description, informed: &Description) -> Vec<String> {
    let of = |difference: Difference| match difference.there.parse::<f64>() {
        Ok(value) => format!("{}={}", difference.key, six_digits(value)),
        Err(_) => difference.assignment(),
    };
    model.differences(informed).into_iter().map(of).collect()
}

/// More digits than anybody learns.
fn six_digits(value: f64) -> String {
    match (1e-3..1e6).contains(&value.abs()) {
        true => {
            let whole = value.abs().log10().floor().max(0.0) as usize;
            format!("{value:.0$}", 5_usize.saturating_sub(whole))
        }
        false => format!("{value:.5e}"),
    }
}

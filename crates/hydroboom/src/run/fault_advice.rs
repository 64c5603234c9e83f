//! Advice on a fault of a run.

use hydroboom_control::supervision::fault::Cause;

/// Faults that a computer without time for the tasks causes, if it simulates the machine in real time.
const OF_LATE_TASKS: [Cause; 4] =
    [Cause::MachineLost, Cause::Overruns, Cause::WatchdogExpired, Cause::MeasurementsLost];

/// Advice on a fault. `is_simulated_here` is whether this computer simulates the machine in real time.
pub fn fault_advice(cause: Cause, is_simulated_here: bool) -> String {
    let advice = cause.advice();
    let end = if advice.ends_with('?') { "" } else { "." };
    match is_simulated_here && OF_LATE_TASKS.contains(&cause) {
        true => format!(
            "{advice}{end} This computer simulates the machine, and may have no time for it: `hydroboom doctor` \
             examines it, and --simulated-time runs the same tasks independently of its load"
        ),
        false => advice.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The virtual crane has no bus.
    #[test]
    fn a_lost_virtual_crane_is_explained_by_the_load_of_the_computer() {
        let advice = fault_advice(Cause::MachineLost, true);
        assert!(advice.contains("`hydroboom doctor`"), "{advice}");
        assert!(advice.contains("--simulated-time"), "{advice}");
        assert_eq!(fault_advice(Cause::MachineLost, false), Cause::MachineLost.advice());
        assert_eq!(fault_advice(Cause::LoadSank, true), Cause::LoadSank.advice());
    }
}

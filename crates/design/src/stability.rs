//! Stability of the control loops over the stroke, before anything moves: by the Nyquist criterion around the
//! linearised crane.

use crate::design_report::{benchmark_loop, scheduled_lqr_loop_at};
use crate::scheduled_lqr::{designed, known_delay};
use crate::unstable_poles::{GrowingPoles, growing_poles};
use crate::{Actuation, DesignError, LinearisedPlant, Loop};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::{Description, millimetres};
use hydroboom_math::Real;
use serde::Serialize;
use std::fmt;

/// Piston positions for a table of margins, as shares of the stroke \[1\].
pub const POSITIONS: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Number of piston positions at which stability is judged, equally spaced from the first to the last of
/// [`POSITIONS`], which are among them.
pub const JUDGED_POSITIONS: usize = 19;

/// Those positions, as shares of the stroke.
fn judged_positions() -> impl Iterator<Item = f64> {
    let [first, .., last] = POSITIONS;
    let spacing = (last - first) / (JUDGED_POSITIONS - 1) as f64;
    (0..JUDGED_POSITIONS).map(move |k| first + k as f64 * spacing)
}

/// Drive, fieldbus and sensors of a control loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Equipment {
    /// Drive lag and fieldbus delay that the controllers assume before identification.
    Expected,
    /// Ideal: no lag of the drive, no delay.
    Ideal,
    /// Drive, fieldbus and sensors of the plant's crane file.
    Plant,
}

impl fmt::Display for Equipment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Expected => "with the lags of drive and fieldbus that the controllers expect",
            Self::Ideal => "with an ideal drive and no delay",
            Self::Plant => "with the plant's drive, fieldbus and sensors",
        })
    }
}

/// Stability of a controller's loop at piston positions over the stroke.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoopStability {
    /// Name of the loop: `benchmark`, `benchmark on the simulated crane` or `scheduled LQR`.
    pub controller: &'static str,
    /// Drive, fieldbus and sensors of the loop.
    pub equipment: Equipment,
    /// Whether the closed loop has no growing pole at any of the positions. A growing pole doubles within 35 s.
    pub stable: bool,
    /// Judged piston positions \[mm\].
    pub judged_at_mm: Vec<f64>,
    /// Piston positions with a growing pole \[mm\].
    pub unstable_at_mm: Vec<f64>,
    /// Largest number of growing poles of the closed loop at one position.
    pub unstable_poles: u32,
    /// Largest number of growing poles of crane and controller without feedback at an unstable position.
    pub unstable_poles_in_open_loop: u32,
}

impl LoopStability {
    /// From the growing poles at each piston position \[mm\].
    fn of(
        (controller, equipment): (&'static str, Equipment),
        poles: &[(f64, GrowingPoles)],
    ) -> Self {
        let growing = || poles.iter().filter(|(_, poles)| poles.closed_loop > 0);
        let most = |of: fn(&GrowingPoles) -> u32| growing().map(|(_, poles)| of(poles)).max();
        Self {
            controller,
            equipment,
            stable: growing().next().is_none(),
            judged_at_mm: poles.iter().map(|(mm, _)| *mm).collect(),
            unstable_at_mm: growing().map(|(mm, _)| *mm).collect(),
            unstable_poles: most(|poles| poles.closed_loop).unwrap_or(0),
            unstable_poles_in_open_loop: most(|poles| poles.open_loop).unwrap_or(0),
        }
    }

    /// Where it is unstable, neighbouring positions together.
    fn unstable_ranges(&self) -> String {
        let is_unstable = |mm: &f64| self.unstable_at_mm.contains(mm);
        let runs = self.judged_at_mm.chunk_by(|a, b| is_unstable(a) == is_unstable(b));
        let text = |run: &[f64]| match run {
            [] => String::new(),
            [only] => format!("{only:.0}"),
            [first, .., last] => format!("{first:.0} to {last:.0}"),
        };
        runs.filter(|run| run.iter().all(is_unstable)).map(text).collect::<Vec<_>>().join(", ")
    }

    /// Whether it is the benchmark controller's loop around a machine.
    pub fn is_benchmark(&self) -> bool {
        self.controller == BENCHMARK
    }

    /// Whether a strategy closes this loop. The benchmark loop, to which the scheduled LQR falls back, does not count
    /// for the scheduled LQR.
    pub fn is_of(&self, strategy: Strategy) -> bool {
        closed_by(strategy).contains(&self.controller)
    }
}

/// Loops of a strategy.
fn closed_by(strategy: Strategy) -> &'static [&'static str] {
    match strategy {
        Strategy::VelocityFeedforward => &[],
        Strategy::SimulationFeedforwardOpenLoop => &[SIMULATED],
        Strategy::BenchmarkClosedLoop => &[BENCHMARK],
        Strategy::SimulationFeedforwardClosedLoop => &[SIMULATED, BENCHMARK],
        Strategy::ScheduledLqr => &[SCHEDULED_LQR],
    }
}

/// Remedy for a benchmark controller with too little margin.
pub const FINDS_GAINS: &str = "`hydroboom design --benchmark` finds gains";
/// Remedy for a scheduled LQR with too little margin.
pub const LOWERS_GAINS: &str = "a smaller scheduled_lqr.command_tolerance_mm_s or a larger \
    scheduled_lqr.position_tolerance_mm lowers its gains";

/// Names of the loops.
const BENCHMARK: &str = "benchmark";
const SIMULATED: &str = "benchmark on the simulated crane";
const SCHEDULED_LQR: &str = "scheduled LQR";

impl fmt::Display for LoopStability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { controller, equipment, unstable_poles, .. } = self;
        let (count, unstable) = (self.judged_at_mm.len(), self.unstable_at_mm.len());
        if self.stable {
            return write!(
                f,
                "{controller}: the closed loop is stable at {count} positions over the stroke, {equipment}"
            );
        }
        let poles = match unstable_poles {
            1 => "1 growing pole".into(),
            more => format!("up to {more} growing poles"),
        };
        let without = match self.unstable_poles_in_open_loop {
            0 => "none without feedback".into(),
            count => format!("up to {count} without feedback"),
        };
        write!(
            f,
            "{controller}: the closed loop is UNSTABLE at {} mm, {unstable} of {count} positions over the stroke ({poles}, {without}; linearised at rest with \
             sliding friction, {equipment})",
            self.unstable_ranges()
        )
    }
}

/// Stability of the benchmark controller with the model's gains, around a machine.
///
/// With `None` it is around the model, with the drive and fieldbus that the controllers assume.
///
/// # Errors
///
/// [`DesignError::Plant`] or [`DesignError::Eigenvalues`] if the crane cannot be linearised. [`DesignError::NoMode`]
/// if the loop's gain is not finite or its turns do not count poles.
pub fn benchmark_stability(
    model: &Description,
    machine: Option<&Description>,
) -> Result<LoopStability, DesignError> {
    let poles = poles(model, machine, |_| Ok(benchmark_loop(model)))?;
    Ok(LoopStability::of((BENCHMARK, equipment_of(machine)), &poles))
}

/// Drive, fieldbus and sensors of a machine; those that the controllers expect where there is none.
fn equipment_of(machine: Option<&Description>) -> Equipment {
    match machine
        .map(|machine| Actuation::of(machine) == Actuation::of(&machine.without_equipment()))
    {
        None => Equipment::Expected,
        Some(true) => Equipment::Ideal,
        Some(false) => Equipment::Plant,
    }
}

/// Stability of the scheduled LQR designed for the model, around a machine; payload, oil and drive of the machine
/// count as identified.
///
/// With `None` it is around the model, with the drive and fieldbus that the controllers assume.
///
/// # Errors
///
/// [`DesignError::Plant`] or [`DesignError::Eigenvalues`] if the crane cannot be linearised. [`DesignError::NoMode`]
/// if the crane does not oscillate on its oil, or if the loop's gain is not finite or its turns do not count poles.
/// [`DesignError::NoFit`] if the reduced model of the regulator cannot be fitted.
pub fn scheduled_lqr_stability(
    model: &Description,
    machine: Option<&Description>,
) -> Result<LoopStability, DesignError> {
    let known = machine.map_or_else(|| model.clone(), |machine| with_identified(model, machine));
    let design = designed(&known, known_delay(&known) as usize)?;
    let payload = machine.unwrap_or(model).numbers.payload;
    let around = |stroke| Ok(scheduled_lqr_loop_at(&known, &design, stroke, payload));
    let poles = poles(model, machine, around)?;
    Ok(LoopStability::of((SCHEDULED_LQR, equipment_of(machine)), &poles))
}

/// Loops that are stable with the assumed drive lag and fieldbus delay, but unstable on an ideal plant without them.
///
/// A law that compensates a delay has too much phase lead without it. A crane file that is run without a plant has an
/// ideal one. `expected` has the loops with assumed lags.
///
/// # Errors
///
/// [`DesignError::Plant`] or [`DesignError::Eigenvalues`] if the crane cannot be linearised. [`DesignError::NoMode`]
/// if the crane does not oscillate on its oil, or if the loop's gain is not finite or its turns do not count poles.
/// [`DesignError::NoFit`] if the reduced model of the regulator cannot be fitted.
pub fn unstable_on_ideal_equipment(
    model: &Description,
    expected: &[LoopStability],
) -> Result<Vec<LoopStability>, DesignError> {
    let ideal = model.without_equipment();
    let strategies = [Strategy::BenchmarkClosedLoop, Strategy::ScheduledLqr];
    let mut loops = stability_of(&strategies, model, &ideal)?;
    let is_stable = |of: &LoopStability| {
        expected.iter().any(|other| other.controller == of.controller && other.stable)
    };
    loops.retain(|of| !of.stable && is_stable(of));
    Ok(loops)
}

/// Loops that are unstable on an ideal plant, but stable with the assumed drive lag and fieldbus delay. `ideal` has
/// the loops on the ideal plant.
///
/// # Errors
///
/// As [`unstable_on_ideal_equipment`].
pub fn stable_with_expected_lags(
    model: &Description,
    ideal: &[LoopStability],
) -> Result<Vec<LoopStability>, DesignError> {
    let unstable = |name: &str| {
        ideal
            .iter()
            .any(|of| of.controller == name && of.equipment == Equipment::Ideal && !of.stable)
    };
    let mut loops = Vec::new();
    if unstable(BENCHMARK) {
        loops.push(benchmark_stability(model, None)?);
    }
    if unstable(SCHEDULED_LQR) {
        loops.push(scheduled_lqr_stability(model, None)?);
    }
    loops.retain(|of| of.stable);
    Ok(loops)
}

/// Stability of all loops of some strategies: around the simulated crane, which has neither drive nor fieldbus, and
/// around the machine. The scheduled LQR includes the benchmark, to which it falls back.
///
/// # Errors
///
/// As [`scheduled_lqr_stability`], for either crane.
pub fn stability_of(
    strategies: &[Strategy],
    model: &Description,
    machine: &Description,
) -> Result<Vec<LoopStability>, DesignError> {
    use Strategy::{
        BenchmarkClosedLoop, ScheduledLqr, SimulationFeedforwardClosedLoop,
        SimulationFeedforwardOpenLoop,
    };
    let has = |any: &[Strategy]| any.iter().any(|one| strategies.contains(one));
    let mut loops = Vec::new();
    if has(&[SimulationFeedforwardOpenLoop, SimulationFeedforwardClosedLoop]) {
        let simulated = benchmark_stability(model, Some(&model.without_equipment()))?;
        loops.push(LoopStability { controller: SIMULATED, ..simulated });
    }
    if has(&[BenchmarkClosedLoop, SimulationFeedforwardClosedLoop, ScheduledLqr]) {
        loops.push(benchmark_stability(model, Some(machine))?);
    }
    if has(&[ScheduledLqr]) {
        loops.push(scheduled_lqr_stability(model, Some(machine))?);
    }
    Ok(loops)
}

/// Remark on loops that are [stable with the assumed lags](stable_with_expected_lags) and unstable without them;
/// `None` without such loops.
pub fn remark_on_expected_lags(stable: &[LoopStability]) -> Option<String> {
    let names: Vec<&str> = stable.iter().map(|of| of.controller).collect();
    (!names.is_empty()).then(|| {
        format!(
            "{}, as `design` and `check` judge it, the closed loop of the {} is stable: the difference is that \
             delay. `--plant virtual` runs on a machine with it",
            Equipment::Expected.to_string().replacen('w', "W", 1),
            names.join(" and of the ")
        )
    })
}

/// Remark on loops that are stable with the assumed lags and [unstable on an ideal
/// plant](unstable_on_ideal_equipment); `None` without such loops.
pub fn remark_on_ideal_equipment(unstable: &[LoopStability]) -> Option<String> {
    let names: Vec<&str> = unstable.iter().map(|of| of.controller).collect();
    let remedies: Vec<&str> = unstable
        .iter()
        .map(|of| if of.is_benchmark() { FINDS_GAINS } else { LOWERS_GAINS })
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "with an ideal drive and no delay, as `motion` and `study` run a crane without a plant, the closed loop \
             of the {} is UNSTABLE. The design assumes the lags of drive and fieldbus: run it on a plant that has \
             them, as `motion --plant virtual` does, or a model of your own with lag and dead time of the drive and \
             delay of the fieldbus. For a plant without them {}",
            names.join(" and of the "),
            remedies.join(", and ")
        )
    })
}

/// Model with the oil's transition pressure and the drive lag of `crane`, as a controller identifies them, within the
/// estimator's limits. The lag is the drive's dead time plus its coefficient T_1 \[s\].
pub fn with_identified(model: &Description, crane: &Description) -> Description {
    let mut known = model.clone();
    let n = &mut known.numbers;
    let limits = (n.tuning.estimator_lowest_transition, n.tuning.estimator_highest_transition);
    n.transition = Real::clamp(crane.numbers.transition, limits.0, limits.1);
    // a lag of first order that follows a ramp as late as dead time and lag do together
    let lag = crane.numbers.drive_dead_time + Actuation::of(crane).drive[0];
    n.tuning.estimator_drive_lag = Real::clamp(
        lag,
        n.tuning.estimator_shortest_drive_lag,
        n.tuning.estimator_longest_drive_lag,
    );
    known
}

/// Piston positions \[mm\] and growing poles there.
fn poles(
    model: &Description,
    machine: Option<&Description>,
    around: impl Fn(f64) -> Result<Loop, DesignError>,
) -> Result<Vec<(f64, GrowingPoles)>, DesignError> {
    let one = |share: f64| {
        let stroke = share * model.numbers.stroke;
        let crane = LinearisedPlant::new(machine.unwrap_or(model), stroke)?;
        let around = around(stroke)?;
        let around = machine.map_or_else(|| around.clone(), |machine| around.clone().on(machine));
        Ok((millimetres(stroke), growing_poles(&crane, &around)?))
    };
    judged_positions().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_a_third_of_the_payload_only_the_published_gains_are_unstable() {
        let paper = Description::uia_single_boom().unwrap();
        let mut light = paper.clone();
        light.set("payload.mass_kg=100").unwrap();
        assert!(benchmark_stability(&paper, None).unwrap().stable);
        assert!(scheduled_lqr_stability(&paper, None).unwrap().stable);
        for unstable in [
            benchmark_stability(&light, None).unwrap(),
            // the machine has the light load, and the model does not know it
            benchmark_stability(&paper, Some(&light)).unwrap(),
        ] {
            assert_eq!((unstable.stable, unstable.unstable_at_mm.len()), (false, JUDGED_POSITIONS));
            let all = "UNSTABLE at 25 to 475 mm, 19 of 19 positions";
            assert!(unstable.to_string().contains(all), "{unstable}");
        }
        assert!(scheduled_lqr_stability(&light, None).unwrap().stable);
    }

    /// The law compensates the lags of drive and fieldbus, and its phase lead is too large where there
    /// are none. A payload at 9 m leaves no margin for that. On the ideal plant the motor speed
    /// oscillates at 22 Hz.
    #[test]
    fn stability_is_judged_with_the_equipment_in_the_loop() {
        let paper = Description::uia_single_boom().unwrap();
        let mut far = paper.clone();
        far.set("payload.x_mm=9000").unwrap();
        let expected = scheduled_lqr_stability(&far, None).unwrap();
        assert!(expected.stable && expected.equipment == Equipment::Expected);
        let ideal = unstable_on_ideal_equipment(&far, &[expected]).unwrap();
        let [lqr] = &ideal[..] else { panic!("{ideal:?}") };
        assert_eq!((lqr.controller, lqr.equipment), (SCHEDULED_LQR, Equipment::Ideal));
        assert!(lqr.to_string().contains("with an ideal drive and no delay"), "{lqr}");
        let back = stable_with_expected_lags(&far, &ideal).unwrap();
        assert_eq!(back.len(), 1, "{back:?}");
        let of_paper = scheduled_lqr_stability(&paper, None).unwrap();
        assert!(unstable_on_ideal_equipment(&paper, &[of_paper]).unwrap().is_empty());
        let machine = Description::uia_virtual().unwrap();
        let on_machine = benchmark_stability(&paper, Some(&machine)).unwrap();
        assert_eq!(on_machine.equipment, Equipment::Plant);
    }

    /// The delay of the identified first-order lag equals that of dead time and lag together.
    #[test]
    fn an_identified_drive_has_its_dead_time() {
        let (paper, machine) =
            (Description::uia_single_boom().unwrap(), Description::uia_virtual().unwrap());
        let mut late = machine.clone();
        late.set("drive.dead_time_ms=7").unwrap();
        let lag = |crane| with_identified(&paper, crane).numbers.tuning.estimator_drive_lag;
        let more = late.numbers.drive_dead_time - machine.numbers.drive_dead_time;
        assert!((lag(&late) - lag(&machine) - more).abs() < 1e-12 && more > 0.0, "{more} s");
        // as late at low frequencies as the drive is, the fieldbus aside
        let actuation = Actuation::of(&late);
        let bus = (2.0 * late.numbers.fieldbus_delay + 0.5) * late.numbers.control_period;
        let late_by = actuation.delay - bus + actuation.drive[0];
        assert!((lag(&late) - late_by).abs() < 1e-12, "{late_by} s");
    }

    /// At 25 mm, with a piston of 100 mm, the published loop has growth rates of 0.1 to 0.25 1/s. That is a
    /// factor of six or more over a motion of 18 s.
    #[test]
    fn a_loop_that_grows_slowly_is_unstable_too() {
        let mut wide = Description::uia_single_boom().unwrap();
        wide.set("cylinder.piston_mm=100").unwrap();
        let found = benchmark_stability(&wide, None).unwrap();
        assert_eq!(found.unstable_at_mm.len(), JUDGED_POSITIONS, "{found}");
    }

    #[test]
    fn a_strategy_is_judged_by_the_loops_that_it_closes() {
        let paper = Description::uia_single_boom().unwrap();
        let mut light = paper.clone();
        light.set("payload.mass_kg=100").unwrap();
        let unstable = |strategy| {
            let loops = stability_of(&[strategy], &paper, &light).unwrap();
            loops.iter().filter(|of| !of.stable).map(|of| of.controller).collect::<Vec<_>>()
        };
        assert!(unstable(Strategy::VelocityFeedforward).is_empty());
        // the simulated crane has the model's load, and its loop does not see the machine
        assert!(unstable(Strategy::SimulationFeedforwardOpenLoop).is_empty());
        assert_eq!(unstable(Strategy::SimulationFeedforwardClosedLoop), [BENCHMARK]);
        assert!(unstable(Strategy::BenchmarkClosedLoop).contains(&BENCHMARK));
    }
}

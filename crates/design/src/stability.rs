//! Stability of the control loops over the stroke, before anything moves: by the argument principle around the linearised crane.

use crate::design_report::{benchmark_loop, scheduled_lqr_loop_at};
use crate::scheduled_lqr::{designed, known_delay};
use crate::unstable_poles::unstable_poles;
use crate::{Actuation, DesignError, DesignReport, LinearisedPlant, Loop};
use hydroboom_control::strategy::Strategy;
use hydroboom_description::Description;
use hydroboom_math::Real;
use serde::Serialize;
use std::fmt;

/// Piston positions at which loops are looked at, as shares of the stroke.
pub const POSITIONS: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Drive, fieldbus and sensors that a loop is closed through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Equipment {
    /// The drive's lag and the fieldbus's delay that the controllers expect before anything is identified: a machine like the model.
    Expected,
    /// None: the motor turns as it is told, and readings come at once.
    Ideal,
    /// Those of the plant's crane file.
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

/// Whether a controller's loop is stable at [`POSITIONS`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoopStability {
    /// The controller: `benchmark`, `benchmark on the simulated crane` or `scheduled LQR`.
    pub controller: &'static str,
    /// What it is closed through.
    pub equipment: Equipment,
    /// Whether feedback adds no pole that grows (so fast that it doubles within 35 s) at any of the positions: closed loop against open loop, by the argument principle.
    pub stable: bool,
    /// Piston positions at which one does.
    pub unstable_at_mm: Vec<f64>,
    /// Most growing poles at one position.
    pub unstable_poles: u32,
}

impl LoopStability {
    /// From the growing poles at each piston position \[mm\].
    fn of(
        (controller, equipment): (&'static str, Equipment),
        poles: impl Iterator<Item = (f64, u32)>,
    ) -> Self {
        let growing: Vec<(f64, u32)> = poles.filter(|(_, poles)| *poles > 0).collect();
        Self {
            controller,
            equipment,
            stable: growing.is_empty(),
            unstable_at_mm: growing.iter().map(|(mm, _)| *mm).collect(),
            unstable_poles: growing.iter().map(|(_, poles)| *poles).max().unwrap_or(0),
        }
    }

    /// Those of the benchmark and of the scheduled LQR in design reports.
    pub fn of_reports(reports: &[DesignReport]) -> [Self; 2] {
        let benchmark = reports.iter().map(|r| (r.stroke_mm, r.benchmark.unstable_poles));
        let lqr = reports.iter().map(|r| (r.stroke_mm, r.scheduled_lqr.unstable_poles));
        let expected = Equipment::Expected;
        [Self::of((BENCHMARK, expected), benchmark), Self::of((SCHEDULED_LQR, expected), lqr)]
    }

    /// Whether a strategy steers through this loop; the benchmark that the scheduled LQR falls back on is not what it steers through.
    pub fn is_of(&self, strategy: Strategy) -> bool {
        closed_by(strategy).contains(&self.controller)
    }
}

/// Loops that a strategy steers through.
fn closed_by(strategy: Strategy) -> &'static [&'static str] {
    match strategy {
        Strategy::VelocityFeedforward => &[],
        Strategy::SimulationFeedforwardOpenLoop => &[SIMULATED],
        Strategy::BenchmarkClosedLoop => &[BENCHMARK],
        Strategy::SimulationFeedforwardClosedLoop => &[SIMULATED, BENCHMARK],
        Strategy::ScheduledLqr => &[SCHEDULED_LQR],
    }
}

/// Names of the loops.
const BENCHMARK: &str = "benchmark";
const SIMULATED: &str = "benchmark on the simulated crane";
const SCHEDULED_LQR: &str = "scheduled LQR";

impl fmt::Display for LoopStability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { controller, equipment, unstable_poles, .. } = self;
        if self.stable {
            return write!(
                f,
                "{controller}: the closed loop is stable over the stroke, {equipment}"
            );
        }
        let at: Vec<String> = self.unstable_at_mm.iter().map(|mm| format!("{mm:.0}")).collect();
        let poles = match unstable_poles {
            1 => "1 pole".into(),
            more => format!("up to {more} poles"),
        };
        write!(
            f,
            "{controller}: the closed loop is UNSTABLE at {} mm ({poles} in the right half plane, linearised at rest with sliding friction, {equipment})",
            at.join(", ")
        )
    }
}

/// Stability of the benchmark's loop with gains of the model, around a machine, or around the model itself with the drive and fieldbus that
/// the controllers expect.
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be linearised.
pub fn benchmark_stability(
    model: &Description,
    machine: Option<&Description>,
) -> Result<LoopStability, DesignError> {
    let poles = poles(model, machine, |_| Ok(benchmark_loop(model)))?;
    Ok(LoopStability::of((BENCHMARK, equipment_of(machine)), poles.into_iter()))
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

/// The same of the scheduled LQR, designed for the model, its payload weighed, and oil and drive of the machine identified.
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be linearised, or the regulator not be designed.
pub fn scheduled_lqr_stability(
    model: &Description,
    machine: Option<&Description>,
) -> Result<LoopStability, DesignError> {
    let known = machine.map_or_else(|| model.clone(), |machine| with_identified(model, machine));
    let design = designed(&known, known_delay(&known) as usize)?;
    let payload = machine.unwrap_or(model).numbers.payload;
    let around = |stroke| Ok(scheduled_lqr_loop_at(&known, &design, stroke, payload));
    let poles = poles(model, machine, around)?;
    Ok(LoopStability::of((SCHEDULED_LQR, equipment_of(machine)), poles.into_iter()))
}

/// Loops of the benchmark and of the scheduled LQR that are stable with the lags that the controllers expect, and not on an ideal plant, which has none: a law that
/// counts on a delay leads too much without it. A crane file that is run without a plant has such a one.
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be linearised, or the regulator not be designed.
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

/// Of loops that are unstable on an ideal plant, those that are stable with the lags that the controllers expect.
///
/// # Errors
///
/// As of [`unstable_on_ideal_equipment`].
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

/// Stability of all loops that strategies close: around the simulated crane, which has neither drive nor fieldbus, and around the machine. The
/// scheduled LQR falls back on the benchmark.
///
/// # Errors
///
/// [`DesignError`] when a crane cannot be linearised, or the regulator not be designed.
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

/// What is to be said of loops that are [stable with the lags that the controllers expect](stable_with_expected_lags), beside those that are not without them.
pub fn remark_on_expected_lags(stable: &[LoopStability]) -> Option<String> {
    let names: Vec<&str> = stable.iter().map(|of| of.controller).collect();
    (!names.is_empty()).then(|| {
        format!(
            "{}, as `design` and `check` judge it, the closed loop of the {} is stable: what differs is that delay. --plant virtual runs on a machine that has it",
            Equipment::Expected.to_string().replacen('w', "W", 1),
            names.join(" and of the ")
        )
    })
}

/// The same the other way round, beside loops that are stable with these lags and [unstable on an ideal plant](unstable_on_ideal_equipment).
pub fn remark_on_ideal_equipment(unstable: &[LoopStability]) -> Option<String> {
    let names: Vec<&str> = unstable.iter().map(|of| of.controller).collect();
    (!names.is_empty()).then(|| {
        format!(
            "With an ideal drive and no delay, as `motion` and `study` run a crane without a plant, the closed loop of the {} is UNSTABLE: it counts on the lags of drive \
             and fieldbus",
            names.join(" and of the ")
        )
    })
}

/// What a controller of a model knows that has identified a crane's oil and drive.
pub fn with_identified(model: &Description, crane: &Description) -> Description {
    let mut known = model.clone();
    let n = &mut known.numbers;
    let limits = (n.tuning.estimator_lowest_transition, n.tuning.estimator_highest_transition);
    n.transition = Real::clamp(crane.numbers.transition, limits.0, limits.1);
    let drive = Actuation::of(crane).drive[0];
    n.tuning.estimator_drive_lag = Real::clamp(
        drive,
        n.tuning.estimator_shortest_drive_lag,
        n.tuning.estimator_longest_drive_lag,
    );
    known
}

/// Piston position \[mm\] and growing poles there.
fn poles(
    model: &Description,
    machine: Option<&Description>,
    around: impl Fn(f64) -> Result<Loop, DesignError>,
) -> Result<Vec<(f64, u32)>, DesignError> {
    let one = |share: f64| {
        let stroke = share * model.numbers.stroke;
        let crane = LinearisedPlant::new(machine.unwrap_or(model), stroke)?;
        let around = around(stroke)?;
        let around = machine.map_or_else(|| around.clone(), |machine| around.clone().on(machine));
        Ok((stroke * 1e3, unstable_poles(&crane, &around)?))
    };
    POSITIONS.into_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_third_of_the_payload_makes_the_published_gains_unstable_and_leaves_the_regulator_stable() {
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
            assert_eq!((unstable.stable, unstable.unstable_at_mm.len()), (false, 5));
            assert!(unstable.to_string().contains("UNSTABLE at 25, 125, 250, 375, 475 mm"));
        }
        assert!(scheduled_lqr_stability(&light, None).unwrap().stable);
    }

    /// The law counts on the lags of drive and fieldbus, and leads too much where there are none: a payload at 9 m leaves it no margin for that. The run on the
    /// ideal plant swings its motor at 22 Hz.
    #[test]
    fn a_loop_is_judged_with_the_equipment_that_it_is_closed_through() {
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

    /// At 25 mm a piston of 100 mm makes the published loop grow by 0.1 to 0.25 1/s: slowly, and over a motion of 18 s by a factor of six and more.
    #[test]
    fn a_loop_that_grows_slowly_is_unstable_too() {
        let mut wide = Description::uia_single_boom().unwrap();
        wide.set("cylinder.piston_mm=100").unwrap();
        let found = benchmark_stability(&wide, None).unwrap();
        assert_eq!(found.unstable_at_mm.len(), 5, "{found}");
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

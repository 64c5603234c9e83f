//! Energy balance over a motion cycle: `ΔE = work − losses + mass defects`.

use crate::{LabError, plant};
use hydroboom_description::Description;
use hydroboom_model::energy::{Energy, Power};
use hydroboom_model::{Input, Scheme};
use serde::Serialize;

/// Definition of pump work and exchanged energy, as a sentence below a table.
pub const PUMP_WORK: &str = "\
Pump work: the power of the pump on the oil (flow times pressure at both ports), integrated over the cycle. Power \
that the oil returns counts negative. \
Exchanged: the same power's magnitude, integrated.";

/// Energy balance from the start of the cycle to one time.
#[derive(Clone, Copy, Debug)]
pub struct Balance {
    /// Time since the start of the cycle \[s\].
    pub time: f64,
    /// Energy gained since the start, by form \[J\].
    pub gained: Energy<f64>,
    /// Net work of the pump on the oil since the start \[J\].
    pub work: f64,
    /// Dissipated energy since the start \[J\].
    pub losses: f64,
}

/// Energy balance over one motion cycle with one integration scheme and step.
#[derive(Clone, Debug, Serialize)]
pub struct Audit {
    /// Name of the integration scheme.
    pub scheme: String,
    /// Integration step \[us\].
    pub step_us: f64,
    /// Energy of the crane at the end minus that at the start \[J\].
    pub change_j: f64,
    /// Net work of the pump on the oil \[J\].
    pub work_j: f64,
    /// Dissipated energy \[J\]: in valves, lines, leakage, cylinder friction, joints and end stops.
    pub losses_j: f64,
    /// Energy added by equations that do not conserve mass \[J\].
    pub defects_j: f64,
    /// Exchanged energy: integral of the magnitude of the pump's power \[J\].
    pub exchanged_j: f64,
    /// Residual |change − work + losses − defects| over the exchanged energy \[-\]: the error of the integration.
    pub relative_residual: f64,
    /// Name and integral of each power \[J\].
    pub by_name_j: Vec<(String, f64)>,
    /// Balance every 10 ms, for figures.
    #[serde(skip)]
    pub trace: Vec<Balance>,
}

/// Energy balance of one fast motion cycle under velocity feedforward, with an integration step \[s\].
///
/// The pump's speed is constant over a control period, or a longer step. Powers are integrated by the trapezoidal rule
/// within each step, so that the residual is the error of the integration step.
///
/// # Errors
///
/// [`LabError::Plant`] if the crane has no state of rest at the start of the motion; [`LabError::Simulation`] if its
/// state leaves the model's range of validity.
pub fn audit(description: &Description, scheme: Scheme, step: f64) -> Result<Audit, LabError> {
    let mut motion = description.motion(description.numbers.fast);
    // motion without the long pauses
    (motion.dwell, motion.rest) = (0.5, 0.5);
    let controller = description.benchmark();
    let mut crane = plant(description, &description.start(motion.start), scheme, step)?;
    let start = crane.energy();
    let before = start.total();
    let mut trace = Vec::new();
    let mut integral = Power::<f64>::default().to_array();
    let mut exchanged = 0.0;
    let held = (description.numbers.control_period / step).round().max(1.0);
    let periods = (motion.duration() / (held * step)).round() as u64;
    let shown = (10e-3 / (held * step)).round().max(1.0) as u64;
    for period in 0..periods {
        if period % shown == 0 {
            let (now, sum) = (crane.energy().to_array(), Power::from_array(integral));
            let pairs = now.into_iter().zip(start.to_array());
            let mut gained = start.to_array();
            for (gain, (now, start)) in gained.iter_mut().zip(pairs) {
                *gain = now - start;
            }
            trace.push(Balance {
                time: period as f64 * held * step,
                gained: Energy::from_array(gained),
                work: sum.pump,
                losses: sum.losses(),
            });
        }
        let reference = motion.reference(period as f64 * held * step);
        let pump_speed = controller.velocity_feedforward(&reference);
        let input = Input { pump_speed, holding_valve: 1.0 };
        let mut first = crane.power(&input);
        for _ in 0..held as u64 {
            crane.advance(&input, 1).map_err(LabError::during("energy audit"))?;
            let second = crane.power(&input);
            for (sum, (p, q)) in
                integral.iter_mut().zip(first.to_array().into_iter().zip(second.to_array()))
            {
                *sum += 0.5 * step * (p + q);
            }
            exchanged += 0.5 * step * (first.pump.abs() + second.pump.abs());
            first = second;
        }
    }
    let change = crane.energy().total() - before;
    let power = Power::from_array(integral);
    let residual = change - power.net();
    Ok(Audit {
        scheme: scheme_name(scheme).into(),
        step_us: step * 1e6,
        change_j: change,
        work_j: power.pump,
        losses_j: power.losses(),
        defects_j: power.defect_restrictions + power.defect_pump,
        exchanged_j: exchanged,
        relative_residual: residual.abs() / exchanged,
        by_name_j: Power::NAMES.iter().map(|n| n.to_string()).zip(integral).collect(),
        trace,
    })
}

/// Name of an integration scheme in commands and tables.
pub fn scheme_name(scheme: Scheme) -> &'static str {
    match scheme {
        Scheme::Published => "published",
        Scheme::Implicit => "implicit",
        Scheme::RungeKutta4 => "runge-kutta-4",
    }
}

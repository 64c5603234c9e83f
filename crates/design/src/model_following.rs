//! Model following for a crane: its state at rest and its oil spring at positions over the stroke, and gains for each.

use crate::{DesignError, Lifting, oil_spring};
use hydroboom_control::actuator_limits::ActuatorLimits;
use hydroboom_control::deviation::{DeviationDesign, DeviationFeedback};
use hydroboom_control::learner::Conditions;
use hydroboom_control::model_following::{BENDING, ModelFollowing, STATIONS};
use hydroboom_control::oil_stiffness::OilStiffness;
use hydroboom_control::reserve::Reserve;
use hydroboom_control::schedule::{PAYLOADS, Schedule};
use hydroboom_control::sooner::SoonerDesign;
use hydroboom_control::station::{Rest, Station};
use hydroboom_control::stroke_by_pressure::StrokeByPressure;
use hydroboom_control::way_back::{Pace, WayBackDesign};
use hydroboom_description::Description;
use hydroboom_description::schema::Numbers;
use hydroboom_math::Real;
use hydroboom_model::hydraulics::Cylinder;
use hydroboom_model::{Input, Scheme};
use hydroboom_plant::plant;
use std::f64::consts::TAU;

/// Feedback of what the machine differs: how fast a rate of the pressure is believed, over the position's bandwidth, and the pressure itself
/// \[rad/s\]; damping ratio, bandwidth over the frequency at which the crane rings. With what follows, found on
/// virtual cranes (seed 7), short of where less error costs more of the motor.
const RATE: f64 = 0.4;
const PRESSURE: f64 = TAU * 50.0;
const DAMPING: f64 = 0.65;
const SHARE: f64 = 0.62;
/// A push is believed so many times as fast beside, and that is heard from so many times what noise would ask for: twice as fast for sure
/// costs more of the motor at rest, five times as fast is nothing but noise.
const SOONER: SoonerDesign<f64> = SoonerDesign { times: 2.5, heard_from: 3.5, begun: 0.8 };
/// An encoder's position scatters by so much \[m\], the load pressure by so much \[Pa\]: half of that is two sensors' noise, the rest oil that is a
/// tenth or two softer or stiffer than thought. What no travel accounts for is followed that fast \[rad/s\].
const STROKE_SCATTER: f64 = 1e-5;
const PRESSURE_SCATTER: f64 = 1.2e4;
const PUMPED: f64 = 10.0;
/// Of what the boom gives. With none, what the pump bends of the boom is taken for what pushes; with all of it the load is led home, and the piston the later.
const BENDS: f64 = 0.4;
/// The crane rings so much faster than on its oil and boom alone. A third faster swings cranes whose load is other than thought.
const QUICKER: f64 = 1.2;
/// By so much the pressure dips below that of rest, or of the simulated crane if that is lower \[Pa\].
const DIP: f64 = 2e5;
/// Feedback is as fast on the softest oil as it were on oil of this share of stiff oil's bulk modulus.
const SOFTEST: f64 = 0.1;
/// A piston that was torn far off is brought back at this velocity over distance \[1/s\], slower by the frequency at which the crane rings.
const BACK: f64 = 4.0;
/// With this share of the motor's speed: more than all of it is asked for, for that leaves it at its limit until the piston is near.
const EAGER: Pace<f64> = Pace { by_ring: 0.8, motor_speed: 1.2 };
/// One that swings, with this share of what feedback may ask for: from nine tenths of it on, what turns in phase with the position drowns what brakes,
/// and half-loaded cranes may bounce between soft oil and stiff by 5 cm.
const WARY: Pace<f64> = Pace { by_ring: 0.4, motor_speed: 2.0 / 3.0 };
/// Of the motor, what waits until a piston is farther off than stiff oil lets a lost load throw it. With less, stiff cranes turn it faster than the benchmark does by
/// more than a twentieth; with more, all others come back later. What a lost load asks of either grows with its weight, so the share falls with the payload.
/// This is where it falls from.
const RESERVE: Reserve<f64> = Reserve { share: 0.152, beyond: 0.0, near: 3.5e-3, far: 5.5e-3 };
/// With this share of the largest payload nothing waits.
const NOTHING_WAITS: f64 = 0.96;
/// And a boom loses no more than it carries: no more waits than so many times what it carries of the largest payload.
const LOSES: f64 = 1.2;
/// Beyond what is fed forward so much of the motor's speed is not withheld, without payload and with the largest: what the benchmark turns at least for a load that is
/// lost, and a twentieth of all that it turns, is no less on any of 200 cranes.
const BEYOND: [f64; 2] = [0.0265, 0.2323];
/// Time constant in which the share of state feedback is smoothed \[s\]: bending above that which notches keep out.
const SMOOTHING: f64 = 0.003;

/// How far the pressure at which oil stiffens is from where the crane file has it, by standard deviation \[Pa\]: air in the oil is known badly.
pub(crate) const DOUBT: f64 = 8e5;

/// Stations keep so far from the ends of the stroke \[m\].
const MARGIN: f64 = 0.005;

/// Payloads at which state feedback is designed, as shares of the largest that is thought of.
const SHARES: [f64; PAYLOADS] = [0.0, 0.1, 0.25, 0.45, 0.7, 1.0];
/// The largest payload that is thought of, as a share of the description's.
const LARGEST: f64 = 1.3;

/// State feedback for any payload of the crane of a description.
///
/// # Errors
///
/// As [`model_following`].
pub fn schedule(description: &Description) -> Result<Schedule, DesignError> {
    let largest = LARGEST * description.numbers.payload.max(1.0);
    let payloads = SHARES.map(|share| share * largest);
    let mut laws = Vec::with_capacity(PAYLOADS);
    for payload in payloads {
        let mut loaded = description.clone();
        loaded.numbers.payload = payload;
        let law = model_following(&loaded)?;
        laws.push(ModelFollowing { reserve: reserve(payload / largest), ..law });
    }
    Ok(Schedule { payloads, laws: std::array::from_fn(|k| laws[k]) })
}

/// What of the motor waits of a crane that carries so much of the largest payload.
fn reserve(loaded: f64) -> Reserve<f64> {
    let share = RESERVE.share * (1.0 - loaded / NOTHING_WAITS);
    let [empty, full] = BEYOND;
    let beyond = empty + (full - empty) * loaded;
    Reserve { share: share.min(LOSES * loaded).max(0.0), beyond, ..RESERVE }
}

/// Conditions under which a crane is described.
pub fn conditions(numbers: &Numbers<f64>) -> Conditions {
    Conditions { payload: numbers.payload, transition: numbers.transition }
}

/// The numbers of a crane under other conditions.
pub fn under(conditions: &Conditions, numbers: &Numbers<f64>) -> Numbers<f64> {
    let Conditions { payload, transition } = *conditions;
    Numbers { payload, transition, ..*numbers }
}

pub(crate) fn stiffness<T: Real>(n: &Numbers<T>) -> OilStiffness<T> {
    OilStiffness {
        highest: n.bulk_modulus_max,
        lowest: n.bulk_modulus_min,
        transition: n.transition,
        width: n.transition_width,
    }
}

/// State feedback for the crane of a description.
///
/// # Errors
///
/// As [`stations`].
pub fn model_following(description: &Description) -> Result<ModelFollowing<f64>, DesignError> {
    let n = &description.numbers;
    Ok(law(n, stations(description)?, bending(description)?))
}

/// How the crane of a description rests, and its oil spring, at positions over its stroke.
///
/// # Errors
///
/// [`DesignError`] when the crane is nowhere at rest within its stroke, or does not ring on its oil.
pub fn stations(description: &Description) -> Result<[Station<f64>; STATIONS], DesignError> {
    let n = &description.numbers;
    let at = |stroke: f64| plant(description, &description.start(stroke), Scheme::Implicit, 1e-3);
    let stiffness = stiffness(n);
    let spacing = spacing(n.stroke);
    let mut stations = [Station::default(); STATIONS];
    for (k, station) in stations.iter_mut().enumerate() {
        let stroke = MARGIN + k as f64 * spacing;
        let crane = at(stroke)?;
        let step = 0.5 * MARGIN;
        let [below, above] = [at(stroke - step)?, at(stroke + step)?].map(|c| c.load_pressure());
        let flows = crane.flows(&Input { pump_speed: 0.0, holding_valve: 1.0 });
        // what leaves side A has to be delivered again
        let lost = flows.internal_leakage + flows.case_leakage_a + flows.bleed;
        let rest = Rest {
            load_pressure: crane.load_pressure(),
            load_pressure_slope: (above - below) / (2.0 * step),
            holding_speed: lost / (n.displacement * n.flow_gain),
        };
        let (spring, boom) = oil_spring(&Lifting::new(description, stroke)?)?;
        *station = Station::new(rest, &spring, stiffness.share(crane.outputs().pressure_a), boom);
    }
    Ok(stations)
}

fn spacing<T: Real>(stroke: T) -> T {
    (stroke - T::lit(2.0 * MARGIN)) / T::lit((STATIONS - 1) as f64)
}

/// Frequencies \[rad/s\] of the boom's first modes of bending in the middle of the stroke, once the pump lifts. Those that it has
/// not, or that the controller's rate does not reach, are put where a notch does little.
///
/// # Errors
///
/// [`DesignError`] when the crane cannot be linearised there.
pub fn bending(description: &Description) -> Result<[f64; BENDING], DesignError> {
    let crane = Lifting::new(description, 0.5 * description.numbers.stroke)?;
    let highest = 0.45 / description.numbers.control_period;
    let mut frequencies = crane.bending();
    let mut next =
        || TAU * frequencies.next().map_or(highest, |mode| mode.frequency_hz.min(highest));
    Ok(std::array::from_fn(|_| next()))
}

/// What is a share of a motor speed, as a speed.
fn pace<T: Real>(share: &Pace<f64>, whole: T) -> Pace<T> {
    Pace { by_ring: T::lit(share.by_ring), motor_speed: T::lit(share.motor_speed) * whole }
}

/// State feedback from the numbers of a description and what is known of its crane over the stroke.
pub fn law<T: Real>(
    n: &Numbers<T>,
    stations: [Station<T>; STATIONS],
    bending: [T; BENDING],
) -> ModelFollowing<T> {
    let lit = T::lit;
    let cylinder =
        Cylinder::from_diameters(n.piston, n.rod, n.stroke, n.dead_volume_a, n.dead_volume_b);
    let authority = n.following_effort * n.motor_speed;
    ModelFollowing {
        stations,
        first: lit(MARGIN),
        spacing: spacing(n.stroke),
        friction_pressure: n.coulomb / cylinder.piston_area,
        friction_speed: T::one() / n.steepness,
        stiffness: stiffness(n),
        doubt: lit(DOUBT),
        beyond_load: cylinder.area_ratio() * n.rod_side,
        bending,
        notches: ModelFollowing::notches(bending, n.control_period),
        smoothing: T::one() - (-n.control_period / lit(SMOOTHING)).exp(),
        lead: n.following_lead,
        deviation: DeviationFeedback::new(
            DeviationDesign {
                push: lit(TAU) * n.following_observer,
                sooner: SoonerDesign {
                    times: lit(SOONER.times),
                    heard_from: lit(SOONER.heard_from),
                    begun: lit(SOONER.begun),
                },
                rate: lit(RATE),
                pressure: lit(PRESSURE),
                drive: n.following_lead,
                lag: n.following_lead,
                by_pressure: StrokeByPressure {
                    stroke_scatter: lit(STROKE_SCATTER),
                    pressure_scatter: lit(PRESSURE_SCATTER),
                    keeps: (-lit(PUMPED) * n.control_period).exp(),
                },
                bends: lit(BENDS),
                quicker: lit(QUICKER),
                damping: lit(DAMPING),
                share: lit(SHARE),
                authority,
                motor_speed: n.motor_speed,
                way_back: WayBackDesign {
                    rate: lit(BACK),
                    eager: pace(&EAGER, n.motor_speed),
                    wary: pace(&WARY, authority),
                },
                dip: lit(DIP),
                softest: lit(SOFTEST),
            },
            n.control_period,
        ),
        reserve: reserve(1.0 / LARGEST).map(lit),
        damping: n.following_damping,
        bandwidth: lit(TAU) * n.following_bandwidth,
        limits: ActuatorLimits { speed: n.motor_speed, slew: n.motor_slew },
        turns: T::one(),
        period: n.control_period,
    }
}

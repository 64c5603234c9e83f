//! Random parameters of a family of virtual cranes, and the cranes that are drawn from them.

use crate::LabError;
use hydroboom_description::Description;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::f64::consts::TAU;

/// Random parameter of a family of cranes, uniformly distributed over its range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Variation {
    /// Name of the parameter with its unit.
    pub name: &'static str,
    /// Smallest value, in the unit of the name.
    pub low: f64,
    /// Largest value, in the unit of the name.
    pub high: f64,
}

const fn vary(name: &'static str, low: f64, high: f64) -> Variation {
    Variation { name, low, high }
}

/// All random parameters of a family, in the order in which they are drawn, each uniformly distributed over its range.
pub const VARIATIONS: [Variation; 10] = [
    vary("payload [% of the nominal]", 0.0, 120.0),
    vary("oil temperature [C]", 10.0, 60.0),
    vary("wear: leakage [times the nominal]", 0.5, 3.0),
    vary("air: transition pressure of the oil's stiffness [bar]", 20.0, 45.0),
    vary("friction [times the nominal]", 0.5, 1.6),
    vary("drive bandwidth [Hz]", 15.0, 80.0),
    vary("pump displacement [% of the nominal]", 97.0, 102.0),
    vary("pre-load at the start [%]", 85.0, 100.0),
    vary("rod-side pressure at the start [bar]", 2.0, 6.0),
    vary("accumulator pressure [bar]", 2.0, 3.2),
];

/// Further random parameters of a widened family in the order in which they are drawn. The virtual crane
/// draws the last one for each transducer separately.
pub const WIDENED: [Variation; 6] = [
    vary("beam: Young's modulus [times the nominal]", 0.8, 1.2),
    vary("base: stiffness [times the nominal]", 0.7, 1.3),
    vary("lines: dead volumes of cylinder and pump [times the nominal]", 0.7, 1.3),
    vary("sensors: lag [ms beyond the nominal]", -0.2, 0.2),
    vary("fieldbus: delay each way [whole cycles beyond the nominal]", -1.0, 1.0),
    vary("pressure transducers: constant error [% of the span]", -0.5, 0.5),
];

/// Shortest lag of a sensor \[s\]. Below it the lag is zero, because its bandwidth cannot be stated.
const SHORTEST_LAG: f64 = 1e-5;

/// Crane of a family, with the random parameters that were drawn for it.
#[derive(Clone, Debug)]
pub struct Member {
    /// Values of [`VARIATIONS`], and in a widened family of [`WIDENED`] except its last entry, in the units of their
    /// names.
    pub values: Vec<f64>,
    /// Description of the crane.
    pub crane: Description,
}

/// Crane of a family with the given number, with the values of [`VARIATIONS`] drawn for it. It depends on seed, number
/// and nominal crane only. The pump's leakage and slip share one factor, and so do all terms of the friction.
///
/// # Errors
///
/// [`LabError::Description`] if such a machine cannot exist.
pub fn member(nominal: &Description, seed: u64, number: u64) -> Result<Member, LabError> {
    // a random stream of its own, so that cranes can be drawn in any order
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let values = VARIATIONS.map(|v| random.random_range(v.low..=v.high));
    let [payload, oil, wear, air, friction, drive, displacement, preload, rod_side, accumulator] =
        values;
    let n = &nominal.numbers;
    let mut crane = nominal.clone();
    for assignment in [
        format!("payload.mass_kg={}", n.payload * payload / 100.0),
        format!("temperature.oil_c={oil}"),
        format!("oil.transition_bar={air}"),
        format!("pump.internal_leakage_m3_s_sqrtpa={:e}", n.internal_leakage * wear),
        format!("pump.case_leakage_a_m3_s_sqrtpa={:e}", n.case_leakage_a * wear),
        format!("pump.case_leakage_b_m3_s_sqrtpa={:e}", n.case_leakage_b * wear),
        format!("friction.coulomb_n={}", n.coulomb * friction),
        format!("friction.stiction_n={}", n.stiction * friction),
        format!("friction.viscous_ns_per_m={}", n.viscous * friction),
        format!("drive.bandwidth_hz={drive}"),
        format!("pump.displacement_cm3={}", n.displacement * 1e6 * displacement / 100.0),
        format!("start.preload_percent={preload}"),
        format!("start.rod_side_bar={rod_side}"),
        format!("accumulator.working_bar={accumulator}"),
        format!("virtual.seed={}", number + 1),
    ] {
        crane.set(&assignment)?;
    }
    crane.numbers.slip_at_rest *= wear;
    crane.numbers.slip_per_speed *= wear;
    Ok(Member { values: values.to_vec(), crane })
}

/// Crane of a widened family: [`member`] with the variations of [`WIDENED`] added, from a separate random
/// stream.
///
/// # Errors
///
/// [`LabError::Description`] if such a machine cannot exist.
pub fn widened(nominal: &Description, seed: u64, number: u64) -> Result<Member, LabError> {
    let Member { mut values, mut crane } = member(nominal, seed, number)?;
    let stream = seed.rotate_left(32) ^ number.wrapping_mul(0xd1b5_4a32_d192_ed03);
    let mut random = Pcg64Mcg::seed_from_u64(!stream);
    let [beam, base, volumes, lag, delay, transducers] = WIDENED;
    let [beam, base, volumes, lag] =
        [beam, base, volumes, lag].map(|v| random.random_range(v.low..=v.high));
    let cycles = random.random_range(delay.low as i32..=delay.high as i32);
    let transducer_seed = random.random_range(1..=1_u64 << 50);
    let n = &nominal.numbers;
    let known_lag = match n.sensor_bandwidth > 0.0 {
        true => 1.0 / (TAU * n.sensor_bandwidth),
        false => 0.0,
    };
    let sensor_lag = known_lag + lag * 1e-3;
    let bandwidth = if sensor_lag > SHORTEST_LAG { 1.0 / (TAU * sensor_lag) } else { 0.0 };
    for assignment in [
        format!("boom.youngs_modulus_gpa={}", n.youngs_modulus * 1e-9 * beam),
        format!("base.stiffness_knm_per_rad={}", n.base_stiffness * 1e-3 * base),
        format!("cylinder.dead_volume_a_l={}", n.dead_volume_a * 1e3 * volumes),
        format!("cylinder.dead_volume_b_l={}", n.dead_volume_b * 1e3 * volumes),
        format!("pump.volume_a_l={}", n.volume_pump_a * 1e3 * volumes),
        format!("pump.volume_b_l={}", n.volume_pump_b * 1e3 * volumes),
        format!("sensors.bandwidth_hz={bandwidth}"),
        format!("fieldbus.delay_cycles={}", (n.fieldbus_delay + f64::from(cycles)).max(0.0)),
        format!("sensors.pressure_error_percent={}", transducers.high),
        format!("virtual.seed={transducer_seed}"),
    ] {
        crane.set(&assignment)?;
    }
    values.extend([beam, base, volumes, lag, f64::from(cycles)]);
    Ok(Member { values, crane })
}

/// Cranes 0 to `count` - 1 of a family, widened or not.
///
/// # Errors
///
/// [`LabError::Description`] if one of them cannot exist.
pub fn members(
    nominal: &Description,
    (count, seed): (u64, u64),
    is_widened: bool,
) -> Result<Vec<Member>, LabError> {
    let of = if is_widened { widened } else { member };
    (0..count).map(|number| of(nominal, seed, number)).collect()
}

/// Random parameters of a family; those of [`WIDENED`] are appended for a widened one.
pub fn variations(is_widened: bool) -> Vec<Variation> {
    let more: &[Variation] = if is_widened { &WIDENED } else { &[] };
    [&VARIATIONS, more].concat()
}

/// The crane after years of wear: three times the internal leakage and slip of the pump, a third more Coulomb and static
/// friction, a transition pressure of the oil that is 5 bar higher.
///
/// # Errors
///
/// [`LabError::Description`] if such a machine cannot exist.
pub fn worn(crane: &Description) -> Result<Description, LabError> {
    let n = &crane.numbers;
    let mut worn = crane.clone();
    for assignment in [
        format!("pump.internal_leakage_m3_s_sqrtpa={:e}", 3.0 * n.internal_leakage),
        format!("friction.coulomb_n={}", 1.33 * n.coulomb),
        format!("friction.stiction_n={}", 1.33 * n.stiction),
        format!("oil.transition_bar={}", n.transition * 1e-5 + 5.0),
    ] {
        worn.set(&assignment)?;
    }
    worn.numbers.slip_at_rest *= 3.0;
    worn.numbers.slip_per_speed *= 3.0;
    Ok(worn)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_member_depends_on_seed_and_number_alone() {
        let nominal = Description::uia_virtual().unwrap();
        let values = |seed, number| member(&nominal, seed, number).unwrap().values;
        assert_eq!(values(1, 5), values(1, 5));
        assert_ne!(values(1, 5), values(1, 6));
        assert_ne!(values(1, 5), values(2, 5));
        for number in 0..100 {
            for (value, range) in values(3, number).iter().zip(VARIATIONS) {
                assert!((range.low..=range.high).contains(value), "{}: {value}", range.name);
            }
        }
    }

    /// A widened member equals the member except in the further variations, which depend on seed and number
    /// only.
    #[test]
    fn a_widened_member_is_the_member_with_further_variations() {
        let nominal = Description::uia_virtual().unwrap();
        let known = member(&nominal, 1, 5).unwrap();
        let wide = |seed, number| widened(&nominal, seed, number).unwrap();
        assert_eq!(wide(1, 5).crane.numbers, wide(1, 5).crane.numbers);
        assert_eq!(wide(1, 5).values[..VARIATIONS.len()], known.values);
        let mut back = wide(1, 5).crane.numbers;
        let n = &known.crane.numbers;
        (back.youngs_modulus, back.base_stiffness) = (n.youngs_modulus, n.base_stiffness);
        (back.dead_volume_a, back.dead_volume_b) = (n.dead_volume_a, n.dead_volume_b);
        (back.volume_pump_a, back.volume_pump_b) = (n.volume_pump_a, n.volume_pump_b);
        (back.sensor_bandwidth, back.fieldbus_delay) = (n.sensor_bandwidth, n.fieldbus_delay);
        (back.pressure_error, back.seed) = (n.pressure_error, n.seed);
        assert_eq!(back, *n);
        let beyond = |seed, number| wide(seed, number).values[VARIATIONS.len()..].to_vec();
        assert!(beyond(1, 5) != beyond(1, 6) && beyond(1, 5) != beyond(2, 5));
        let lag = |crane: &Description| 1e3 / (TAU * crane.numbers.sensor_bandwidth);
        let mut delays = [false; 3];
        for number in 0..100 {
            let Member { values, crane } = wide(3, number);
            for (value, range) in values.iter().zip(variations(true)) {
                assert!((range.low..=range.high).contains(value), "{}: {value}", range.name);
            }
            let off = lag(&crane) - lag(&nominal);
            assert!(off.abs() <= 0.2 + 1e-9, "{off} ms");
            delays[crane.numbers.fieldbus_delay as usize] = true;
            assert!(
                (0.7..1.3).contains(&(crane.numbers.dead_volume_a / nominal.numbers.dead_volume_a))
            );
        }
        assert_eq!(delays, [true; 3]);
    }
}

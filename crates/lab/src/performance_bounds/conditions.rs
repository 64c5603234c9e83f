//! Numbers that the bounds depend on, with units and sources.

use super::delay::Delay;
use super::disturbances::Disturbances;
use super::sensor_noise::SensorNoise;
use super::unknown_payload::deviation;
use hydroboom_description::Description;
use serde::Serialize;

/// Quantity on which the performance bounds depend, with value, unit and source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Condition {
    /// Name of the quantity.
    pub name: &'static str,
    /// Value of the quantity, in the unit of the field `unit`.
    pub value: f64,
    /// Unit of the value, as text.
    pub unit: &'static str,
    /// Keys of the crane file that determine it, with their provenance.
    pub source: String,
}

/// Numbers that the bounds depend on.
pub(super) fn conditions(crane: &Description, payloads: [f64; 2]) -> Vec<Condition> {
    let n = &crane.numbers;
    let (delay, noise, disturbances) =
        (Delay::of(crane), SensorNoise::of(crane), Disturbances::of(crane));
    let source = |paths: &[&str]| {
        let of = |path: &&str| {
            let mut entries = crane.entries();
            let found = entries.find(|(key, _, _)| key.path() == **path);
            let provenance = found.map_or("", |(_, _, origin)| origin.provenance.as_str());
            match provenance {
                "" | "absent" => format!("{path} (default)"),
                provenance => format!("{path} ({provenance})"),
            }
        };
        paths.iter().map(of).collect::<Vec<_>>().join(", ")
    };
    let one =
        |name, value, unit, paths: &[&str]| Condition { name, value, unit, source: source(paths) };
    let rpm = 60.0;
    vec![
        one("largest motor speed", n.motor_speed * rpm, "rpm", &["motor.max_speed_rpm"]),
        one("motor slew rate", n.motor_slew * rpm, "rpm/s", &["motor.slew_rpm_per_s"]),
        one(
            "delay from position to motor",
            1e3 * delay.time(),
            "ms",
            &["fieldbus.delay_cycles", "sensors.bandwidth_hz", "drive.dead_time_ms"],
        ),
        one(
            "position noise",
            1e3 * noise.position,
            "mm",
            &["sensors.position_noise_mm", "sensors.position_resolution_mm"],
        ),
        one(
            "load pressure noise",
            1e-5 * noise.load_pressure,
            "bar",
            &["sensors.pressure_noise_percent", "sensors.pressure_bits"],
        ),
        one("payload", n.payload, "kg", &["payload.mass_kg"]),
        Condition {
            name: "payload unknown by (std)",
            value: deviation(payloads),
            unit: "kg",
            source: format!("uniform from {:.0} to {:.0} kg", payloads[0], payloads[1]),
        },
        one(
            "drift of an unknown force",
            1e-5 * disturbances.force,
            "bar/s^0.5",
            &["estimator.disturbance_drift_bar"],
        ),
        one(
            "drift of friction",
            1e-5 * disturbances.friction,
            "bar/s^0.5",
            &["estimator.friction_drift_bar"],
        ),
        one(
            "drift of an unknown flow",
            rpm * disturbances.flow,
            "rpm/s^0.5",
            &["estimator.flow_drift_rpm"],
        ),
    ]
}

//! Data that is constant during a run: the crane's geometry and the available selections.

use crate::choice::Choice;
use hydroboom_control::strategy::Strategy;
use hydroboom_description::{BuildError, Description};
use hydroboom_model::Crane;
use hydroboom_realtime::fault::Fault;
use serde_json::{Value, json};
use std::ops::RangeInclusive;

/// Data of a dashboard that are constant during a run.
pub struct Setup<'a> {
    /// Description of the crane, for its geometry.
    pub model: &'a Description,
    /// Names of the available scenarios.
    pub scenarios: Vec<String>,
    /// Allowed speeds of an out-and-back motion \[mm/s\].
    pub speeds_mm_s: RangeInclusive<f64>,
    /// Strategy and course that are selected at first.
    pub first: Choice,
    /// Whether the crane is virtual, so that faults may be injected.
    pub is_virtual: bool,
    /// Whether the run is in real time; otherwise simulated time may run faster.
    pub in_real_time: bool,
}

/// The crane's geometry, drawn at any joint angles.
pub(crate) struct Scene {
    crane: Crane<f64, 3>,
    setup: Value,
}

impl Scene {
    pub(crate) fn new(setup: &Setup<'_>) -> Result<Self, BuildError> {
        let n = &setup.model.numbers;
        let faults: Vec<String> = match setup.is_virtual {
            true => Fault::of_machine().into_iter().map(Fault::name).collect(),
            false => Vec::new(),
        };
        let value = json!({
            "type": "setup", "crane_name": setup.model.name, "virtual": setup.is_virtual,
            "real_time": setup.in_real_time,
            "base_m": [n.base_x, n.base_y], "shortest_m": n.shortest, "stroke_mm": n.stroke * 1e3,
            "boom_m": n.boom_length, "payload_kg": n.payload,
            "speed_mm_s": n.fast * 1e3,
            "least_speed_mm_s": setup.speeds_mm_s.start(), "most_speed_mm_s": setup.speeds_mm_s.end(),
            "strategies": Strategy::ALL.map(Strategy::name), "scenarios": setup.scenarios,
            "faults": faults, "period_us": [n.simulation_period * 1e6, n.control_period * 1e6],
        });
        let mut scene = Self { crane: setup.model.crane::<3>()?, setup: value };
        let tip = |stroke: f64| scene.drawn(&[0.0; 3], stroke)["boom"][3].clone();
        let reach = json!([tip(0.0), tip(0.5 * n.stroke), tip(n.stroke)]);
        scene.setup["reach_m"] = reach;
        Ok(scene)
    }

    /// Data that a new viewer receives first.
    pub(crate) fn setup(&self) -> &Value {
        &self.setup
    }

    /// Positions \[m\] of the boom's joints from bearing to tip and of the cylinder's mount, for the
    /// segments' absolute angles \[rad\]. The boom is rotated so that the cylinder has the measured stroke
    /// \[m\].
    pub(crate) fn drawn(&self, angle: &[f64; 3], stroke: f64) -> Value {
        let boom = &self.crane.boom;
        let stroke_at =
            |turned: f64| boom.cylinder_pose(&boom.pose(&angle.map(|a| a + turned))).stroke;
        let mut turned = 0.0;
        if stroke.is_finite() {
            // secant steps: the stroke is almost linear in the angle
            for _ in 0..6 {
                let slope = (stroke_at(turned + 1e-4) - stroke_at(turned)) / 1e-4;
                turned += (stroke - stroke_at(turned)) / slope;
            }
        }
        let turned = if turned.is_finite() { turned } else { 0.0 };
        let pose = boom.pose(&angle.map(|a| a + turned));
        let mut line = vec![[0.0; 2]];
        line.extend((0..boom.len()).map(|i| boom.joint_position(&pose, i)));
        json!({
            "boom": line.iter().map(|p| p.map(shorter)).collect::<Vec<_>>(),
            "mount": boom.mount_position(&pose).map(shorter),
            "deflection_mm": shorter(boom.tip_deflection(&pose) * 1e3),
        })
    }
}

/// Rounds to five decimals, which is enough for a drawing.
pub(crate) fn shorter(value: f64) -> f64 {
    (value * 1e5).round() * 1e-5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice::Course;

    #[test]
    fn the_crane_is_drawn_at_its_piston_position() {
        let model = Description::uia_single_boom().unwrap();
        let setup = Setup {
            model: &model,
            scenarios: vec![],
            speeds_mm_s: 0.1..=240.0,
            first: Choice {
                strategy: Strategy::BenchmarkClosedLoop,
                course: Course::Motion { speed_mm_s: 120.0 },
            },
            is_virtual: true,
            in_real_time: false,
        };
        let scene = Scene::new(&setup).unwrap();
        for stroke in [0.05, 0.2, 0.45] {
            let drawn = scene.drawn(&[0.1, 0.09, 0.08], stroke);
            let [x, y] = [0, 1].map(|k| drawn["mount"][k].as_f64().unwrap());
            let n = &model.numbers;
            let length = (x - n.base_x).hypot(y - n.base_y);
            assert!((length - n.shortest - stroke).abs() < 2e-5, "{length} m at {stroke} m");
            assert_eq!(drawn["boom"].as_array().unwrap().len(), 4);
        }
        // a sensor without a valid number still gives a complete drawing
        assert!(scene.drawn(&[0.1, 0.09, 0.08], f64::NAN)["mount"][0].is_number());
    }
}
